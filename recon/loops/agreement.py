"""Pairwise consistency of closures that lie side by side (after Mangelson et al., ICRA 2018).

Two submaps a few metres apart, each found in the older part of the drive, must have been found as far apart there.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array, between2, compose2, wrap_angle
from recon.graph.edges import Edges
from recon.loops.pose_graph import BARC

NEIGHBOURS = 6
"""Submaps on either side within which closures are compared."""
BEND = (0.02, 0.004)
"""m a metre and rad a metre driven: how far the drive between the two may be off."""


def agreeing(closures: Edges, nodes: Array, driven: Array) -> NDArray[np.bool_]:
    """Which closures (E,) between submaps at least one other agrees with, and more agree with than do not.

    nodes: (M, 3) the submaps' poses before any closure. driven: (M,) m. Closures that share the newer submap say the
    same thing twice and do not count for one another.
    """
    out = np.zeros(len(closures), np.bool_)
    order = np.argsort(closures.second, kind="stable")
    sorted_second = closures.second[order]
    for i in range(len(closures)):
        first, second = closures.first[i], closures.second[i]
        low, high = np.searchsorted(sorted_second, [second - NEIGHBOURS, second + NEIGHBOURS + 1])
        beside = order[low:high]
        near = (np.abs(closures.first[beside] - first) <= NEIGHBOURS) & (closures.second[beside] != second)
        others = closures[beside[near]]
        if not len(others):
            continue
        there = between2(nodes[first], nodes[others.first])
        back = between2(nodes[others.second], nodes[second])
        off = compose2(compose2(there, others.relative), back) - closures.relative[i]
        off[:, 2] = wrap_angle(off[:, 2])
        way = np.abs(driven[first] - driven[others.first]) + np.abs(driven[second] - driven[others.second])
        bend = (np.array(BEND)[[0, 0, 1]] * (1.0 + way[:, None])) ** 2
        spread = closures.covariance[i] + others.covariance + bend[:, None] * np.eye(3)
        agree = np.einsum("ei,eij,ej->e", off, np.linalg.inv(spread), off) < BARC
        out[i] = agree.sum() > max(0, (~agree).sum())
    return out
