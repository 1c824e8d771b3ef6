"""What a user may choose about a format, beyond its suffix."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

IfcSchema = Literal["IFC4", "IFC2X3"]
MapFrame = Literal["map", "building"]


@dataclass(frozen=True)
class ExportOptions:
    """Every writer in `WITH_OPTIONS` reads what is its own.

    map_resolution: m a cell of `.yaml` maps. map_frame: "map", the coordinates of everything else, or "building", with
    walls along rows and columns.
    """

    ifc_schema: IfcSchema = "IFC4"
    map_resolution: float = 0.05
    map_frame: MapFrame = "map"


DEFAULTS = ExportOptions()
