"""Stretches of a wall line that observations support."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array

GAP = 0.15
"""m: smaller gaps than this lie between neighbouring points, not between walls."""


def covered(spans: Array, need: int) -> Array:
    """(K, 2) sorted, disjoint stretches that at least `need` of the intervals `spans` (n, 2) cover."""
    if len(spans) < need:
        return np.zeros((0, 2))
    edges = np.concatenate([spans[:, 0], spans[:, 1]])
    step = np.concatenate([np.ones(len(spans)), -np.ones(len(spans))])
    order = np.lexsort((-step, edges))  # where one ends and the next starts, the start comes first
    edges, inside = edges[order], np.cumsum(step[order]) >= need
    before = np.concatenate([[False], inside[:-1]])
    return np.stack([edges[inside & ~before], edges[~inside & before]], axis=1)


def union(parts: list[Array], gap: float = GAP) -> Array:
    """(K, 2) sorted, disjoint union of stretches, gaps below `gap` metres closed."""
    spans = np.concatenate(parts)
    if not len(spans):
        return spans
    spans = spans[np.argsort(spans[:, 0], kind="stable")]
    reach = np.maximum.accumulate(spans[:, 1])
    new = np.concatenate([[True], spans[1:, 0] > reach[:-1] + gap])
    last = np.concatenate([np.flatnonzero(new)[1:] - 1, [len(spans) - 1]])
    return np.stack([spans[new, 0], reach[last]], axis=1)


def supported(along: Array, half: Array, image: NDArray[np.int64], need_images: int) -> Array:
    """(K, 2) stretches that one wall's observations support, m along the wall.

    along, half: (n,) middle and half the length of each. A LiDAR segment (`image` (n,) -1) counts where a second one
    sees the same place, if the wall has more than two; images count where `need_images` segments do.
    """
    spans = np.stack([along - half, along + half], axis=1)
    lidar = spans[image < 0]
    return union([covered(lidar, 2 if len(lidar) > 2 else 1), covered(spans[image >= 0], need_images)])
