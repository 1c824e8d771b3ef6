"""Break points: where one surface ends and the next begins (compiled).

Borges and Aldon, "Line extraction in 2D range images for mobile robotics", J. Intelligent and Robotic Systems 40,
2004: two neighbouring returns belong together when a surface seen no flatter than `GRAZING` explains their distance.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from recon.geometry import Array

Ints = NDArray[np.int64]

GRAZING = math.radians(8.0)
"""Smallest angle between a beam and a wall at which neighbouring returns still count as one surface."""
MAX_GAP = 6
"""More steps than this without a return end a cluster."""


@njit(cache=True)
def cluster(xy: Array, steps: Ints, step: float, sigma: float) -> Ints:
    """(n,) cluster of each point, -1 for lone points: outliers, and mixed pixels between a near and a far surface.

    xy: (n, 2) m, counter-clockwise; steps: (n,) beam counts; step: rad between beams; sigma: range noise, m.
    """
    n = len(xy)
    label = np.full(n, -1, np.int64)
    current, previous, before = -1, -1, False
    for i in range(n):
        after = i + 1 < n and _same_surface(xy, steps, i, i + 1, step, sigma)
        if not before and not after:
            continue
        # a lone return in front of a wall does not cut the wall: it is stepped over
        if previous < 0 or not (before or _same_surface(xy, steps, previous, i, step, sigma)):
            current += 1
        label[i] = current
        previous, before = i, after
    return label


@njit(cache=True)
def _same_surface(xy: Array, steps: Ints, i: int, j: int, step: float, sigma: float) -> bool:
    gap = steps[j] - steps[i]
    angle = gap * step
    if gap > MAX_GAP or angle >= 0.8 * GRAZING:
        return False
    near = min(math.hypot(xy[i, 0], xy[i, 1]), math.hypot(xy[j, 0], xy[j, 1]))
    reach = near * math.sin(angle) / math.sin(GRAZING - angle) + 3.0 * math.sqrt(2.0) * sigma
    return math.hypot(xy[j, 0] - xy[i, 0], xy[j, 1] - xy[i, 1]) <= reach
