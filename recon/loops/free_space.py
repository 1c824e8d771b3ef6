"""What a submap saw to be empty: the floor that its rays crossed (compiled).

A place where two submaps overlap a little, with nothing of the one standing where the other saw through, is far more
likely right than one where much overlaps and something contradicts.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from recon.geometry import Array, apply2, between2
from recon.lidar.localmap import CELL, LocalMap
from recon.loops.submap import Submaps

Bools = NDArray[np.bool_]

SHORT = 0.3
"""m before its return at which a ray ends: surfaces seen at a grazing angle lie beside their returns."""
CLEAR = 2
"""Cells around a point of the map that are not called free."""
LEAST_RAYS = 2
"""Rays that must have crossed a free cell: single ones are stray returns."""


def free_space(submaps: Submaps, number: int, poses: Array, local: LocalMap, around: int = 1) -> Bools:
    """Free cells of the grid of `local`, the map of submap `number` and `around` neighbours on either side.

    poses: (N, 3) of all scans.
    """
    low, high = submaps.keyframes(number, around)
    at = between2(poses[submaps.anchor_scans[number]], poses[submaps.scans[low:high]])
    crossed = np.zeros(local.head.shape, np.int32)
    for k, pose in enumerate(at):
        _cross(crossed, local.corner, pose[:2].copy(), submaps.clouds.moved(low + k, low + k + 1, pose[None]).xy)
    free = crossed >= LEAST_RAYS
    _clear(free, local.corner, local.points)
    return free


def contradicted(xy: Array, pose: Array, local: LocalMap, free: Bools) -> float:
    """Share of the points xy (n, 2) of a cloud at `pose` (3,) in the map that stand where its rays crossed."""
    cells = np.floor((apply2(pose, xy) - local.corner) / CELL).astype(np.int64)
    inside = ((cells >= 0) & (cells < free.shape)).all(axis=1)
    return float(free[cells[inside, 0], cells[inside, 1]].sum()) / max(len(xy), 1)


@njit(cache=True, nogil=True)
def _cross(crossed: NDArray[np.int32], corner: Array, origin: Array, xy: Array) -> None:
    """Counts in each cell the rays from `origin` (2,) to the returns xy (n, 2)."""
    for i in range(len(xy)):
        dx, dy = xy[i, 0] - origin[0], xy[i, 1] - origin[1]
        distance = math.hypot(dx, dy)
        steps = int((distance - SHORT) / CELL)
        for k in range(steps):
            part = k * CELL / distance
            u = math.floor((origin[0] + part * dx - corner[0]) / CELL)
            v = math.floor((origin[1] + part * dy - corner[1]) / CELL)
            if 0 <= u < crossed.shape[0] and 0 <= v < crossed.shape[1]:
                crossed[u, v] += 1


@njit(cache=True, nogil=True)
def _clear(free: Bools, corner: Array, points: Array) -> None:
    """Takes out the cells around the points (n, 2)."""
    for i in range(len(points)):
        u, v = int((points[i, 0] - corner[0]) / CELL), int((points[i, 1] - corner[1]) / CELL)
        for du in range(-CLEAR, CLEAR + 1):
            for dv in range(-CLEAR, CLEAR + 1):
                if 0 <= u + du < free.shape[0] and 0 <= v + dv < free.shape[1]:
                    free[u + du, v + dv] = False
