"""Inner loops, compiled."""

from __future__ import annotations

import numpy as np
from numba import njit

from recon.geometry import Array


@njit(cache=True)
def clip_rays(outward: Array, gaps: Array, height: float, directions: Array) -> tuple[Array, Array]:
    """Lowest height (N,) of rays in a column and distance (N,) to it, as `Column.meet`.

    outward: (n, 2) normals of the column's sides, gaps: (n,) from the rays' origin to them, in the normals' lengths;
    height of the origin; directions: (N, 3). Clips line by side (Cyrus and Beck 1978).
    """
    lowest, entered = np.full(len(directions), np.inf), np.zeros(len(directions))
    for i in range(len(directions)):
        enter, leave = 0.0, np.inf
        for k in range(len(gaps)):
            speed = outward[k, 0] * directions[i, 0] + outward[k, 1] * directions[i, 1]
            if speed < 0.0:
                enter = max(enter, gaps[k] / speed)
            elif speed > 0.0:
                leave = min(leave, gaps[k] / speed)
            elif gaps[k] < 0.0:
                leave = -1.0
        entered[i] = enter
        if enter < leave:
            first = height + enter * directions[i, 2]
            last = height + min(leave, 1e6) * directions[i, 2]
            if first >= 0.0 and max(first, last) >= 0.0:
                lowest[i] = max(min(first, last), 0.0)
    return lowest, entered


@njit(cache=True)
def smooth(grid: Array, rounds: int) -> Array:
    """A grid (n, n, n) blurred by the weights 1/4, 1/2, 1/4 along its axes, `rounds` times."""
    size = grid.shape[0]
    for _ in range(rounds):
        for axis in range(3):
            out = np.zeros_like(grid)
            for i in range(size):
                for j in range(size):
                    for k in range(size):
                        value = 0.25 * grid[i, j, k]
                        if value == 0.0:
                            continue
                        out[i, j, k] += 2 * value
                        for step in (-1, 1):
                            a = i + step if axis == 0 else i
                            b = j + step if axis == 1 else j
                            c = k + step if axis == 2 else k
                            if 0 <= a < size and 0 <= b < size and 0 <= c < size:
                                out[a, b, c] += value
            grid = out
    return grid
