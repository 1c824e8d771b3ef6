"""`recon export`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from recon.cli.mesh_options import mesh_options
from recon.cli.options import PATH, examples, verbosity, warn


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
@mesh_options
@verbosity
def export(result: Path, outputs: tuple[Path, ...], meshes: dict[str, Any], quiet: bool) -> None:
    """Writes other formats from the RESULT folder of a build; nothing is computed again."""
    from recon.exporters import check_outputs
    from recon.exporters import export as write
    from recon.exporters.options import ExportOptions
    from recon.results import load_model

    options = ExportOptions(**meshes)
    check_outputs(list(outputs), options)
    model = load_model(result)
    for path in outputs:
        for note in write(model, path, options):
            warn(note, quiet)
        if not quiet:
            click.echo(path)
