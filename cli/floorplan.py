"""`recon floorplan`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from recon.cli.drawing_options import check_drawings, drawing_options
from recon.cli.options import PATH, configuration, examples, resolve_config, topic_choice, verbosity, warn


@click.command(
    short_help="Draw the floor plan of a sequence, and nothing else.",
    epilog=examples(
        "recon floorplan drive/ -o plan.pdf",
        "recon floorplan drive.bag -o plan.dxf -o plan.png --scale 1:100 --paper A3",
        "recon floorplan drive/ -o plan.pdf --no-images      (scans alone: quicker, no heights)",
    ),
)
@click.argument("sequence", type=PATH)
@click.option(
    "-o",
    "--output",
    "outputs",
    type=PATH,
    multiple=True,
    required=True,
    help="Plan to write: .pdf .dxf .svg .png .json; may be repeated.",
)
@click.option("--no-images", is_flag=True, help="From the scans alone.")
@topic_choice
@drawing_options
@configuration
@verbosity
def floorplan(
    sequence: Path,
    outputs: tuple[Path, ...],
    no_images: bool,
    topics: dict[str, str],
    drawings: dict[str, Any],
    config_file: Path | None,
    seed: int | None,
    workers: int | None,
    quiet: bool,
) -> None:
    """Draws the floor plan of a SEQUENCE: a folder, a ROS bag or a CARMEN log.

    The plan is that of `recon build`; textures, heights of objects and a result folder are left out, which takes a
    fraction of the time.
    """
    from dataclasses import replace

    from recon.exporters import DRAWINGS, check_outputs
    from recon.exporters.options import ExportOptions
    from recon.plan.options import DrawingOptions
    from recon.sequence.open import open_sequence
    from recon.sequence.topics import Topics

    for path in outputs:
        if path.suffix.lower() not in (*DRAWINGS, ".json"):
            raise click.UsageError(f"{path}: is no plan, expected one of {' '.join(sorted(DRAWINGS))} .json")
    options = ExportOptions(drawing=DrawingOptions(**drawings))
    check_drawings(drawings, outputs)
    config = resolve_config(config_file, seed, workers)
    check_outputs(list(outputs))
    drive = open_sequence(sequence, Topics(**topics))
    if no_images:
        drive = replace(drive, images=None, camera=None)
    for message in drive.warnings:
        warn(message, quiet)

    from recon.cli.progress import terminal_progress
    from recon.exporters import export
    from recon.pipeline import build

    progress = terminal_progress(quiet)
    result = build(drive, config, progress, plan_only=True)
    with progress.stage("writing"):
        for path in outputs:
            export(result.model, path, options)
    for message in result.warnings:
        if message not in drive.warnings:
            warn(message, quiet)
    if not quiet:
        for path in outputs:
            click.echo(path)
