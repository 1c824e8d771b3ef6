"""The best place of a cloud in a submap within a whole window, by branch and bound (compiled; Hess et al. 2016)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from recon.geometry import Array, wrap_angle
from recon.loops.grid import CELL, Bytes, Pyramid

Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Match:
    """pose: (3,) submap_from_cloud. score: mean likelihood of the cloud's points there, 0 to 1."""

    pose: Array
    score: float


def search(
    xy: Array, pyramid: Pyramid, guess: Array, window: Array, least: float, taken: Match | None = None,
    apart: tuple[float, float] = (1.0, 0.2),
) -> Match | None:  # fmt: skip
    """The place with the highest score in the window, None where none reaches `least`.

    xy: (n, 2) m, points of the cloud. guess: (3,) submap_from_cloud; window: (2,) m and rad on either side of it.
    taken: a match whose surroundings, `apart` (m and rad, both must hold), are left out: to find the second best.
    """
    reach = float(np.percentile(np.hypot(xy[:, 0], xy[:, 1]), 90))
    turn = CELL / max(reach, 2.0)
    count, shifts = int(window[1] / turn), int(window[0] / CELL) + 1
    turns = np.arange(-count, count + 1) * turn
    cells = _cells(xy, guess, turns, pyramid.corner, pyramid.pad)
    hole = np.array([0.0, 0.0, -1.0, 0.0])
    if taken is not None:
        offset = (taken.pose[:2] - guess[:2]) / CELL
        hole = np.array([offset[0], offset[1], apart[0] / CELL, 0.0])
    near = np.zeros(len(turns), np.bool_)
    if taken is not None:
        near = np.abs(wrap_angle(guess[2] + turns - taken.pose[2])) < apart[1]
    found = _search(pyramid.levels, cells, shifts, least * 255.0 * len(xy), hole, near)
    if found[0] < 0:
        return None
    du, dv, t, total = found[1], found[2], found[0], found[3]
    pose = np.array([guess[0] + du * CELL, guess[1] + dv * CELL, float(wrap_angle(guess[2] + turns[t]))])
    return Match(pose, total / (255.0 * len(xy)))


@njit(cache=True, nogil=True)
def _cells(xy: Array, guess: Array, turns: Array, corner: Array, pad: int) -> Ints:
    """(T, n, 2) cells of the points at the guess, for every turn."""
    out = np.empty((len(turns), len(xy), 2), np.int64)
    for t in range(len(turns)):
        c, s = math.cos(guess[2] + turns[t]), math.sin(guess[2] + turns[t])
        for i in range(len(xy)):
            out[t, i, 0] = math.floor((c * xy[i, 0] - s * xy[i, 1] + guess[0] - corner[0]) / CELL) + pad
            out[t, i, 1] = math.floor((s * xy[i, 0] + c * xy[i, 1] + guess[1] - corner[1]) / CELL) + pad
    return out


@njit(cache=True)
def _total(grid: Bytes, cells: Ints, du: int, dv: int) -> int:
    total = 0
    for i in range(len(cells)):
        u, v = cells[i, 0] + du, cells[i, 1] + dv
        if 0 <= u < grid.shape[0] and 0 <= v < grid.shape[1]:
            total += grid[u, v]
    return total


@njit(cache=True, nogil=True)
def _search(
    levels: Bytes, cells: Ints, shifts: int, least: float, hole: Array, near: NDArray[np.bool_]
) -> tuple[int, int, int, int]:
    """(turn, du, dv, total) of the best place, turn -1 where none reaches `least`. Depth first, best child first."""
    top = levels.shape[0] - 1
    while top > 0 and 2**top > 2 * shifts + 1:
        top -= 1
    block = 2**top
    across = (2 * shifts + block) // block
    roots = np.empty(len(cells) * across * across, np.int64)
    for t in range(len(cells)):
        for i in range(across):
            for j in range(across):
                roots[(t * across + i) * across + j] = _total(
                    levels[top], cells[t], i * block - shifts, j * block - shifts
                )
    order = np.argsort(-roots)
    best, best_t, best_u, best_v = least, -1, 0, 0
    stack = np.empty((3 * (top + 1) + 4, 4), np.int64)  # du, dv, level, bound
    four = np.empty((4, 3), np.int64)
    for index in order:
        if roots[index] < best:
            break
        t, rest = index // (across * across), index % (across * across)
        stack[0, 0], stack[0, 1] = (rest // across) * block - shifts, (rest % across) * block - shifts
        stack[0, 2], stack[0, 3] = top, roots[index]
        size = 1
        while size > 0:
            size -= 1
            du, dv, level, bound = stack[size, 0], stack[size, 1], stack[size, 2], stack[size, 3]
            if bound < best or du > shifts or dv > shifts:
                continue
            if level == 0:
                if near[t] and math.hypot(du - hole[0], dv - hole[1]) < hole[2]:
                    continue
                if bound > best or best_t < 0:
                    best, best_t, best_u, best_v = float(bound), t, du, dv
                continue
            half = 2 ** (level - 1)
            for k in range(4):
                four[k, 0], four[k, 1] = du + (k // 2) * half, dv + (k % 2) * half
                four[k, 2] = _total(levels[level - 1], cells[t], four[k, 0], four[k, 1])
            for k in np.argsort(four[:, 2]):
                if four[k, 2] >= best:
                    stack[size, 0], stack[size, 1] = four[k, 0], four[k, 1]
                    stack[size, 2], stack[size, 3] = level - 1, four[k, 2]
                    size += 1
    return best_t, best_u, best_v, int(best)
