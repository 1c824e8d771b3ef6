"""The clouds of all keyframes in a few arrays of single precision: a long drive has a hundred thousand."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from recon.geometry import Array
from recon.lidar.cloud import Cloud

Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
Floats = NDArray[np.float32]


@dataclass(frozen=True)
class Clouds:
    """K clouds, one after the other, each in the platform frame of its scan.

    rows: (n, 5) x, y (m), normal x, y, information (1/m^2); flat: (n,). start: (K + 1,) first point of each cloud.
    """

    rows: Floats
    flat: Bools
    start: Ints

    def __len__(self) -> int:
        return len(self.start) - 1

    @staticmethod
    def pack(clouds: Iterable[Cloud]) -> Clouds:
        """From clouds that are made one by one."""
        rows, flat, counts = [np.zeros((0, 5), np.float32)], [np.zeros(0, np.bool_)], [0]
        for c in clouds:
            rows.append(np.column_stack([c.xy, c.normals, c.information]).astype(np.float32))
            flat.append(c.flat)
            counts.append(len(c))
        return Clouds(np.concatenate(rows), np.concatenate(flat), np.cumsum(counts))

    def moved(self, low: int, high: int, poses: Array) -> Cloud:
        """Clouds `low` to `high` - 1 together, each moved by its pose (high - low, 3)."""
        xy, normals, information = _moved(self.rows, self.start[low : high + 1], poses)
        return Cloud(xy, normals, self.flat[self.start[low] : self.start[high]], information)


@njit(cache=True, nogil=True)
def _moved(rows: Floats, start: Ints, poses: Array) -> tuple[Array, Array, Array]:
    first, count = start[0], start[-1] - start[0]
    xy, normals, information = np.empty((count, 2)), np.empty((count, 2)), np.empty(count)
    for k in range(len(poses)):
        c, s = math.cos(poses[k, 2]), math.sin(poses[k, 2])
        for i in range(start[k], start[k + 1]):
            x, y, u, v = rows[i, 0], rows[i, 1], rows[i, 2], rows[i, 3]
            j = i - first
            xy[j, 0], xy[j, 1] = c * x - s * y + poses[k, 0], s * x + c * y + poses[k, 1]
            normals[j, 0], normals[j, 1] = c * u - s * v, s * u + c * v
            information[j] = rows[i, 4]
    return xy, normals, information
