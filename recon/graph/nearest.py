"""The wall that a segment fits best, among those whose stretch lies around it (compiled)."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from recon.geometry import Array
from recon.graph.line import Lines

Ints = NDArray[np.int64]

NONE = -1
"""Label of a segment that belongs to no wall."""
CELL = 2.0
"""m, side of a cell; segments are compared with walls that pass less than this from them."""


def nearest_walls(lines: Lines, spread: Array, walls: Lines, limits: tuple[float, float, float]) -> Ints:
    """The wall (K,) with the smallest Mahalanobis distance to each of the segments `lines`, NONE where none is near.

    spread: (K, 2, 2) covariance of (offset, angle) of each. limits: the largest squared distance; the gap (m) along
    the wall; the turn (rad).
    """
    if not len(lines) or not len(walls):
        return np.full(len(lines), NONE, dtype=np.int64)
    corner = np.minimum(lines.middle.min(axis=0), walls.middle.min(axis=0)) - CELL
    gate, reach, turn = limits
    cells, start, member = _table(walls, corner)
    return np.asarray(
        _nearest(
            np.column_stack([lines.pose, lines.half]), spread, np.column_stack([walls.pose, walls.half]),
            corner, cells, start, member, gate, reach, turn,
        )
    )  # fmt: skip


def _table(walls: Lines, corner: Array) -> tuple[Ints, Ints, Ints]:
    """Cells (C, 2) that walls pass, sorted, and the walls `member` of cell c from start[c] to start[c + 1]."""
    samples = 2 + (4 * walls.half / CELL).astype(np.int64)
    owner = np.repeat(np.arange(len(walls)), samples)
    number = np.arange(len(owner)) - np.repeat(np.cumsum(samples) - samples, samples)
    part = 2 * number / (samples[owner] - 1) - 1
    points = walls.middle[owner] + (part * walls.half[owner])[:, None] * walls.direction[owner]
    rows = np.column_stack([((points - corner) // CELL).astype(np.int64), owner])
    rows = np.unique(rows, axis=0)
    cells, start = np.unique(rows[:, :2], axis=0, return_index=True)
    return cells, np.append(start, len(rows)).astype(np.int64), rows[:, 2].copy()


@njit(cache=True)
def _cell(cells: Ints, u: int, v: int) -> int:
    """The number of cell (u, v), -1 where no wall passes it."""
    low, high = 0, len(cells)
    while low < high:
        middle = (low + high) // 2
        if cells[middle, 0] < u or (cells[middle, 0] == u and cells[middle, 1] < v):
            low = middle + 1
        else:
            high = middle
    return low if low < len(cells) and cells[low, 0] == u and cells[low, 1] == v else -1


@njit(cache=True)
def _nearest(
    lines: Array, spread: Array, walls: Array, corner: Array, cells: Ints, start: Ints, member: Ints,
    gate: float, reach: float, turn: float,
) -> Ints:  # fmt: skip
    """For rows x, y, yaw, half of lines and walls."""
    out = np.full(len(lines), NONE, np.int64)
    for i in range(len(lines)):
        best, half = gate, lines[i, 3] + reach
        steps = 1 + int(2 * half / CELL)
        for step in range(steps + 1):
            along = (2 * step / steps - 1) * half
            u = math.floor((lines[i, 0] + along * math.cos(lines[i, 2]) - corner[0]) / CELL)
            v = math.floor((lines[i, 1] + along * math.sin(lines[i, 2]) - corner[1]) / CELL)
            for cell in range(9):
                c = _cell(cells, u + cell // 3 - 1, v + cell % 3 - 1)
                if c < 0:
                    continue
                for k in range(start[c], start[c + 1]):
                    w = member[k]
                    distance = _distance(lines[i], spread[i], walls[w], reach, turn)
                    if distance < best or (distance == best and w < out[i]):
                        best, out[i] = distance, w
    return out


@njit(cache=True)
def _distance(line: Array, spread: Array, wall: Array, reach: float, turn: float) -> float:
    """Squared Mahalanobis distance of a line from a wall, infinite where they do not touch or are turned."""
    along, offset, angle = seen_from(wall, line)
    if is_apart(along, angle, line[3], wall[3], reach, turn):
        return math.inf
    return squared_distance_of(offset, angle, spread[0, 0], spread[0, 1], spread[1, 1])


@njit(cache=True)
def seen_from(wall: Array, line: Array) -> tuple[float, float, float]:
    """Where a line's middle is along a wall and off it (m), and how the line is turned against it (rad)."""
    angle = (line[2] - wall[2] + math.pi) % (2 * math.pi) - math.pi
    dx, dy, c, s = line[0] - wall[0], line[1] - wall[1], math.cos(wall[2]), math.sin(wall[2])
    return c * dx + s * dy, c * dy - s * dx, angle


@njit(cache=True)
def is_apart(along: float, angle: float, half: float, wall_half: float, reach: float, turn: float) -> bool:
    """Whether more than `reach` m lie between a line and a wall along it, or more than `turn` rad in direction."""
    return bool(abs(angle) > turn or abs(along) - wall_half - half * abs(math.cos(angle)) > reach)


@njit(cache=True)
def squared_distance_of(offset: float, angle: float, a: float, b: float, d: float) -> float:
    """Of (offset, angle) with the covariance [[a, b], [b, d]]."""
    return float((d * offset * offset - 2 * b * offset * angle + a * angle * angle) / (a * d - b * b))
