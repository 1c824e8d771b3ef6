"""Rays on a grid, compiled."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from recon.geometry import Array


@njit(cache=True)
def _walk(start: Array, end: Array) -> tuple[int, int, int, int, int, int, float, float, float, float]:
    """A ray from start (2,) to end (2,), in cells: cells of both, the way from cell to cell (-1 or 1) in x and y, where
    along the ray, as a part of it, the first border of either kind is met, and what lies between two of a kind."""
    x, y = int(start[0]), int(start[1])
    dx, dy = end[0] - start[0], end[1] - start[1]
    sx, sy = (1 if dx > 0 else -1), (1 if dy > 0 else -1)
    tx = ((x + (sx > 0)) - start[0]) / dx if dx != 0 else np.inf
    ty = ((y + (sy > 0)) - start[1]) / dy if dy != 0 else np.inf
    step_x = abs(1.0 / dx) if dx != 0 else np.inf
    step_y = abs(1.0 / dy) if dy != 0 else np.inf
    return x, y, int(end[0]), int(end[1]), sx, sy, tx, ty, step_x, step_y


@njit(cache=True)
def count_rays(starts: Array, ends: Array, blocked: NDArray[np.bool_]) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """How many rays end in each cell and how many pass through it.

    starts, ends: (R, 2), in cells, (x, y), inside the grid. blocked: (rows, columns); a ray stops before such a cell
    and then counts as no hit. Cells on the way are walked one by one (Amanatides and Woo, "A fast voxel traversal
    algorithm for ray tracing", 1987).
    """
    rows, columns = blocked.shape
    hits = np.zeros((rows, columns), np.int32)
    passes = np.zeros((rows, columns), np.int32)
    for i in range(len(starts)):
        x, y, x1, y1, sx, sy, tx, ty, step_x, step_y = _walk(starts[i], ends[i])
        stopped = False
        for _ in range(abs(x1 - x) + abs(y1 - y)):
            if blocked[y, x]:
                stopped = True
                break
            passes[y, x] += 1
            if tx < ty:
                x += sx
                tx += step_x
            else:
                y += sy
                ty += step_y
        if not stopped:
            hits[y1, x1] += 1
    return hits, passes


@njit(cache=True)
def count_spells(
    starts: Array, ends: Array, spell: NDArray[np.int64], rows: int, columns: int
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """In how many spells of time each cell was taken, and in how many it was passed at least twice and not taken.

    starts, ends: (R, 2), in cells, (x, y), inside the grid and not on its rim. spell: (R,) ascending. A cell is taken
    by a ray that ends in it or in one of the eight around it.
    """
    taken = np.zeros((rows, columns), np.int32)
    clear = np.zeros((rows, columns), np.int32)
    now = np.full((rows, columns), -1, np.int32)
    hit = np.zeros((rows, columns), np.bool_)
    passes = np.zeros((rows, columns), np.int32)
    for i in range(len(starts)):
        x, y, x1, y1, sx, sy, tx, ty, step_x, step_y = _walk(starts[i], ends[i])
        steps = abs(x1 - x) + abs(y1 - y)
        for k in range(steps + 9):
            u, v = x, y
            if k >= steps:
                u, v = x1 + (k - steps) % 3 - 1, y1 + (k - steps) // 3 - 1
            if now[v, u] != spell[i]:
                if hit[v, u]:
                    taken[v, u] += 1
                elif passes[v, u] > 1:
                    clear[v, u] += 1
                now[v, u], hit[v, u], passes[v, u] = spell[i], False, 0
            if k >= steps:
                hit[v, u] = True
                continue
            passes[v, u] += 1
            if tx < ty:
                x += sx
                tx += step_x
            else:
                y += sy
                ty += step_y
    for v in range(rows):
        for u in range(columns):
            if hit[v, u]:
                taken[v, u] += 1
            elif passes[v, u] > 1:
                clear[v, u] += 1
    return taken, clear
