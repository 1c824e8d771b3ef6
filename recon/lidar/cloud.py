"""A scan made ready for matching: few points, each with a normal, far less noisy than the returns.

Walls are sampled along their fitted lines; what is no line keeps local normals where it is smooth, and becomes a
blob (a table leg) where it is not.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from recon.config import LidarConfig
from recon.geometry import Array, rotation2
from recon.lidar.line_fit import FLATNESS, across_variance, total_least_squares
from recon.lidar.points import ScanPoints
from recon.lidar.split_and_merge import find_segments

Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

SPACING = 0.1
"""m between samples along a wall."""
BIN = 0.05
"""m: returns off the lines are averaged over this length."""
REACH = 0.12
"""m on either side that decides on a local normal."""
MIN_NEIGHBOURS = 5
"""Returns that a local normal needs."""
SMOOTH_SIGMA = 0.01
"""m: unevenness of smooth things that are no walls."""
BLOB_SIGMA = 0.04
"""m: how far the visible middle of a small thing wanders as it is seen from another side."""


@dataclass(frozen=True)
class Cloud:
    """n points of one scan, in the platform frame at its timestamp (or, moved, in the map frame).

    xy, normals: (n, 2) m and unit, towards the scanner. flat: (n,) whether the normal means something.
    information: (n,) 1/m^2, inverse variance across the surface; of a blob in every direction.
    """

    xy: Array
    normals: Array
    flat: Bools
    information: Array

    def __len__(self) -> int:
        return len(self.xy)

    def moved(self, map_from_platform: Array) -> Cloud:
        """The same cloud in the map frame; map_from_platform: (3,)."""
        turn = rotation2(float(map_from_platform[2])).T
        return Cloud(self.xy @ turn + map_from_platform[:2], self.normals @ turn, self.flat, self.information)

    @staticmethod
    def concatenate(clouds: list[Cloud]) -> Cloud:
        """One after the other."""
        return Cloud(
            np.concatenate([c.xy for c in clouds]),
            np.concatenate([c.normals for c in clouds]),
            np.concatenate([c.flat for c in clouds]),
            np.concatenate([c.information for c in clouds]),
        )


def make_cloud(points: ScanPoints, config: LidarConfig) -> Cloud:
    """The cloud of one scan."""
    lines, counts, _, owner, label = find_segments(points, config)
    rest = np.flatnonzero((label >= 0) & (owner < 0))
    walls = _sample_lines(lines, counts, config.range_sigma)
    clutter = _sample_rest(points.xy[rest], label[rest], config.range_sigma)
    both = np.concatenate([walls, clutter])
    return Cloud(both[:, 0:2].copy(), both[:, 2:4].copy(), both[:, 4] > 0, both[:, 5].copy())


@njit(cache=True)
def _sample_lines(lines: Array, counts: Ints, sigma: float) -> Array:
    """Rows x, y, normal x, y, 1, information every `SPACING` along lines (M, 8)."""
    total = 0
    for i in range(len(lines)):
        total += 1 + int(math.hypot(lines[i, 2] - lines[i, 0], lines[i, 3] - lines[i, 1]) / SPACING)
    out, k = np.zeros((total, 6)), 0
    for i in range(len(lines)):
        dx, dy = lines[i, 2] - lines[i, 0], lines[i, 3] - lines[i, 1]
        length = math.hypot(dx, dy)
        samples = 1 + int(length / SPACING)
        nx, ny = -dy / length, dx / length
        for j in range(samples):
            part = (j + 0.5) / samples
            x, y = lines[i, 0] + part * dx, lines[i, 1] + part * dy
            variance = across_variance(x, y, nx, ny, sigma) * samples / counts[i] + FLATNESS * FLATNESS
            out[k, 0], out[k, 1], out[k, 2], out[k, 3], out[k, 4], out[k, 5] = x, y, nx, ny, 1.0, 1.0 / variance
            k += 1
    return out


@njit(cache=True)
def _sample_rest(xy: Array, label: Ints, sigma: float) -> Array:
    """Rows x, y, normal x, y, flat or not, information of the returns (n, 2) that are on no line."""
    n = len(xy)
    out, ones, k, a = np.zeros((n, 6)), np.ones(n), 0, 0
    while a < n:
        b = a + 1
        while b < n and label[b] == label[a] and math.hypot(xy[b, 0] - xy[a, 0], xy[b, 1] - xy[a, 1]) < BIN:
            b += 1
        x, y = 0.0, 0.0
        for i in range(a, b):
            x += xy[i, 0] / (b - a)
            y += xy[i, 1] / (b - a)
        low, high = a, b
        while low > 0 and label[low - 1] == label[a] and math.hypot(xy[low - 1, 0] - x, xy[low - 1, 1] - y) < REACH:
            low -= 1
        while high < n and label[high] == label[a] and math.hypot(xy[high, 0] - x, xy[high, 1] - y) < REACH:
            high += 1
        out[k, 0], out[k, 1] = x, y
        if high - low >= MIN_NEIGHBOURS:
            _local_normal(xy[low:high], ones, sigma, out[k])
        variance = sigma * sigma / (b - a) + (SMOOTH_SIGMA**2 if out[k, 4] > 0 else BLOB_SIGMA**2)
        out[k, 5] = 1.0 / variance
        k += 1
        a = b
    return out[:k]


@njit(cache=True)
def _local_normal(xy: Array, ones: Array, sigma: float, row: Array) -> None:
    """Writes normal and flat = 1 into `row` where the returns xy (n, 2) lie along a line longer than their noise."""
    mx, my, nx, ny = total_least_squares(xy, ones)
    across, along = 0.0, 0.0
    for i in range(len(xy)):
        dx, dy = xy[i, 0] - mx, xy[i, 1] - my
        across += (dx * nx + dy * ny) ** 2 / len(xy)
        along += (dy * nx - dx * ny) ** 2 / len(xy)
    if along < 9.0 * across or along < 4.0 * sigma * sigma:
        return
    sign = -1.0 if nx * mx + ny * my > 0 else 1.0
    row[2], row[3], row[4] = sign * nx, sign * ny, 1.0
