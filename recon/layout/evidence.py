"""Where the LiDAR's rays passed: free space on a fine grid."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array
from recon.sequence.sequence import Scans
from recon.sequence.trajectory import Trajectory

RESOLUTION = 0.05
"""m, side of a grid cell."""
MAX_CELLS = 8_000_000
"""The grid gets coarser where a building would need more cells than this."""
MAX_RAYS = 3_000_000
"""Scans are thinned evenly beyond this many rays: more add time and no evidence."""
MARGIN = 1.0
"""m around everything seen."""
MIN_PASSES = 2
"""Rays through a cell before it is free: one alone may be an outlier."""
MIN_HITS = 3
BLOCKED_SHARE = 0.1
"""A cell is an obstacle from this share of returns among the rays that reach it (grazing rays pass wall cells)."""
PLATFORM_RADIUS = 0.15
"""m, free around the path: the platform stood there."""


@dataclass(frozen=True)
class FreeSpace:
    """Grid of what rays saw, in the map frame.

    origin: (2,) m, outer corner of cell [0, 0]. free, blocked, hit: (rows, columns), row along y, column along x. A
    cell that is neither free nor blocked was not seen. hit: at least one ray ended there, be it an outlier.
    """

    origin: Array
    resolution: float
    free: NDArray[np.bool_]
    blocked: NDArray[np.bool_]
    hit: NDArray[np.bool_]

    def index(self, points: Array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Rows and columns of the cells that points (N, 2) fall in, held at the rim."""
        cell = np.floor((points - self.origin) / self.resolution).astype(np.int64)
        rows, columns = self.free.shape
        return np.clip(cell[:, 1], 0, rows - 1), np.clip(cell[:, 0], 0, columns - 1)

    def is_free(self, points: Array) -> NDArray[np.bool_]:
        """(N,) whether points (N, 2) lie where rays passed."""
        return np.asarray(self.free[self.index(points)])

    def centres(self, mask: NDArray[np.bool_]) -> Array:
        """(n, 2) m: middles of the cells set in `mask`."""
        rows, columns = np.nonzero(mask)
        return self.origin + self.resolution * (np.stack([columns, rows], axis=1) + 0.5)

    @property
    def cell_area(self) -> float:
        """Area of a cell, m^2."""
        return self.resolution**2

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper corner (2,) of the grid, m."""
        rows, columns = self.free.shape
        return self.origin, self.origin + self.resolution * np.array([columns, rows])


def scan_rays(trajectory: Trajectory, scans: Scans) -> tuple[Array, Array]:
    """Starts and ends (R, 2), m, map frame, of all rays that returned; scans are thinned evenly beyond `MAX_RAYS`."""
    bearings = scans.bearings
    starts, ends = [], []
    for i in _used(scans):
        ok = scans.valid(i)
        if not ok.any():
            continue
        times = scans.timestamps[i] + scans.time_increment * np.flatnonzero(ok)
        pose = trajectory.at(times) if scans.time_increment else trajectory.at(scans.timestamps[i])
        angle = bearings[ok] + pose[:, 2]
        reach = scans.ranges[i][ok].astype(np.float64)[:, None]
        start = np.broadcast_to(pose[:, :2], (len(angle), 2))
        starts.append(start)
        ends.append(start + reach * np.stack([np.cos(angle), np.sin(angle)], axis=1))
    if not starts:
        return np.zeros((0, 2)), np.zeros((0, 2))
    return np.concatenate(starts), np.concatenate(ends)


def ray_times(scans: Scans) -> Array:
    """(R,) s: when each of the rays of `scan_rays` was sent."""
    times = [scans.timestamps[i] + scans.time_increment * np.flatnonzero(scans.valid(i)) for i in _used(scans)]
    return np.concatenate([np.zeros(0), *times])


def _used(scans: Scans) -> range:
    """The scans whose rays are evidence."""
    return range(0, len(scans), max(1, int(np.ceil(scans.ranges.size / MAX_RAYS))))


def free_space(trajectory: Trajectory, starts: Array, ends: Array, stays: NDArray[np.bool_] | None = None) -> FreeSpace:
    """Free space from rays `starts` to `ends` (R, 2), m, map frame. stays: (R,) those that ended at what stayed there.

    Two passes: returns that stand out make a cell an obstacle; then rays are cut at the first obstacle, so that
    outliers and late changes do not open what many rays found closed.
    """
    from recon.layout.rays import count_rays  # numba takes a while to import

    seen = np.concatenate([trajectory.poses[:, :2], ends])
    low, high = seen.min(axis=0) - MARGIN, seen.max(axis=0) + MARGIN
    resolution = max(RESOLUTION, float(np.sqrt(np.prod(high - low) / MAX_CELLS)))
    columns, rows = np.ceil((high - low) / resolution).astype(int)
    a, b = (starts - low) / resolution, (ends - low) / resolution
    nothing = np.zeros((rows, columns), np.bool_)
    hits, passes = count_rays(a, b, nothing)
    if stays is not None:
        hits, _ = count_rays(a[stays], b[stays], nothing)
    blocked = (hits >= MIN_HITS) & (hits >= BLOCKED_SHARE * passes)
    _, passes = count_rays(a, b, blocked)
    free = (passes >= MIN_PASSES) & ~blocked
    _stand(free, blocked, (trajectory.poses[:, :2] - low) / resolution, PLATFORM_RADIUS / resolution)
    return FreeSpace(low, resolution, free, blocked, hits > 0)


def _stand(free: NDArray[np.bool_], blocked: NDArray[np.bool_], path: Array, radius: float) -> None:
    """Sets the cells within `radius` of the path (cells) free."""
    reach = int(np.ceil(radius))
    for dy in range(-reach, reach + 1):
        for dx in range(-reach, reach + 1):
            if dx * dx + dy * dy <= radius * radius:
                cell = np.floor(path + np.array([dx, dy])).astype(np.int64)
                free[cell[:, 1], cell[:, 0]] = ~blocked[cell[:, 1], cell[:, 0]]
