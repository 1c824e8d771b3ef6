"""The simpler outline where nobody saw a wall."""

from __future__ import annotations

import numpy as np
import shapely

from recon.geometry import Array, cross2
from recon.layout.evidence import FreeSpace
from recon.layout.outline import Side

CUT = 0.03
"""m^2 of seen free space that taking one corner away may cost."""
ADDED = 0.25
"""m^2 that it may change in all."""
OVERLAP = 1e-3
"""m^2 of another room that it may take."""


def simplified(
    outlines: list[list[list[Side]]], polygons: list[shapely.Polygon], space: FreeSpace
) -> list[list[list[Side]]]:
    """Rings of sides (the outer one first) of every room with fewer corners between open sides; walls stay.

    polygons: the rooms as they are. No room grows into another one, and rings do not cross.
    """
    taken, out = list(polygons), []
    for k, rings in enumerate(outlines):
        simpler = [_simplified(ring, space, [*taken[:k], *taken[k + 1 :]]) for ring in rings]
        polygon = _polygon(simpler)
        if polygon.is_valid:
            taken[k] = polygon
        out.append(simpler if polygon.is_valid else rings)
    return out


def _polygon(rings: list[list[Side]]) -> shapely.Polygon:
    outer, *holes = ([side.start for side in ring] for ring in rings)
    return shapely.Polygon(outer, holes)


def _simplified(ring: list[Side], space: FreeSpace, taken: list[shapely.Polygon]) -> list[Side]:
    """One ring; the corner that changes the least area goes first (Visvalingam and Whyatt 1993)."""
    ring = list(ring)
    while len(ring) > 3:
        candidates = [k for k in range(len(ring)) if ring[k - 1].open and ring[k].open]
        triangles = [(np.stack([ring[k - 1].start, ring[k].start, ring[k].end]), k) for k in candidates]
        triangles.sort(key=lambda item: abs(_area(item[0])))
        k = next((k for triangle, k in triangles if _allowed(triangle, space, taken) and _simple(ring, k)), None)
        if k is None:
            return ring
        ring = _without(ring, k)
    return ring


def _without(ring: list[Side], k: int) -> list[Side]:
    """The ring without the corner where side k starts."""
    joined = Side(-1, ring[k - 1].start, ring[k].end, True)
    if k == 0:
        return [*ring[1:-1], joined]
    return [*ring[: k - 1], joined, *ring[k + 1 :]]


def _area(triangle: Array) -> float:
    """Signed area (3, 2): positive where the corner in the middle is convex, so that its removal takes space away."""
    (a, b, c) = triangle
    return float(cross2(b - a, c - b)) / 2


def _allowed(triangle: Array, space: FreeSpace, taken: list[shapely.Polygon]) -> bool:
    area = _area(triangle)
    if abs(area) > ADDED:
        return False
    if area > 0:
        return area <= CUT or free_area(shapely.Polygon(triangle), space) <= CUT
    return bool(shapely.area(shapely.intersection(shapely.Polygon(triangle), taken)).sum() <= OVERLAP)


def free_area(polygon: shapely.Polygon, space: FreeSpace) -> float:
    """Seen free space in a polygon, m^2."""
    (bottom, top), (left, right) = space.index(np.array(polygon.bounds).reshape(2, 2))
    row, column = np.nonzero(space.free[bottom : top + 1, left : right + 1])
    x, y = (space.origin + space.resolution * (np.stack([column + left, row + bottom], axis=1) + 0.5)).T
    return float(shapely.contains_xy(polygon, x, y).sum() * space.cell_area)


def _simple(ring: list[Side], k: int) -> bool:
    return bool(shapely.Polygon([side.start for side in _without(ring, k)]).is_valid)
