"""Options of the mesh formats, for every command that writes them."""

from __future__ import annotations

from typing import Any

import click

from recon.cli.options import gathered

OPTIONS: dict[str, Any] = {
    "texture_size": click.option(
        "--texture-size", type=click.IntRange(16, 16384), help="Most texels a side of a picture."
    ),
    "texture_format": click.option(
        "--texture-format", type=click.Choice(["jpg", "png", "webp"]), help="Of pictures (default jpg)."
    ),
    "max_triangles": click.option(
        "--max-triangles", type=click.IntRange(1), help="Most triangles; only PLY has a choice."
    ),
    "lod": click.option(
        "--lod", type=click.IntRange(0, 8), help="Levels of detail: model.lod1.glb ... have smaller pictures."
    ),
    "ceiling": click.option(
        "--no-ceiling", "ceiling", is_flag=True, flag_value=False, default=None, help="Open above."
    ),
    "outside": click.option(
        "--outside", is_flag=True, default=None, help="Backs of walls, roof and underside as well, in a plain colour."
    ),
    "engine": click.option(
        "--engine", type=click.Choice(["godot", "unreal", "unity"]), help="Whose collision names glTF has."
    ),
    "usd_profile": click.option(
        "--usd-profile", type=click.Choice(["arkit", "simready"]), help="USD for phones or for simulators."
    ),
    "stl_units": click.option("--stl-units", type=click.Choice(["m", "mm"]), help="Units of STL (default m)."),
}
"""By field of `ExportOptions`."""

mesh_options = gathered("meshes", OPTIONS)
"""Gives the command those that were used as `meshes`."""
