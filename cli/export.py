"""`recon export`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from recon.cli.building_options import building_options
from recon.cli.drawing_options import check_drawings, drawing_options
from recon.cli.mesh_options import mesh_options
from recon.cli.options import PATH, examples, verbosity, warn
from recon.cli.storeys import Place, check_storeys, load_building


@click.command(
    short_help="Write a result in other formats.",
    epilog=examples(
        "recon export model.recon/ -o model.glb",
        "recon export model.recon/ -o plan.dxf -o plan.svg -o building.ifc -o map.yaml",
        "recon export ground.recon/ first.recon/ --storey Ground --elevation 0 --storey First --elevation 3.2"
        " -o building.ifc",
    ),
)
@click.argument("results", metavar="RESULT...", type=PATH, nargs=-1, required=True)
@click.option(
    "-o",
    "--output",
    "outputs",
    type=PATH,
    multiple=True,
    required=True,
    help="File to write, the suffix says the format; may be repeated.",
)
@click.option("--storey", "storeys", multiple=True, help="Name of each result's storey, in their order.")
@click.option("--elevation", "elevations", type=float, multiple=True, help="Height of each storey's floor, m.")
@click.option(
    "--place",
    "places",
    type=(float, float, float),
    multiple=True,
    help="X Y DEGREES of each result's map in the building (default: by survey, else as they are).",
)
@building_options
@drawing_options
@mesh_options
@verbosity
def export(
    results: tuple[Path, ...],
    outputs: tuple[Path, ...],
    storeys: tuple[str, ...],
    elevations: tuple[float, ...],
    places: tuple[Place, ...],
    buildings: dict[str, Any],
    drawings: dict[str, Any],
    meshes: dict[str, Any],
    quiet: bool,
) -> None:
    """Writes other formats from the RESULT folder of a build; nothing is computed again.

    Several results, each with its --storey and --elevation, make one building; those of one storey lie on one floor.
    """
    from recon.exporters import building_writer_for, check_outputs, export_building
    from recon.exporters import export as write
    from recon.exporters.options import ExportOptions
    from recon.plan.options import DrawingOptions
    from recon.results import load_model

    options = ExportOptions(**meshes, **buildings, drawing=DrawingOptions(**drawings))
    check_drawings(drawings, outputs)
    check_outputs(list(outputs), options)
    check_storeys(results, storeys, elevations, places)
    if storeys:
        for path in outputs:
            building_writer_for(path)
        building = load_building(outputs[0].stem, results, storeys, elevations, places)
        for note in building.notes:
            warn(note, quiet)
        for path in outputs:
            export_building(building, path, options)
            if not quiet:
                click.echo(path)
        return
    model = load_model(results[0])
    for path in outputs:
        for note in write(model, path, options):
            warn(note, quiet)
        if not quiet:
            click.echo(path)
