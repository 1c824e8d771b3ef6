"""What overlays of polygons leave: those parts that have an area."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from shapely.geometry import Polygon
    from shapely.geometry.base import BaseGeometry


def polygons(shape: BaseGeometry, least: float = 0.0) -> list[Polygon]:
    """The polygons of a shape, whatever it is, with an area of more than `least` m^2; no lines, no points."""
    if shape.geom_type == "Polygon":
        return [shape] if shape.area > least else []
    return [polygon for part in getattr(shape, "geoms", ()) for polygon in polygons(part, least)]


def areas(shape: BaseGeometry) -> BaseGeometry:
    """A shape without its lines and points, as one polygon or several."""
    import shapely

    return shape if shape.geom_type in ("Polygon", "MultiPolygon") else shapely.union_all(polygons(shape))
