"""Simple polygons of rooms, side by side without overlap."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import shapely

from recon.geometry import Array

Side = tuple[float, float, float, float]
"""x and y, m, of its start and of its end."""

SMALLEST_HOLE = 2.0
"""m^2; smaller holes in a room are pillars and things in it, larger ones split it into simple polygons."""
SMALLEST_PIECE = 1.0
"""m^2"""
SAME = 1e-6
"""m, rings closer than this touch."""
TOUCHING = 0.0015
"""m, corners that cells share are this close to the sides that they lie on (`cells.SNAP`)."""


def room_rings(outlines: Sequence[shapely.Polygon]) -> list[Array]:
    """Disjoint outlines, which may have holes, as simple counter-clockwise rings (n, 2).

    Where two of them touch both have the same corners, so that no rounding makes them overlap.
    """
    others = [[*outlines[:k], *outlines[k + 1 :]] for k in range(len(outlines))]
    parts = [part for one, rest in zip(outlines, others, strict=True) for part in simple_polygons(one, rest)]
    rings = [np.asarray(part.exterior.coords)[:-1] for part in shapely.orient_polygons(parts)]
    corners = np.unique(np.concatenate(rings), axis=0) if rings else np.zeros((0, 2))
    tree = shapely.STRtree(shapely.points(corners))
    near = [corners[tree.query(shapely.LinearRing(ring), "dwithin", TOUCHING)] for ring in rings]
    rings = [_with_corners(ring, found, SAME, frozenset()) for ring, found in zip(rings, near, strict=True)]
    shared = frozenset(_side(end, start) for ring in rings for start, end in _sides(ring))
    return [_with_corners(ring, found, TOUCHING, shared) for ring, found in zip(rings, near, strict=True)]


def _sides(ring: Array) -> Iterator[tuple[Array, Array]]:
    """Start and end of every side of a ring (n, 2)."""
    return zip(ring, np.roll(ring, -1, axis=0), strict=True)


def _side(start: Array, end: Array) -> Side:
    return float(start[0]), float(start[1]), float(end[0]), float(end[1])


def _with_corners(ring: Array, corners: Array, reach: float, shared: frozenset[Side]) -> Array:
    """The ring (n, 2) with those corners (m, 2) that lie within `reach`, m, of its sides.

    Sides in `shared` stay as they are: on their other side is a ring that has them too, to the last digit.
    """
    away = np.linalg.norm(corners[:, None] - ring[None], axis=2).min(axis=1, initial=np.inf) > TOUCHING
    out: list[Array] = []
    for start, end in _sides(ring):
        step = end - start
        along = (corners - start) @ step / (step @ step)
        off = np.linalg.norm(corners - start - along[:, None] * step, axis=1)
        on = np.flatnonzero(away & (along > 0) & (along < 1) & (off <= reach) & (_side(start, end) not in shared))
        out += [start, *corners[on[np.argsort(along[on], kind="stable")]]]
    return np.array(out)


def simple_polygons(polygon: shapely.Polygon, taken: Sequence[shapely.Polygon] = ()) -> list[shapely.Polygon]:
    """A polygon as disjoint ones without holes: cut across to its outline, at short places, where it has holes.

    Small holes are filled, but for those with something `taken` in them. All cuts go along one direction, two from
    every hole, opposite ways, to the outline or to the next hole. As every ring so has ways out of its own at either
    end, each cut lies between two different pieces, and no piece is left with a hole or a slit.
    """
    holes = [hole for hole in polygon.interiors if _stays(shapely.Polygon(hole), taken)]
    polygon = shapely.Polygon(polygon.exterior, holes)
    if not holes:
        return [polygon]
    rings = [np.asarray(ring.coords)[:-1] for ring in (polygon.exterior, *holes)]
    steps = np.concatenate([np.roll(ring, -1, axis=0) - ring for ring in rings[1:]])
    steps /= np.linalg.norm(steps, axis=1)[:, None]
    steps = np.concatenate([steps, np.stack([-steps[:, 1], steps[:, 0]], axis=1)])
    angle = np.round(np.arctan2(steps[:, 1], steps[:, 0]) % np.pi, 3)
    options = [_cuts(polygon, rings, steps[k]) for k in np.unique(angle, return_index=True)[1]]
    cuts = min(options, key=lambda cuts: round(sum(float(cut.length) for cut in cuts), 3))
    parts = shapely.polygonize([shapely.union_all([polygon.boundary, *cuts])]).geoms
    return _merged([part for part in parts if polygon.contains(part.representative_point())])


def _merged(parts: list[shapely.Polygon]) -> list[shapely.Polygon]:
    """Pieces, those too small for a room joined to the neighbour with the longest side in common."""
    parts = sorted(parts, key=lambda part: -part.area)
    while len(parts) > 1 and parts[-1].area < SMALLEST_PIECE:
        small = parts.pop()
        shared = [small.intersection(part).length for part in parts]
        order = sorted(range(len(parts)), key=lambda k: -shared[k])
        whole = [(k, small.union(parts[k])) for k in order if shared[k] > SAME]
        joined = [(k, one) for k, one in whole if one.geom_type == "Polygon" and not one.interiors]
        if not joined:
            return [*parts, small]
        parts[joined[0][0]] = joined[0][1]
        parts.sort(key=lambda part: -part.area)
    return parts


def _stays(hole: shapely.Polygon, taken: Sequence[shapely.Polygon]) -> bool:
    return hole.area >= SMALLEST_HOLE or any(hole.contains(one.representative_point()) for one in taken)


def _cuts(polygon: shapely.Polygon, rings: list[Array], direction: Array) -> list[shapely.LineString]:
    """Two cuts from every hole, along `direction` and against it: each the shortest from one of its corners to a ring
    that reaches further that way (so that no ring is led back to), the outline being the first of `rings`."""
    boundaries = np.array([shapely.LinearRing(ring) for ring in rings])
    cuts: list[shapely.LineString] = []
    for k, ring in enumerate(rings[1:], start=1):
        start = -1
        for way in (direction, -direction):
            reach = np.array([(other @ way).max() for other in rings])
            goals = boundaries[(reach > reach[k]) | (np.arange(len(rings)) == 0)]
            found = [_cut(polygon, corner, way, float(reach[0]) + 1.0, goals) for corner in ring]
            known = [(cut, n) for n, cut in enumerate(found) if cut is not None and n != start]
            if known:  # none where the hole touches another ring at its furthest corner
                cut, start = min(known, key=lambda item: round(float(item[0].length), 6))
                cuts.append(cut)
    return cuts


def _cut(
    polygon: shapely.Polygon, corner: Array, way: Array, far: float, goals: Sequence[shapely.LinearRing]
) -> shapely.LineString | None:
    """From a corner straight on inside the polygon; None where that ends on none of `goals`. far: m along `way`."""
    ray = shapely.LineString([corner + SAME * way, corner + max(far - float(corner @ way), 1.0) * way])
    inner = [part for part in shapely.get_parts(ray.intersection(polygon)) if part.geom_type == "LineString"]
    first = [part for part in inner if part.distance(shapely.Point(corner)) <= 2 * SAME]
    if not first:
        return None
    end = max(np.asarray(first[0].coords), key=lambda point: float(point @ way))
    if shapely.distance(goals, shapely.Point(end)).min() > SAME:
        return None
    return shapely.LineString([corner, end + SAME * way])
