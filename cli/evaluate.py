"""`recon eval`."""

from __future__ import annotations

import json
from pathlib import Path

import click

from recon.cli.options import PATH, examples, verbosity


@click.command(
    "eval",
    short_help="Compare a result with ground truth.",
    epilog=examples(
        "recon eval drive/ model.recon/",
        "recon eval drive/ model.recon/ --json scores.json",
        "recon eval drive/ model.recon/ --plot drive.png",
        "recon eval drive/ model.recon/ --pictures worst/",
        "recon eval drive/ model.recon/ --views",
    ),
)
@click.argument("sequence", type=PATH)
@click.argument("result", type=PATH)
@click.option("--json", "json_file", type=PATH, help="Write the numbers here too; - prints them instead of the table.")
@click.option("--plot", type=PATH, help="Draw trajectory, walls, loop closures and errors: .png, .svg or .pdf.")
@click.option("--pictures", type=PATH, help="Folder for pictures of the images whose labels are the least right.")
@click.option(
    "--views",
    is_flag=True,
    help="Texture the model again without every fifth image and compare these with what it shows there; needs no "
    "ground truth. Pictures go to RESULT/views, or to views in the folder of --pictures.",
)
@verbosity
def evaluate(
    sequence: Path,
    result: Path,
    json_file: Path | None,
    plot: Path | None,
    pictures: Path | None,
    views: bool,
    quiet: bool,
) -> None:
    """Compares the RESULT folder of a build with the ground truth of its SEQUENCE folder."""
    from recon.cli.outputs import check_writable
    from recon.drawing import check_suffix
    from recon.evaluate import confusion_pictures, plot_result
    from recon.evaluate import evaluate as compare
    from recon.files import atomic_path

    to_stdout = json_file == Path("-")
    for path in (None if to_stdout else json_file, plot, pictures):
        if path is not None:
            check_writable(path)
    if plot is not None:
        check_suffix(plot)
    folder = (result if pictures is None else pictures) / "views" if views else None
    evaluation = compare(sequence, result, folder)
    text = json.dumps(evaluation.to_json(), indent=1)
    if plot is not None:
        plot_result(sequence, result, plot)
    if pictures is not None:
        confusion_pictures(sequence, result, pictures)
    if to_stdout:
        click.echo(text)
        return
    if json_file is not None:
        with atomic_path(json_file) as temporary:
            temporary.write_text(text + "\n", encoding="utf-8")
    if not quiet:
        click.echo(evaluation.table())
        if folder is not None:
            shown = "" if pictures is not None else f"; recon report {result} puts the worst, middling and best into it"
            click.echo(f"Photo, model and difference of every image left out: {folder}{shown}")
