"""What an alignment of a scan leaves open: how wide it is, whether it slid, how far it contradicts its prediction."""

from __future__ import annotations

import numpy as np

from recon.geometry import Array, wrap_angle
from recon.lidar.icp import Alignment

GOOD_OVERLAP = 0.75
"""Share of a scan's points on the map from which an alignment near its prediction is beyond doubt."""
SLIDING = 0.005
"""m: standard deviation along some direction from which an alignment may have slid along it."""
CONTRADICTION = 4.0
"""Squared normalised distance from constant velocity above which a match in doubt may as well be where it leads."""
DOUBT = 0.5
"""Part of the prediction's deviation that a match in doubt may be off, along the direction it knows least."""
UNKNOWN = (10.0, 3.0)
"""m, rad: standard deviations of what scans alone do not tell."""


def surprise(pose: Array, prior: Array, information: Array) -> float:
    """Squared normalised distance of a pose (3,), m, m, rad, from the prior (3,) with `information` (3, 3)."""
    offset = pose - prior
    offset[2] = wrap_angle(offset[2])
    return float(offset @ information @ offset)


def match_spread(information: Array) -> Array:
    """(3, 3) covariance of a match with `information` (3, 3), as wide as UNKNOWN where it tells nothing."""
    return np.asarray(np.linalg.inv(information + np.diag(np.array(UNKNOWN)[[0, 0, 1]] ** -2.0)))


def slides(found: Alignment) -> bool:
    """Whether the scan hardly says where it is along some direction.

    Walls that are not quite straight then push it far along a corridor, step by step, to a worse place.
    """
    spread = match_spread(found.information)
    return bool(np.linalg.eigvalsh(spread[:2, :2])[-1] > SLIDING**2)


def match_doubt(found: Alignment, prior: Array, information: Array, sigma: Array) -> Array:
    """(3, 3) covariance, map frame, of a match that nothing but constant velocity can contradict: 0 beyond doubt."""
    doubt = np.zeros((3, 3))
    if found.overlap >= GOOD_OVERLAP:
        return doubt
    spread = match_spread(found.information)
    along = np.linalg.eigh(spread[:2, :2])[1][:, -1]
    doubt[:2, :2] = (DOUBT * sigma[0]) ** 2 * np.outer(along, along)
    if surprise(found.pose, prior, information) > CONTRADICTION:
        offset = found.pose - prior
        offset[2] = wrap_angle(offset[2])
        doubt += np.outer(offset, offset)
    return doubt
