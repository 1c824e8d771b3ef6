"""`recon bench`."""

from __future__ import annotations

from pathlib import Path

import click

from recon.cli.options import PATH, configuration, examples, verbosity


@click.group(short_help="Repeat published experiments.", epilog=examples("recon bench paper sets/"))
def bench() -> None:
    """Experiments of publications, repeated on data in DIR."""


@bench.command(
    short_help="The paper's Table 1, with our row.",
    epilog=examples("recon bench paper sets/", "recon bench paper sets/ --work results/ --noise 0.05"),
)
@click.argument("folder", metavar="DIR", type=PATH)
@click.option("--noise", type=click.FloatRange(0.0, 1.0), help="Standard deviation of the ranges, m (default 0.02).")
@click.option("--work", type=PATH, help="Keep the result folders here, one a set.")
@configuration
@verbosity
def paper(
    folder: Path,
    noise: float | None,
    work: Path | None,
    config_file: Path | None,
    seed: int | None,
    workers: int | None,
    quiet: bool,
) -> None:
    """Labels the images of the sets in DIR and prints the paper's Table 1 with the accuracy reached.

    A set is a folder of images, label images, intrinsics and the camera's height (docs/formats.md). The scans are made
    from its ground truth, as the paper did.
    """
    import tempfile

    from recon.cli.options import resolve_config
    from recon.cli.outputs import check_writable
    from recon.cli.progress import terminal_progress
    from recon.evaluate.image_set import find_image_sets
    from recon.evaluate.paper import RANGE_NOISE, run_set, table

    config, sets = resolve_config(config_file, seed, workers), find_image_sets(folder)
    if work is not None:
        check_writable(work)
        work.mkdir(exist_ok=True)
    results = []
    with tempfile.TemporaryDirectory() as scratch:
        for image_set in sets:
            place = (Path(scratch) if work is None else work) / f"{image_set.name}.recon"
            sigma = RANGE_NOISE if noise is None else noise
            results.append(run_set(image_set, config, sigma, place, terminal_progress(quiet)))
    click.echo(table(results))
