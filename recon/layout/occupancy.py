"""The map that robots drive on, from the optimised poses and what the scanner saw."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array
from recon.layout.evidence import BLOCKED_SHARE, MARGIN, PLATFORM_RADIUS, ray_times, scan_rays
from recon.layout.moving import stays
from recon.occupancy import FREE, OCCUPIED, UNKNOWN, Occupancy, trimmed
from recon.sequence.sequence import Scans
from recon.sequence.trajectory import Trajectory

RESOLUTION = 0.025
"""m: finer than robots' maps, which are made from it at any resolution and direction."""
MAX_CELLS = 16_000_000
"""The grid gets coarser where a building would need more cells than this."""


def build_occupancy(trajectory: Trajectory, scans: Scans) -> Occupancy:
    """Cells in which rays ended are occupied, cells that rays passed on their way to the first such cell are free.

    One return is enough where few rays pass, such as at the far end of a hall: robots had better stop too early. What
    moved is not in the map.
    """
    from recon.layout.rays import count_rays  # numba takes a while to import

    starts, ends = scan_rays(trajectory, scans)
    path = trajectory.poses[:, :2]
    seen = np.concatenate([path, ends])
    low, high = seen.min(axis=0) - MARGIN, seen.max(axis=0) + MARGIN
    resolution = max(RESOLUTION, float(np.sqrt(np.prod(high - low) / MAX_CELLS)))
    columns, rows = np.ceil((high - low) / resolution).astype(int)
    a, b = (starts - low) / resolution, (ends - low) / resolution
    nothing = np.zeros((rows, columns), np.bool_)
    still = stays(starts, ends, ray_times(scans))
    _, passes = count_rays(a, b, nothing)
    hits, _ = count_rays(a[still], b[still], nothing)
    occupied = (hits > 0) & (hits >= BLOCKED_SHARE * passes)
    _, passes = count_rays(a, b, occupied)
    cells = np.where(occupied, OCCUPIED, np.where(passes > 0, FREE, UNKNOWN)).astype(np.uint8)
    _clear(cells, (path - low) / resolution, PLATFORM_RADIUS / resolution)
    found = trimmed(Occupancy(low, resolution, cells))
    return replace(found, origin=found.origin.round(6), resolution=round(resolution, 9))  # as it will be written


def _clear(cells: NDArray[np.uint8], path: Array, radius: float) -> None:
    """Sets what is unknown within `radius` of the path (cells) free: the platform stood there."""
    reach = int(np.ceil(radius))
    steps = np.unique(np.floor(path).astype(np.int64), axis=0)
    for dy in range(-reach, reach + 1):
        for dx in range(-reach, reach + 1):
            if dx * dx + dy * dy <= radius * radius:
                x, y = steps[:, 0] + dx, steps[:, 1] + dy
                cells[y, x] = np.where(cells[y, x] == UNKNOWN, FREE, cells[y, x])
