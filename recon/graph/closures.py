"""Places visited again: where a scan lies in the map of another visit, as factors beside the walls."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array, between2, driven2
from recon.graph.edges import Edges
from recon.graph.motion import remaining_information, segment_information
from recon.graph.observation import WallObservations

Ints = NDArray[np.int64]

VISIT = 4.0
"""m: scans within this way that are measured from one place are one visit."""
SHARED = (0.01, 0.002)
"""m, rad: what all measurements of one visit are off together, because the map that they are measured in bends."""
AROUND = 6.0
"""m driven before and after a pose, within which scans make the map around it."""


def closure_information(closures: Edges, observations: WallObservations, labels: Ints, poses: Array) -> Array:
    """(E, 3, 3) information of the closures, in the frame of the first scan, that wall segments do not hold already.

    closures: scans `second` measured from scans `first` of another visit, with the map around these; the covariance is
    of each on its own. They are verified as a set: what is wrong with them beyond that is the robust loss's.
    labels: (K,) wall of every segment. As for scan matches, segments of the second scan are taken off whose wall the
    scans around the first see too: the wall ties the two visits. The measurements of one visit share an error, which
    therefore counts once for each of them.
    """
    driven = driven2(between2(poses[:-1], poses[1:]))
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


def _seen_from_both(closures: Edges, observations: WallObservations, labels: Ints, driven: Array) -> tuple[Ints, Ints]:
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
