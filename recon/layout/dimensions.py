"""Distances between facing walls and corners of rooms, with standard deviations from the walls' joint covariance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
import shapely

from recon.facing import facing_rooms
from recon.geometry import Array, cross2
from recon.graph.estimate import MapEstimate
from recon.layout.line import PlanLine
from recon.layout.spans import across_rooms
from recon.layout.uncertainty import follows, joint_covariances
from recon.model import Dimension, Layout, Room, Wall

PARALLEL = float(np.sin(np.radians(3.0)))
"""Facing walls may be turned this far against each other."""
OVERLAP = 0.3
"""m that two walls face each other, at least."""
INSIDE = 0.01
"""m; the room lies this far before its walls for certain."""
FLATTEST = float(np.sin(np.radians(10.0)))
"""Walls that meet more flatly have no corner worth an ellipse."""


@dataclass(frozen=True)
class _Pair:
    """Two facing walls of a room and the points (2,) m between which they are measured, `overlap` m side by side."""

    room: int
    walls: tuple[Wall, Wall]
    start: Array
    end: Array
    overlap: float


def with_dimensions(layout: Layout, owner: Sequence[int], lines: Sequence[PlanLine], estimate: MapEstimate) -> Layout:
    """The layout with the dimensions of its rooms and across them, and the covariances of corners.

    owner: the line of each wall, -1 for none. Walls that nobody saw are not measured to.
    """
    line_of = {wall.id: lines[k] for wall, k in zip(layout.walls, owner, strict=True) if k >= 0}
    known = [wall for wall in layout.walls if wall.source != "inferred" and wall.id in line_of]
    faced = dict(zip((wall.id for wall in layout.walls), facing_rooms(layout, INSIDE).tolist(), strict=True))
    before = [[wall for wall in known if faced[wall.id] == k] for k in range(len(layout.rooms))]
    pairs = [pair for room, walls in zip(layout.rooms, before, strict=True) for pair in _facing(room, walls, line_of)]
    first, second = ([line_of[pair.walls[k].id] for pair in pairs] for k in range(2))
    blocks = joint_covariances(first, second, estimate)
    dimensions = tuple(
        Dimension(pair.room, (pair.walls[0].id, pair.walls[1].id), pair.start, pair.end, _sigma(pair, line_of, block))
        for pair, block in zip(pairs, blocks, strict=True)
    )
    layout = replace(layout, dimensions=dimensions, rooms=_with_corners(layout, known, line_of, estimate))
    seen = {wall.id: line_of[wall.id] for wall in known}
    return replace(layout, spans=across_rooms(layout, seen, estimate))


def _facing(room: Room, walls: list[Wall], line_of: dict[int, PlanLine]) -> list[_Pair]:
    """Pairs of walls with nothing but the room between them; of the pieces of two lines the longest side by side."""
    inner = shapely.Polygon(room.polygon).buffer(-INSIDE / 2)
    shapely.prepare(inner)
    best: dict[tuple[int, int], _Pair] = {}
    for a, b in combinations(walls, 2):
        if a.normal @ b.normal > 0 or abs(float(cross2(a.direction, b.direction))) > PARALLEL:
            continue
        low, high = np.sort([(end - a.start) @ a.direction for end in (b.start, b.end)])
        low, high = max(float(low), 0.0), min(float(high), a.length)
        if high - low < OVERLAP:
            continue
        start = a.start + (low + high) / 2 * a.direction
        distance = float((b.start - start) @ b.normal / (a.normal @ b.normal))
        end = start + distance * a.normal
        way = shapely.LineString([start + INSIDE * a.normal, end - INSIDE * a.normal])
        if distance > 2 * INSIDE and inner.covers(way):
            pair = _Pair(room.id, (a, b), start, end, high - low)
            key = id(line_of[a.id]), id(line_of[b.id])
            if key not in best or best[key].overlap < pair.overlap:
                best[key] = pair
    return list(best.values())


def _sigma(pair: _Pair, line_of: dict[int, PlanLine], joint: Array) -> float:
    normal = pair.walls[0].normal
    near, far = (line_of[wall.id] for wall in pair.walls)
    change = np.concatenate([-follows(near, pair.start, normal), follows(far, pair.end, normal)])
    return float(np.sqrt(max(change @ joint @ change, 0.0)))


def _with_corners(
    layout: Layout, known: list[Wall], line_of: dict[int, PlanLine], estimate: MapEstimate
) -> tuple[Room, ...]:
    """Rooms with the covariances of their corners, nan where one of the two walls was not seen."""
    ending, starting = ({_key(getattr(w, end)): line_of[w.id] for w in known} for end in ("end", "start"))
    corners = [(room, n, _key(point)) for room in layout.rooms for n, point in enumerate(room.polygon)]
    places = [(room, n, ending.get(key), starting.get(key)) for room, n, key in corners]
    met = [(room, n, a, b) for room, n, a, b in places if a is not None and b is not None]
    met = [(room, n, a, b) for room, n, a, b in met if abs(cross2(a.direction, b.direction)) > FLATTEST]
    joint = joint_covariances([a for _, _, a, _ in met], [b for _, _, _, b in met], estimate)
    out = {room.id: np.full((len(room.polygon), 2, 2), np.nan) for room in layout.rooms}
    for (room, n, a, b), block in zip(met, joint, strict=True):
        point = room.polygon[n]
        change = np.zeros((2, 4))
        change[0, :2], change[1, 2:] = follows(a, point, a.normal), follows(b, point, b.normal)
        solve = np.linalg.solve(np.stack([a.normal, b.normal]), change)
        out[room.id][n] = solve @ block @ solve.T
    return tuple(replace(room, corner_covariances=out[room.id]) for room in layout.rooms)


def _key(point: Array) -> tuple[float, float]:
    return round(float(point[0]), 6), round(float(point[1]), 6)
