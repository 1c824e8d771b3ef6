"""Options of the mesh formats, for every command that writes them."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import click

NAMES = ("texture_size", "texture_format", "max_triangles", "lod", "engine", "usd_profile", "stl_units")
"""Fields of `ExportOptions`."""


def mesh_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Adds the options and gives the command those that were used, by field of `ExportOptions`, as `meshes`."""

    @functools.wraps(command)
    def collected(*args: Any, **kwargs: Any) -> Any:
        given = {name: kwargs.pop(name) for name in NAMES}
        return command(*args, meshes={k: v for k, v in given.items() if v is not None}, **kwargs)

    wrapped: Any = collected
    for option in reversed(_OPTIONS):
        wrapped = option(wrapped)
    return wrapped


_OPTIONS = (
    click.option("--texture-size", type=click.IntRange(16, 16384), help="Most texels a side of a picture."),
    click.option("--texture-format", type=click.Choice(["jpg", "png", "webp"]), help="Of pictures (default jpg)."),
    click.option("--max-triangles", type=click.IntRange(1), help="Most triangles of a PLY."),
    click.option(
        "--lod", type=click.IntRange(0, 8), help="Levels of detail: model.lod1.glb ... have smaller pictures."
    ),
    click.option("--engine", type=click.Choice(["godot", "unreal", "unity"]), help="Whose collision names glTF has."),
    click.option("--usd-profile", type=click.Choice(["arkit", "simready"]), help="USD for phones or for simulators."),
    click.option("--stl-units", type=click.Choice(["m", "mm"]), help="Units of STL (default m)."),
)
