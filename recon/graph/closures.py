"""Places visited again: where a scan lies in the map of another visit, as factors beside the walls."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array, between2
from recon.graph.motion import remaining_information, segment_information
from recon.graph.observation import WallObservations

Ints = NDArray[np.int64]

VISIT = 4.0
"""m: scans within this way that are measured from one place are one visit."""
SHARED = (0.01, 0.002)
"""m, rad: what all measurements of one visit are off together, because the map that they are measured in bends."""
AROUND = 6.0
"""m driven before and after a pose, within which scans make the map around it."""
TURN_EFFORT = 0.5
"""m/rad: a turn on the spot counts as this way."""


@dataclass(frozen=True)
class Closures:
    """E scans `second` (E,) measured from scans `first` (E,) of another visit, with the map around these.

    relative: (E, 3) poses of the second in the frame of the first, covariance: (E, 3, 3) of [x, y, yaw], m and rad, of
    each on its own. They are verified as a set: what is wrong with them beyond that is the robust loss's.
    """

    first: Ints
    second: Ints
    relative: Array
    covariance: Array

    def __len__(self) -> int:
        return len(self.first)

    @staticmethod
    def none() -> Closures:
        """No place was visited again."""
        return Closures(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 3, 3)))


def closure_information(closures: Closures, observations: WallObservations, labels: Ints, poses: Array) -> Array:
    """(E, 3, 3) information of the closures, in the frame of the first scan, that wall segments do not hold already.

    labels: (K,) wall of every segment. As for scan matches, segments of the second scan are taken off whose wall the
    scans around the first see too: the wall ties the two visits. The measurements of one visit share an error, which
    therefore counts once for each of them.
    """
    driven = _driven(poses)
    _, group, count = np.unique(
        np.stack([closures.first, (driven[closures.second] // VISIT).astype(np.int64)]),
        axis=1, return_inverse=True, return_counts=True,
    )  # fmt: skip
    shared = np.diag(np.array(SHARED)[[0, 0, 1]] ** 2)
    total = np.linalg.inv(closures.covariance + (count[group] - 1)[:, None, None] * shared)
    of_walls = np.zeros_like(total)
    edge, rows = _seen_from_both(closures, observations, labels, driven)
    np.add.at(of_walls, edge, segment_information(closures.relative[edge], observations, rows))
    return remaining_information(np.asarray(total), of_walls)


def _driven(poses: Array) -> Array:
    """(N,) m from the start."""
    step = between2(poses[:-1], poses[1:])
    return np.concatenate([[0.0], np.cumsum(np.hypot(step[:, 0], step[:, 1]) + TURN_EFFORT * np.abs(step[:, 2]))])


def _seen_from_both(
    closures: Closures, observations: WallObservations, labels: Ints, driven: Array
) -> tuple[Ints, Ints]:
    """Closures and LiDAR segments (both (n,)) of their second scans, of walls that scans around the first see too."""
    lidar = np.flatnonzero((labels >= 0) & (observations.image < 0))
    lidar = lidar[np.argsort(observations.pose[lidar], kind="stable")]
    scan = observations.pose[lidar]
    low, high = (np.searchsorted(scan, closures.second, side=side) for side in ("left", "right"))
    edge = np.repeat(np.arange(len(closures)), high - low)
    rows = lidar[np.arange(len(edge)) - np.repeat(np.cumsum(high - low) - high, high - low)]
    seen = np.sort(labels[lidar] * len(driven) + scan)
    at = driven[closures.first]
    first = np.searchsorted(driven, at - AROUND, side="left")[edge]
    last = np.searchsorted(driven, at + AROUND, side="right")[edge] - 1
    base = labels[rows] * len(driven)
    both = np.searchsorted(seen, base + last, side="right") > np.searchsorted(seen, base + first, side="left")
    return edge[both], rows[both]
