"""Walls: the outline of the rooms, each piece traced back to its line."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from recon.geometry import Array
from recon.layout.cells import Cells
from recon.layout.frontier import SIGMA_ANGLE, SIGMA_OFFSET
from recon.layout.line import PlanLine, clip, total, union
from recon.layout.rooms import Region
from recon.model import Wall

HIDDEN = 3.0
"""m, a wall goes on between two supported stretches that are no further apart (doors, furniture)."""
CORNER = 1.0
"""m, a wall goes on from its supported stretch to a corner that is no further away."""
SHORTEST_SUPPORT = 0.2
SHORTEST_SPUR = 1.0
"""m, a thin wall with the same room on both sides."""


@dataclass(frozen=True)
class Side:
    """A straight piece of outline from `start` to `end` (2,) m, free space on the left, on line `line` (-1: none)."""

    line: int
    start: Array
    end: Array


def sides(cells: Cells, region: Region) -> list[list[Side]]:
    """The rings of a region's outline, the outer one first, holes of it after; neighbours lie on different lines."""
    tree = cKDTree(cells.vertices)
    line_of = {}
    for (a, b), line in zip(cells.edges, cells.line, strict=True):
        line_of[int(a), int(b)] = line_of[int(b), int(a)] = int(line)
    rings = [(region.polygon.exterior, True), *[(hole, False) for hole in region.polygon.interiors]]
    out = []
    for ring, ccw in rings:
        corner = np.asarray(tree.query(np.asarray(ring.coords)[:-1])[1])
        corner = corner if ring.is_ccw == ccw else corner[::-1]
        following = np.roll(corner, -1)
        lines = np.array([line_of[int(a), int(b)] for a, b in zip(corner, following, strict=True)])
        out.append(_grouped(cells.vertices, corner, lines))
    return out


def _grouped(vertices: Array, corner: NDArray[np.int64], lines: NDArray[np.int64]) -> list[Side]:
    """Sides of a ring from its corners (n,) and the line (n,) that each corner's following edge is on."""
    first = np.flatnonzero(lines != np.roll(lines, 1))
    return [
        Side(int(lines[a]), vertices[corner[a]], vertices[corner[b]])
        for a, b in zip(first, np.roll(first, -1), strict=True)
    ]


def spurs(cells: Cells, region: Region, parting: NDArray[np.bool_], spans: Array) -> list[Side]:
    """Walls with the region on both sides, each side once; parting: (E,) edges that are walls between inside cells."""
    member = np.zeros(len(cells.polygons), np.bool_)
    member[region.cells] = True
    inner = parting & member[cells.left] & member[cells.right]
    out = []
    for k in np.unique(cells.line[inner]):
        on = np.flatnonzero(inner & (cells.line == k))
        for low, high in union(spans[on], 1e-6):
            ends = on[[np.argmin(np.abs(spans[on, 0] - low)), np.argmin(np.abs(spans[on, 1] - high))]]
            if high - low >= SHORTEST_SPUR:
                start, end = cells.vertices[cells.edges[ends[0], 0]], cells.vertices[cells.edges[ends[1], 1]]
                out += [Side(int(k), start, end), Side(int(k), end, start)]
    return out


def walls_of(side: Side, lines: list[PlanLine], first_id: int) -> list[Wall]:
    """A side as walls in order: where its line is supported (doors and corners bridged), and inferred ones between."""
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
        known[0, 0] = low if known[0, 0] - low <= CORNER else known[0, 0]
        known[-1, 1] = high if high - known[-1, 1] <= CORNER else known[-1, 1]
    breaks = np.unique(np.concatenate([[low, high], known.ravel()]))
    pieces = [(p, q, bool(np.any((known[:, 0] <= p) & (q <= known[:, 1])))) for p, q in pairwise(breaks)]
    if a > b:
        pieces = [(q, p, known_) for p, q, known_ in reversed(pieces)]
    return [_wall(first_id + i, side, line, a, b, *piece) for i, piece in enumerate(pieces)]


def _wall(id_: int, side: Side, line: PlanLine, a: float, b: float, p: float, q: float, known: bool) -> Wall:
    """The piece from position p to q along a line of a side that goes from a to b; its ends are the side's corners."""
    start = side.start if p == a else line.point(p)
    end = side.end if q == b else line.point(q)
    sigma = line.sigma_at((p + q) / 2)
    if known:
        return Wall(id_, start, end, sigma, line.sigma_angle, line.source, line.observations)
    if line.source == "inferred":
        return Wall(id_, start, end, line.sigma_offset, line.sigma_angle, "inferred", 0)
    return Wall(id_, start, end, max(sigma, SIGMA_OFFSET), max(line.sigma_angle, SIGMA_ANGLE), "inferred", 0)


def polygon_of(ring: list[Side]) -> shapely.Polygon:
    """The polygon of a ring's corners."""
    return shapely.Polygon([side.start for side in ring])
