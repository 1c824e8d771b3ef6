"""Likelihood grids of a submap at many resolutions, for branch and bound (compiled).

Level h holds at [u, v] the largest likelihood of the 2^h x 2^h cells from there on, all levels at full resolution
(Hess et al., "Real-time loop closure in 2D LIDAR SLAM", ICRA 2016, section V-B).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from recon.geometry import Array

Bytes = NDArray[np.uint8]

CELL = 0.1
"""m, side of a cell."""
BLUR = 0.1
"""m, standard deviation of the likelihood around a map point."""
LEVELS = 7


@dataclass(frozen=True)
class Pyramid:
    """levels: (L, H, W) likelihoods in 1/255. corner: (2,) m, lower corner of cell (pad, pad).

    The first `pad` rows and columns lie outside the map: there coarse cells start that reach into it.
    """

    levels: Bytes
    corner: Array
    pad: int


def build_pyramid(points: Array, levels: int = LEVELS) -> Pyramid:
    """From map points (n, 2), m."""
    pad = 2 ** (levels - 1) - 1
    margin = int(3 * BLUR / CELL) + 1
    corner = points.min(axis=0) - margin * CELL
    size = ((points.max(axis=0) - corner) / CELL).astype(np.int64) + margin + 1
    out = np.zeros((levels, int(size[0]) + pad, int(size[1]) + pad), np.uint8)
    _splat(points, corner, out[0], margin, pad)
    for h in range(1, levels):
        _pool(out[h - 1], out[h], 2 ** (h - 1))
    return Pyramid(out, corner, pad)


@njit(cache=True, nogil=True)
def _splat(points: Array, corner: Array, grid: Bytes, margin: int, pad: int) -> None:
    """Writes 255 exp(-d^2 / 2 blur^2), d being the distance from the cell's middle to the nearest point."""
    for i in range(len(points)):
        pu, pv = (points[i, 0] - corner[0]) / CELL, (points[i, 1] - corner[1]) / CELL
        for u in range(int(pu) - margin, int(pu) + margin + 1):
            for v in range(int(pv) - margin, int(pv) + margin + 1):
                if u < 0 or v < 0 or u + pad >= grid.shape[0] or v + pad >= grid.shape[1]:
                    continue
                square = ((u + 0.5 - pu) ** 2 + (v + 0.5 - pv) ** 2) * CELL * CELL
                value = np.uint8(255.0 * math.exp(-0.5 * square / BLUR**2))
                grid[u + pad, v + pad] = max(grid[u + pad, v + pad], value)


@njit(cache=True, nogil=True)
def _pool(fine: Bytes, coarse: Bytes, step: int) -> None:
    """Largest of the four cells of the finer level that are `step` apart."""
    rows, columns = fine.shape
    for u in range(rows):
        below = u + step < rows
        for v in range(columns):
            value = fine[u, v]
            right = v + step < columns
            if right:
                value = max(value, fine[u, v + step])
            if below:
                value = max(value, fine[u + step, v])
                if right:
                    value = max(value, fine[u + step, v + step])
            coarse[u, v] = value
