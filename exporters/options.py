"""What a user may choose about a format, beyond its suffix."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from recon.errors import OutputError
from recon.plan.options import DrawingOptions

IfcSchema = Literal["IFC4", "IFC2X3"]
MapFrame = Literal["map", "building"]
TextureFormat = Literal["jpg", "png", "webp"]
Engine = Literal["godot", "unreal", "unity"]
UsdProfile = Literal["arkit", "simready"]
StlUnits = Literal["m", "mm"]

WEBP_FORMATS = (".glb", ".gltf")
PICTURE_FORMATS = (".usd", ".usda", ".usdc", ".usdz", ".glb", ".gltf", ".obj", ".sdf", ".urdf")
"""Formats with pictures in or beside them."""


@dataclass(frozen=True)
class ExportOptions:
    """Every writer in `WITH_OPTIONS` reads what is its own.

    map_resolution: m a cell of `.yaml` maps. map_frame: "map", the coordinates of everything else, or "building", with
    walls along rows and columns.
    texture_size: most texels a side, texture_format: of pictures in or beside a mesh format. max_triangles: most
    triangles where a format has a choice (PLY). lod: coarser copies of the file, each with pictures of half the size.
    engine: whose names for collision shapes and light-map coordinates glTF has, None for no engine in particular.
    ceiling: whether ceilings are there. outside: whether backs and tops of all walls, roof and underside
    are, too.
    usd_profile: "arkit" (Y up, for phones) or "simready" (with collision and labels, for simulators). stl_units: of
    STL, which cannot say them. drawing: scale, paper, units and layers of plans (DXF, SVG, PDF, PNG).
    """

    ifc_schema: IfcSchema = "IFC4"
    map_resolution: float = 0.05
    map_frame: MapFrame = "map"
    texture_size: int | None = None
    texture_format: TextureFormat = "jpg"
    max_triangles: int | None = None
    lod: int = 0
    ceiling: bool = True
    outside: bool = False
    engine: Engine | None = None
    usd_profile: UsdProfile | None = None
    stl_units: StlUnits = "m"
    drawing: DrawingOptions = field(default_factory=DrawingOptions)


DEFAULTS = ExportOptions()


def check_options(paths: Sequence[Path], options: ExportOptions) -> None:
    """Raise OutputError where an output cannot have what the options ask for."""
    for path in paths:
        suffix = path.suffix.lower()
        if options.texture_format == "webp" and suffix in PICTURE_FORMATS and suffix not in WEBP_FORMATS:
            raise OutputError(
                f"{path}: takes no WebP pictures, expected jpg or png, or one of {' '.join(WEBP_FORMATS)}"
            )
        if options.usd_profile == "arkit" and suffix in (".usd", ".usda", ".usdc"):
            raise OutputError(f"{path}: the profile arkit is a package, expected a name that ends in .usdz")
