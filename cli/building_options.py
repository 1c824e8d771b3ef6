"""Options of IFC files and robots' maps, for every command that writes them."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import click

NAMES = ("ifc_schema", "map_resolution", "map_frame")
"""Fields of `ExportOptions`."""


def building_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Adds the options and gives the command those that were used, by field of `ExportOptions`, as `buildings`."""

    @functools.wraps(command)
    def collected(*args: Any, **kwargs: Any) -> Any:
        given = {name: kwargs.pop(name) for name in NAMES}
        return command(*args, buildings={k: v for k, v in given.items() if v is not None}, **kwargs)

    wrapped: Any = collected
    for option in reversed(_OPTIONS):
        wrapped = option(wrapped)
    return wrapped


_OPTIONS = (
    click.option("--ifc-schema", type=click.Choice(["IFC4", "IFC2X3"]), help="Of IFC files (default IFC4)."),
    click.option("--map-resolution", type=click.FloatRange(0.005, 1.0), help="Metres a cell of maps (default 0.05)."),
    click.option(
        "--map-frame", type=click.Choice(["map", "building"]), help="Of maps: as driven, or walls along rows."
    ),
)
