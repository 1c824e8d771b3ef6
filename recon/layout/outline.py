"""Walls: the outline of the rooms, each piece traced back to its line."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array
from recon.layout.cells import Cells
from recon.layout.evidence import FreeSpace
from recon.layout.frontier import SIGMA_ANGLE, SIGMA_OFFSET
from recon.layout.line import PlanLine, clip, subtract, total, union
from recon.layout.rooms import PASSAGE, Region
from recon.model import Wall

HIDDEN = 3.0
"""m, a wall goes on between two supported stretches that are no further apart (doors, furniture)."""
CORNER = 1.0
"""m, a wall goes on from its supported stretch to a corner that is no further away."""
THROUGH = 0.7
"""Share of a passage at the end of a wall that rays must have passed."""
SHORTEST_SUPPORT = 0.2
SHORTEST_SPUR = 1.3
"""m, a thin wall with the same room on both sides; shorter ones only join others."""
JOINED = 0.1
SHORTEST_UNSEEN = 0.3
"""m of wall that nobody saw, worth telling."""


@dataclass(frozen=True)
class Side:
    """A straight piece of outline from `start` to `end` (2,) m, free space on the left, on line `line` (-1: none).

    open: nobody saw a wall there, and no other room is behind it.
    """

    line: int
    start: Array
    end: Array
    open: bool


def sides(cells: Cells, region: Region, support: Array, rooms: NDArray[np.bool_]) -> list[list[Side]]:
    """The rings of a region's outline, the outer one first, holes of it after; neighbours lie on different lines.

    support: (E,) m of each edge. rooms: (C,) the cells that belong to any room.
    """
    shared = np.asarray(np.append(rooms, False)[np.stack([cells.left, cells.right])].all(axis=0))
    rings = [(region.polygon.exterior, True), *[(hole, False) for hole in region.polygon.interiors]]
    out = []
    for ring, ccw in rings:
        corner = cells.corners(ring)
        corner = corner if ring.is_ccw == ccw else corner[::-1]
        edge = cells.edges_between(corner, np.roll(corner, -1))
        lines = cells.line[edge]
        first = np.flatnonzero(lines != np.roll(lines, 1))
        corner, edge = np.roll(corner, -first[0]), np.roll(edge, -first[0])
        ends = np.append(first - first[0], len(edge))
        ring_sides = []
        for a, b in pairwise(ends):
            start, end = cells.vertices[corner[[a, b % len(edge)]]]
            open_ = not shared[edge[a:b]].any() and float(support[edge[a:b]].sum()) < SHORTEST_SUPPORT
            ring_sides.append(Side(int(cells.line[edge[a]]), start, end, open_))
        out.append(ring_sides)
    return out


def spurs(cells: Cells, region: Region, parting: NDArray[np.bool_], spans: Array, lines: list[PlanLine]) -> list[Side]:
    """Walls with the region on both sides, each side once; parting: (E,) edges that are walls between inside cells."""
    member = np.zeros(len(cells.polygons), np.bool_)
    member[region.cells] = True
    inner = parting & member[cells.left] & member[cells.right]
    found: list[Side] = []
    for k in np.unique(cells.line[inner]):
        on = np.flatnonzero(inner & (cells.line == k))
        for low, high in union(spans[on], 1e-6):
            seen = clip(union(lines[k].support, SHORTEST_SPUR), low, high)
            if len(seen):
                found.append(Side(int(k), lines[k].point(seen[0, 0]), lines[k].point(seen[-1, 1]), False))
    long = [bool(np.linalg.norm(side.end - side.start) >= SHORTEST_SPUR) for side in found]
    ends = np.array([(s.start, s.end) for s, is_long in zip(found, long, strict=True) if is_long]).reshape(-1, 2)
    kept = [side for side, is_long in zip(found, long, strict=True) if is_long or _touches(side, ends)]
    return [side for one in kept for side in (one, Side(one.line, one.end, one.start, False))]


def _touches(side: Side, ends: Array) -> bool:
    """Whether both ends of a side are at ends (N, 2) of others."""
    return all(bool(np.any(np.linalg.norm(ends - end, axis=1) < JOINED)) for end in (side.start, side.end))


def walls_of(side: Side, lines: list[PlanLine], space: FreeSpace, first_id: int) -> list[Wall]:
    """A side as walls in order: where its line is supported (doors and corners bridged), and inferred ones between.

    At its end a wall goes on over a passage to the corner.
    """
    if side.line < 0:
        return [Wall(first_id, side.start, side.end, SIGMA_OFFSET, SIGMA_ANGLE, "inferred", 0)]
    line = lines[side.line]
    a, b = line.along(np.stack([side.start, side.end]))
    low, high = min(a, b), max(a, b)
    seen = line.front if a < b else line.back
    known = clip(seen, low, high)
    if total(known) < min(SHORTEST_SUPPORT, 0.5 * (high - low)):
        known = clip(line.support, low, high)
    known = known[:0] if total(known) < min(SHORTEST_SUPPORT, 0.5 * (high - low)) else union(known, HIDDEN)
    if len(known):
        known[0, 0] = low if _goes_on(line, low, known[0, 0], space) else known[0, 0]
        known[-1, 1] = high if _goes_on(line, known[-1, 1], high, space) else known[-1, 1]
    breaks = np.unique(np.concatenate([[low, high], known.ravel()]))
    pieces = [(p, q, bool(np.any((known[:, 0] <= p) & (q <= known[:, 1])))) for p, q in pairwise(breaks)]
    if a > b:
        pieces = [(q, p, known_) for p, q, known_ in reversed(pieces)]
    return [_wall(first_id + i, side, line, a, b, *piece) for i, piece in enumerate(pieces)]


def _goes_on(line: PlanLine, low: float, high: float, space: FreeSpace) -> bool:
    """Whether a wall without support from `low` to `high` goes on there: briefly, or with rays through it."""
    if high - low <= CORNER:
        return True
    through = space.is_free(line.point(np.arange(low, high, space.resolution)))
    return high - low <= PASSAGE and float(through.mean()) > THROUGH


def _wall(id_: int, side: Side, line: PlanLine, a: float, b: float, p: float, q: float, known: bool) -> Wall:
    """The piece from position p to q along a line of a side that goes from a to b; its ends are the side's corners."""
    start = side.start if p == a else line.point(p)
    end = side.end if q == b else line.point(q)
    sigma = line.sigma_at((p + q) / 2)
    if known:
        unseen = _unseen(line, p, q)
        return Wall(id_, start, end, sigma, line.sigma_angle, line.source, line.observations, unseen=unseen)
    if line.source == "inferred":
        return Wall(id_, start, end, line.sigma_offset, line.sigma_angle, "inferred", 0)
    return Wall(id_, start, end, max(sigma, SIGMA_OFFSET), max(line.sigma_angle, SIGMA_ANGLE), "inferred", 0)


def _unseen(line: PlanLine, p: float, q: float) -> Array:
    """(K, 2) m from p: the stretches from position p to q along a line that nobody saw, short ones left out."""
    holes = subtract(np.array([[min(p, q), max(p, q)]]), union(line.support, SHORTEST_UNSEEN))
    holes = np.sort(np.abs(holes - p), axis=1)
    return np.asarray(holes[np.argsort(holes[:, 0])])[np.ptp(holes, axis=1) > SHORTEST_UNSEEN]
