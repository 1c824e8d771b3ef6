"""`recon export`."""

from __future__ import annotations

from pathlib import Path

import click

from recon.cli.options import PATH, examples, verbosity


@click.command(
    short_help="Write a result in other formats.",
    epilog=examples("recon export model.recon/ -o model.glb", "recon export model.recon/ -o plan.dxf -o plan.svg"),
)
@click.argument("result", type=PATH)
@click.option(
    "-o",
    "--output",
    "outputs",
    type=PATH,
    multiple=True,
    required=True,
    help="File to write, the suffix says the format; may be repeated.",
)
@verbosity
def export(result: Path, outputs: tuple[Path, ...], quiet: bool) -> None:
    """Writes other formats from the RESULT folder of a build; nothing is computed again."""
    from recon.exporters import check_outputs
    from recon.exporters import export as write
    from recon.results import load_model

    check_outputs(list(outputs))
    model = load_model(result)
    for path in outputs:
        write(model, path)
        if not quiet:
            click.echo(path)
