"""Corners that several faces share, so that no corner of one lies amid an edge of another (T-junction)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from recon.geometry import Array
from recon.polygons import polygons

if TYPE_CHECKING:
    from shapely.geometry import Polygon

TOLERANCE = 3e-6
"""m: points this near are one; coordinates of layouts have six decimals."""


class Corners:
    """Points (2,) of the ground, m, found again by place."""

    def __init__(self, points: list[Array]) -> None:
        import shapely

        rounded = np.concatenate([np.zeros((0, 2)), *points]).round(6) + 0.0
        self._points = np.unique(rounded, axis=0)
        self._tree = shapely.STRtree(shapely.points(self._points))

    def on(self, start: Array, end: Array) -> Array:
        """The points (n, 2) on the segment from `start` to `end` (2,)."""
        import shapely

        return self._near(shapely.LineString([start, end]))

    def around(self, polygon: Polygon) -> Array:
        """The points (n, 2) on the boundary of a polygon."""
        return self._near(polygon.boundary)

    def snapped(self, points: Array) -> Array:
        """Points (n, 2), each moved to the one of these that is as good as there; the others rounded."""
        import shapely

        out = points.round(6) + 0.0
        mine, nearest = self._tree.query_nearest(shapely.points(points), max_distance=TOLERANCE, all_matches=False)
        out[mine] = self._points[nearest]
        return np.asarray(out)

    def _near(self, line: Any) -> Array:
        found = np.sort(self._tree.query(line, predicate="dwithin", distance=TOLERANCE))
        return np.asarray(self._points[found])


def with_points(polygon: Any, points: Array) -> Any:
    """A polygon (or several) whose edges are broken at those of `points` (n, 2) that lie on them."""
    import shapely

    if polygon.geom_type != "Polygon":
        return shapely.MultiPolygon([with_points(part, points) for part in polygons(polygon)])
    rings = [np.asarray(ring.coords)[:-1] for ring in (polygon.exterior, *polygon.interiors)]
    broken = [_broken(ring, points) for ring in rings if len(ring) >= 3]
    return shapely.Polygon(broken[0], broken[1:]) if broken else polygon


def _broken(ring: Array, points: Array) -> Array:
    """A ring (m, 2), not closed, with the points in its edges."""
    out = []
    for start, end in zip(ring, np.roll(ring, -1, axis=0), strict=True):
        out.append(start[None])
        length = float(np.linalg.norm(end - start))
        if length == 0.0 or len(points) == 0:
            continue
        direction = (end - start) / length
        offset = points - start
        along, across = offset @ direction, offset @ np.array([-direction[1], direction[0]])
        between = (along > TOLERANCE) & (along < length - TOLERANCE) & (np.abs(across) < TOLERANCE)
        order = np.argsort(along[between], kind="stable")
        out.append(points[between][order])
    return np.concatenate(out)
