"""Options of IFC files and robots' maps, for every command that writes them."""

from __future__ import annotations

from typing import Any

import click

from recon.cli.options import gathered

OPTIONS: dict[str, Any] = {
    "ifc_schema": click.option(
        "--ifc-schema", type=click.Choice(["IFC4", "IFC2X3"]), help="Of IFC files (default IFC4)."
    ),
    "map_resolution": click.option(
        "--map-resolution", type=click.FloatRange(0.005, 1.0), help="Metres a cell of maps (default 0.05)."
    ),
    "map_frame": click.option(
        "--map-frame", type=click.Choice(["map", "building"]), help="Of maps: as driven, or walls along rows."
    ),
}
"""By field of `ExportOptions`."""

building_options = gathered("buildings", OPTIONS)
"""Gives the command those that were used as `buildings`."""
