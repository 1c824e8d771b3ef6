"""`recon build`."""

from __future__ import annotations

import logging
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import click

from recon.cli.building_options import building_options
from recon.cli.drawing_options import check_drawings, drawing_options
from recon.cli.mesh_options import mesh_options
from recon.cli.options import PATH, configuration, examples, resolve_config, topic_choice, verbosity, warn

if TYPE_CHECKING:
    from recon.config import Config
    from recon.exporters.options import ExportOptions
    from recon.measured import Measured
    from recon.sequence.sequence import Sequence


@click.command(
    short_help="Make a textured model from a sequence.",
    epilog=examples(
        "recon build drive/ -o model.usd",
        "recon build drive/ -o model.glb -o plan.dxf -o plan.svg",
        "recon build drive.bag -o model.usd --scan-topic /front/scan",
        "recon build drive/ -o model.usd --tape tape.csv   (walls by their ids in layout.json)",
        "recon build drive/ -o model.usd --control marks.csv --control corners.csv",
        "recon build drive/ --work result.recon --config site.toml --seed 7",
    ),
)
@click.argument("sequence", type=PATH)
@click.option(
    "-o",
    "--output",
    "outputs",
    type=PATH,
    multiple=True,
    help="File to write, the suffix says the format; may be repeated.",
)
@click.option("--work", type=PATH, help="Result folder (default: the first output with the suffix .recon).")
@topic_choice
@click.option("--backend", type=click.Choice(["graph", "ekf"]), help="Factor graph (default), or the paper's filter.")
@click.option("--tape", type=PATH, help="CSV of distances measured by hand: wall_a,wall_b,distance,sigma.")
@click.option(
    "--control",
    type=PATH,
    multiple=True,
    help="CSV of surveyed points: time,x,y,sigma or wall_a,wall_b,x,y,sigma; may be repeated.",
)
@configuration
@building_options
@drawing_options
@mesh_options
@verbosity
def build(
    sequence: Path,
    outputs: tuple[Path, ...],
    work: Path | None,
    topics: dict[str, str],
    backend: Literal["graph", "ekf"] | None,
    tape: Path | None,
    control: tuple[Path, ...],
    config_file: Path | None,
    seed: int | None,
    workers: int | None,
    buildings: dict[str, Any],
    drawings: dict[str, Any],
    meshes: dict[str, Any],
    quiet: bool,
) -> None:
    """Builds a textured model of the building from a SEQUENCE: a folder, a ROS bag or a CARMEN log.

    Writes every OUTPUT and, beside the first, a result folder with the layout, trajectories, calibration, labels,
    textures and a report, from which other formats can be exported later.
    """
    from recon.cli.outputs import work_folder
    from recon.control import read_control
    from recon.exporters import check_outputs
    from recon.exporters.options import ExportOptions
    from recon.measured import Measured
    from recon.plan.options import DrawingOptions
    from recon.sequence.open import open_sequence
    from recon.sequence.topics import Topics
    from recon.tape import read_tape

    if not outputs and work is None:
        raise click.UsageError("Give an output with -o (for example -o model.usd), or a result folder with --work.")
    config = resolve_config(config_file, seed, workers)
    if backend is not None:
        config = replace(config, graph=replace(config.graph, backend=backend))
    options = ExportOptions(**meshes, **buildings, drawing=DrawingOptions(**drawings))
    check_drawings(drawings, outputs)
    check_outputs(list(outputs), options)
    folder = work_folder(outputs, work)
    measured = Measured(read_tape(tape) if tape else None, read_control(control) if control else None)
    drive = open_sequence(sequence, Topics(**topics))
    for message in drive.warnings:
        warn(message, quiet)
    _build(drive, config, measured, folder, outputs, options, quiet)


def _build(
    drive: Sequence,
    config: Config,
    measured: Measured,
    folder: Path,
    outputs: tuple[Path, ...],
    options: ExportOptions,
    quiet: bool,
) -> None:
    """The work; its imports take seconds and come after everything that is quickly refused."""
    from recon.cli.progress import terminal_progress
    from recon.cli.summary import by_hand, summary
    from recon.exporters import export
    from recon.pipeline import build as build_model
    from recon.results import save_result

    progress = terminal_progress(quiet)
    result = build_model(drive, config, progress, measured)
    said: list[str] = []
    with progress.stage("writing"):
        save_result(result, folder, outputs)
        for path in outputs:
            said += export(result.model, path, options)
    for message in result.warnings:
        if message not in drive.warnings:  # those were said at the start
            warn(message, quiet)
    for message in said:
        warn(message, quiet)
    clock = () if result.calibration is None else (f"{result.calibration.clock}.",)
    for note in (*result.model.notes, *result.model.picture_notes, *clock):
        logging.getLogger("recon").info(note)
    if not quiet:
        for line in (*by_hand(result), *summary(result.model, folder, outputs)):
            click.echo(line)
