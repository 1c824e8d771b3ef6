"""Inner loops, compiled."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Grid = NDArray[np.float32]
Index = NDArray[np.int64]
Array = NDArray[np.float64]


@njit(cache=True, nogil=True)
def expansion(
    block: Index,
    slot: Index,
    columns: int,
    own: Grid,
    leave: Grid,
    view: NDArray[np.int32],
    chosen: Index,
    place: Index,
) -> tuple[Array, Index, Index, Array]:
    """The cut that tells which of blocks (n,) a view, in their slots (n,), should take from the views chosen now.

    own, leave, view: (blocks, slots) of each slot its cost, what it pays for a side where another view begins, its view
    or -1; slot 0 is empty only where all are. chosen: (blocks,). place: (blocks,), -1, to work with. Returns what it
    costs each block to be taken (n,), and edges from first (e,) to second (e,), numbers in `block`, with what is paid
    (e,) where the second is taken alone. Kolmogorov and Zabih 2004, section 4.1, with A, B, C what a pair costs where
    both stay, where the second goes, where the first goes: A + (C - A) x - C y + (B + C - A) (1 - x) y.
    """
    total, n = len(chosen), len(block)
    for k in range(n):
        place[block[k]] = k
    gain = np.zeros(n)
    first, second = np.empty(2 * n, np.int64), np.empty(2 * n, np.int64)
    capacity = np.empty(2 * n)
    count = 0
    for k in range(n):
        i = block[k]
        mine = view[i, chosen[i]]
        new, column = view[i, slot[k]], i % columns
        gain[k] += own[i, slot[k]] - own[i, chosen[i]]
        for side in range(4):
            j = i + (1, columns, -1, -columns)[side]
            if j < 0 or j >= total or (side == 0 and column == columns - 1) or (side == 2 and column == 0):
                continue
            other = view[j, chosen[j]]
            if other < 0:
                continue
            there = leave[j, chosen[j]]
            both_stay = leave[i, chosen[i]] + there if mine != other else 0.0
            first_goes = leave[i, slot[k]] + there if new != other else 0.0
            if place[j] < 0:
                gain[k] += first_goes - both_stay
            elif side < 2:
                second_goes = leave[i, chosen[i]] + leave[j, slot[place[j]]] if mine != new else 0.0
                gain[k] += first_goes - both_stay
                gain[place[j]] -= first_goes
                first[count], second[count] = k, place[j]
                capacity[count] = max(second_goes + first_goes - both_stay, 0.0)
                count += 1
    for k in range(n):
        place[block[k]] = -1
    return gain, first[:count], second[:count], capacity[:count]


@njit(cache=True, nogil=True)
def in_cone(points: Array, low: Array, high: Array, radius: float, near: float, far: float) -> Index:
    """Which (n,) of points (N, 3), camera frame, are deeper than `near`, nearer than `far` and in a `Lens`'s cone."""
    out = np.empty(len(points), np.int64)
    count = 0
    for k in range(len(points)):
        x, y, z = points[k, 0], points[k, 1], points[k, 2]
        inside = z > near and low[0] * z < x < high[0] * z and low[1] * z < y < high[1] * z
        across = x * x + y * y
        if inside and across < (radius * z) ** 2 and np.sqrt(across + z * z) < far:
            out[count] = k
            count += 1
    return out[:count]


@njit(cache=True, nogil=True)
def resolution(pixels: Array, moved: Array, step: float) -> tuple[Array, Array]:
    """Pixels per metre (n,), (n,) in the best and the worst resolved direction: the singular values of the Jacobian.

    pixels: (n, 2) of points of a plane; moved: (2, n, 2) of these `step` m to either side. 0, 0 where that is nan.
    """
    fine, coarse = np.zeros(len(pixels)), np.zeros(len(pixels))
    for k in range(len(pixels)):
        a, b = (moved[0, k, 0] - pixels[k, 0]) / step, (moved[0, k, 1] - pixels[k, 1]) / step
        c, d = (moved[1, k, 0] - pixels[k, 0]) / step, (moved[1, k, 1] - pixels[k, 1]) / step
        total, determinant = a * a + b * b + c * c + d * d, a * d - b * c
        if total > 0:
            root = np.sqrt(max(total * total - 4 * determinant * determinant, 0.0))
            fine[k] = np.sqrt((total + root) / 2)
            coarse[k] = abs(determinant) / max(fine[k], 1e-12)
    return fine, coarse
