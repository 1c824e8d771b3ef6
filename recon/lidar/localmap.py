"""The map around the platform: points of the keyframes nearby, fused in a grid."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from recon.config import LidarConfig
from recon.geometry import Array
from recon.lidar.cloud import Cloud

Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

CELL = 0.1
"""m, side of a grid cell."""
EXTENT = 25.0
"""m on either side of the centre that the map covers."""
SAME_NORMAL = 0.9
"""Cosine above which two points of a cell are of one surface."""


@dataclass(frozen=True)
class LocalMap:
    """Fused points in the map frame, found by the grid cell.

    points: (n, 2) m; normals: (n, 2); flat: (n,); information: (n,) 1/m^2, as in `Cloud`.
    head: (H, W) first point of each cell or -1; after: (n,) next point of the same cell or -1.
    corner: (2,) m, lower corner of cell (0, 0).
    """

    points: Array
    normals: Array
    flat: Bools
    information: Array
    head: Ints
    after: Ints
    corner: Array

    def __len__(self) -> int:
        return len(self.points)


def build_map(cloud: Cloud, centre: Array, config: LidarConfig) -> LocalMap:
    """The map of a cloud in the map frame, within `EXTENT` of the centre (2,)."""
    rows, corner, far = _rows(cloud.xy, cloud.normals, cloud.flat, cloud.information, centre, EXTENT)
    shape = ((far - corner) / CELL).astype(np.int64) + 1
    apart = max(3.0 * config.range_sigma, 0.02)
    head = np.full((int(shape[0]), int(shape[1])), -1, np.int64)
    after = np.full(len(rows), -1, np.int64)
    count = _fuse(rows, corner, head, after, apart)
    rows = rows[:count]
    return LocalMap(
        rows[:, 0:2].copy(), rows[:, 2:4].copy(), rows[:, 4] > 0, rows[:, 5].copy(), head, after[:count], corner
    )


@njit(cache=True)
def _rows(
    xy: Array, normals: Array, flat: Bools, information: Array, centre: Array, extent: float
) -> tuple[Array, Array, Array]:
    """Rows x, y, normal x, y, flat, information of the points nearer to the centre than `extent` on both axes, and the
    corners (2,) of the box round them; the centre where there are none."""
    rows, count = np.empty((len(xy), 6)), 0
    corner, far = centre.copy(), centre.copy()
    for i in range(len(xy)):
        if abs(xy[i, 0] - centre[0]) >= extent or abs(xy[i, 1] - centre[1]) >= extent:
            continue
        for c in range(2):
            rows[count, c], rows[count, 2 + c] = xy[i, c], normals[i, c]
            corner[c] = min(corner[c], xy[i, c]) if count else xy[i, c]
            far[c] = max(far[c], xy[i, c]) if count else xy[i, c]
        rows[count, 4], rows[count, 5] = 1.0 if flat[i] else 0.0, information[i]
        count += 1
    return rows[:count], corner, far


@njit(cache=True)
def _fuse(rows: Array, corner: Array, head: Ints, after: Ints, apart: float) -> int:
    """Fuses rows x, y, normal x, y, flat, information in place and links them to their cells; how many are left."""
    count = 0
    for i in range(len(rows)):
        u, v = int((rows[i, 0] - corner[0]) / CELL), int((rows[i, 1] - corner[1]) / CELL)
        k = head[u, v]
        while k >= 0 and not _one_surface(rows, k, i, apart):
            k = after[k]
        if k < 0:
            for c in range(6):
                rows[count, c] = rows[i, c]
            after[count] = head[u, v]
            head[u, v] = count
            count += 1
            continue
        part = rows[i, 5] / (rows[i, 5] + rows[k, 5])
        for c in range(4):
            rows[k, c] += part * (rows[i, c] - rows[k, c])
        rows[k, 5] += rows[i, 5]
    for k in range(count):
        if rows[k, 4] > 0:
            norm = np.hypot(rows[k, 2], rows[k, 3])
            rows[k, 2], rows[k, 3] = rows[k, 2] / norm, rows[k, 3] / norm
    return count


@njit(cache=True)
def _one_surface(rows: Array, a: int, b: int, apart: float) -> bool:
    if rows[a, 4] != rows[b, 4]:
        return False
    if rows[a, 4] == 0:
        return True
    if rows[a, 2] * rows[b, 2] + rows[a, 3] * rows[b, 3] < SAME_NORMAL:
        return False
    dx, dy = rows[b, 0] - rows[a, 0], rows[b, 1] - rows[a, 1]
    return abs(dx * rows[a, 2] + dy * rows[a, 3]) < apart
