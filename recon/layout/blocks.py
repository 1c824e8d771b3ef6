"""Furniture along walls and in corners: two of its faces meet in a corner that stands out into the room."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from recon.geometry import Array, cross2
from recon.layout.evidence import FreeSpace
from recon.layout.line import PlanLine, subtract, union

DEPTH = 1.0
"""m, the shorter side of wardrobes, sofas and desks, with the slit behind them ..."""
LENGTH = 2.4
"""... and the longer."""
SMALLEST = 0.25
"""m; what is smaller makes no line."""
PARTITION = 0.4
"""m; what goes further into the room than it is wide, and is no wider than this, is a wall."""
MEETING = 0.2
"""m between the ends of two faces of one thing."""
SLIT = 0.5
"""m, at most, between the end of a face and the wall that it goes to."""
OVERSHOOT = 0.1
"""m that a face may reach past that wall."""
SHADOW = 0.7
"""m of wall, from the thing on, within which some of it was seen."""
SEEN = 0.1
"""m of it."""
FACING = 0.3
"""Cosine between a face and the way to the wall at its end, at least."""
FREE = 0.3
"""Share of the filled corner that rays passed, at most."""


@dataclass(frozen=True)
class _Faces:
    """F stretches of wall, each seen from one side: line (F,), front (F,), span (F, 2) m along the line.

    origin, along, normal: (F, 2) of their lines; the normal points to where the stretch was seen from.
    """

    line: NDArray[np.int64]
    front: NDArray[np.bool_]
    span: Array
    origin: Array
    along: Array
    normal: Array

    @staticmethod
    def of(lines: list[PlanLine]) -> _Faces:
        rows = [
            (k, front, low, high)
            for k, line in enumerate(lines)
            for front in (True, False)
            for low, high in union(line.front if front else line.back, MEETING)
        ]
        table = np.array(rows, dtype=np.float64).reshape(-1, 4)
        line, front, span = table[:, 0].astype(np.int64), table[:, 1] > 0, table[:, 2:]
        origin = np.array([one.origin for one in lines]).reshape(-1, 2)[line]
        along = np.array([one.direction for one in lines]).reshape(-1, 2)[line]
        left = np.stack([-along[:, 1], along[:, 0]], axis=1)
        return _Faces(line, front, span, origin, along, np.where(front[:, None], left, -left))

    def end(self, face: int, k: int) -> Array:
        """End k (0 or 1) of a face, (2,) m."""
        return np.asarray(self.origin[face] + self.span[face, k] * self.along[face])

    def length(self, face: int) -> float:
        """m."""
        return float(self.span[face, 1] - self.span[face, 0])

    def met(self, start: Array, way: Array, reach: tuple[float, float], side: Array) -> tuple[float, int] | None:
        """How far from `start` along the unit vector `way` the first wall is that faces against it, and which.

        reach: m, least and greatest; of the wall some must have been seen next to that place, towards `side`.
        """
        cosine = self.normal @ way
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = np.einsum("fi,fi->f", self.origin - start, self.normal) / cosine
            place = np.einsum("fi,fi->f", start + distance[:, None] * way - self.origin, self.along)
        ahead = (self.along @ side) > 0
        low, high = np.where(ahead, place, place - SHADOW), np.where(ahead, place + SHADOW, place)
        seen = np.minimum(high, self.span[:, 1]) - np.maximum(low, self.span[:, 0])
        ok = (cosine < -FACING) & (distance >= reach[0]) & (distance <= reach[1]) & (seen > SEEN)
        if not ok.any():
            return None
        first = int(np.argmin(np.where(ok, distance, np.inf)))
        return float(distance[first]), first


def without_blocks(lines: list[PlanLine], space: FreeSpace) -> list[PlanLine]:
    """Lines without the faces of furniture that stands in corners or before walls.

    Two faces that meet in a corner which stands out into the room, no longer than furniture is, each of them ending
    at a wall that was seen beside it, hide nothing but the corner of these two walls. Where nobody saw into it, what
    fills it is taken for furniture. The same holds for a face before a wall that was seen on both sides of it.
    """
    faces = _Faces.of(lines)
    lines = list(lines)
    for pair in _outward_corners(faces):
        hidden = _hidden_walls(faces, *pair, space)
        for face, ends in hidden:
            wall = lines[int(faces.line[face])]
            part = np.sort(wall.along(ends))[None]
            lines[int(faces.line[face])] = replace(wall, hidden=union(np.concatenate([wall.hidden, part])))
        for face, _ in pair if hidden else ():
            k, gone = int(faces.line[face]), faces.span[face][None]
            front, back = lines[k].front, lines[k].back
            if faces.front[face]:
                front = subtract(front, gone)
            else:
                back = subtract(back, gone)
            lines[k] = replace(lines[k], front=front, back=back)
    return [line for line in lines if len(line.front) or len(line.back)]


def _outward_corners(faces: _Faces) -> Iterator[tuple[tuple[int, int], tuple[int, int]]]:
    """Pairs of faces of furniture's size, each with the end (0 or 1) at which they meet with the solid inside."""
    ends = np.stack([faces.origin + faces.span[:, k, None] * faces.along for k in range(2)], axis=1).reshape(-1, 2)
    if len(ends) == 0:
        return
    length = faces.span[:, 1] - faces.span[:, 0]
    small = (length >= SMALLEST) & (length <= LENGTH)
    for i, j in sorted(cKDTree(ends).query_pairs(MEETING)):
        a, b = (i // 2, i % 2), (j // 2, j % 2)
        if small[a[0]] and small[b[0]] and min(length[a[0]], length[b[0]]) <= DEPTH:
            one, other = _away(faces, *a), _away(faces, *b)
            if faces.normal[a[0]] @ other < -FACING and faces.normal[b[0]] @ one < -FACING:
                yield a, b


def _away(faces: _Faces, face: int, end: int) -> Array:
    """Unit vector (2,) along a face away from its end."""
    return np.asarray(faces.along[face] * (1.0 if end == 0 else -1.0))


def _hidden_walls(faces: _Faces, a: tuple[int, int], b: tuple[int, int], space: FreeSpace) -> list[tuple[int, Array]]:
    """What two faces, which meet at the given ends, hide if they are furniture's: faces of walls, from where to where.

    The ends (2, 2) m are on the walls' lines. Empty where the two faces are no furniture's.
    """
    return _behind(faces, a, b) or _behind(faces, b, a) or _in_corner(faces, a, b, space)


def _behind(faces: _Faces, front: tuple[int, int], side: tuple[int, int]) -> list[tuple[int, Array]]:
    """The wall behind a face with another at its end, where it was seen on both sides of them."""
    way, back = _away(faces, *front), _away(faces, *side)
    depth, near = faces.length(side[0]), (front[0], 1 - front[1])
    if depth > DEPTH or faces.length(front[0]) < min(depth, PARTITION):
        return []  # the end of a partition beside a passage
    reach = (depth - OVERSHOOT, min(depth + SLIT, DEPTH))
    first = faces.met(faces.end(*front), back, reach, -way)
    last = faces.met(faces.end(*near), back, reach, way)
    if first is None or last is None:
        return []
    ends = np.stack([faces.end(*front) + first[0] * back, faces.end(*near) + last[0] * back])
    return [(face, ends) for face in dict.fromkeys((first[1], last[1]))]


def _in_corner(faces: _Faces, a: tuple[int, int], b: tuple[int, int], space: FreeSpace) -> list[tuple[int, Array]]:
    """The two walls of a corner of furniture's size that two faces hide."""
    ways = _away(faces, *a), _away(faces, *b)
    corner = (faces.end(*a) + faces.end(*b)) / 2
    walls, sizes = [], []
    for (face, _), way, side in ((a, ways[0], -ways[1]), (b, ways[1], -ways[0])):
        length = faces.length(face)
        found = faces.met(corner, way, (length - OVERSHOOT, length + SLIT), side)
        if found is None:
            return []
        sizes.append(found[0])
        walls.append(found[1])
    hidden = _crossing(faces, *walls)
    if min(sizes) > DEPTH or max(sizes) > LENGTH or hidden is None or np.linalg.norm(hidden - corner) > DEPTH + LENGTH:
        return []
    feet = [corner + size * way for size, way in zip(sizes, ways, strict=True)]
    quad = shapely.Polygon([corner, feet[0], hidden, feet[1]])
    if not quad.is_valid or _free_share(quad, space) > FREE:
        return []
    return [(wall, np.stack([foot, hidden])) for wall, foot in zip(walls, feet, strict=True)]


def _crossing(faces: _Faces, one: int, other: int) -> Array | None:
    """Where the lines of two faces cross, (2,) m; None where they hardly do."""
    sine = float(cross2(faces.along[one], faces.along[other]))
    if abs(sine) < FACING:
        return None
    offset = faces.origin[other] - faces.origin[one]
    return np.asarray(faces.origin[one] + float(cross2(offset, faces.along[other])) / sine * faces.along[one])


def _free_share(quad: shapely.Polygon, space: FreeSpace) -> float:
    x0, y0, x1, y1 = quad.bounds
    x, y = (np.arange(a, b, space.resolution) for a, b in ((x0, x1), (y0, y1)))
    points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    inner = points[shapely.contains_xy(quad, points[:, 0], points[:, 1])]
    return float(space.is_free(inner).mean()) if len(inner) else 0.0
