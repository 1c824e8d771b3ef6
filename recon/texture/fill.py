"""Plausible colours for what no image saw."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

Grid = NDArray[np.float32]


def push_pull(colour: Grid, weight: Grid) -> Grid:
    """Colours (r, c, 3) with the holes, weight (r, c) = 0, filled smoothly from what surrounds them.

    Gortler et al. 1996: averages over ever larger squares are taken from known cells only, then handed down to the unknown ones. Something
    must be known.
    """
    known = np.clip(weight, 0, 1)[..., None]
    if min(colour.shape[:2]) == 1 and max(colour.shape[:2]) == 1:
        return colour
    size = (-(-colour.shape[1] // 2), -(-colour.shape[0] // 2))
    summed = _halve(np.concatenate([colour * known, known], axis=2))
    coarse = summed[..., :3] / np.maximum(summed[..., 3:], 1e-6)
    below = push_pull(coarse, np.minimum(summed[..., 3] * 4, 1)) if (summed[..., 3] < 0.25).any() else coarse
    wide = cv2.resize(below, (size[0] * 2, size[1] * 2), interpolation=cv2.INTER_LINEAR)
    wide = wide[: colour.shape[0], : colour.shape[1]]
    return np.asarray(colour * known + wide * (1 - known))


def _halve(grid: Grid) -> Grid:
    """Means of 2 x 2 cells; an odd last row or column counts as if there were nothing beyond."""
    even = cv2.copyMakeBorder(grid, 0, grid.shape[0] % 2, 0, grid.shape[1] % 2, cv2.BORDER_CONSTANT)
    half = cv2.resize(even, (even.shape[1] // 2, even.shape[0] // 2), interpolation=cv2.INTER_AREA)
    return np.asarray(half)
