"""Plausible colours for what no image saw."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

Grid = NDArray[np.float32]

SURROUNDINGS = 20.0
"""Cells (standard deviation): posters and doors are smaller than that, changes of light are wider."""
UNUSUAL = 18.0
"""Levels (0 to 255), one standard deviation at least: a cell that differs by more from the usual does not spread."""
PULL = 1e-3
"""Weight of the face's own usual colour in every cell: far from anything seen, it wins."""


def fill_smoothly(colour: Grid, weight: Grid) -> Grid:
    """Colours (r, c, 3) of a face whose cells of weight (r, c) > 0, up to 1, are known: the others continue them.

    What is unlike its wide surroundings, or unlike most of the face, does not spread.
    """
    common = usual_colour(colour, weight)
    ordinary = weight * (_weight(colour, common, weight) + 0.01)
    stacked = np.concatenate([colour * ordinary[..., None], ordinary[..., None]], axis=2)
    wide = cv2.GaussianBlur(stacked, (0, 0), SURROUNDINGS, borderType=cv2.BORDER_REPLICATE)
    around = (wide[..., :3] + 1e-4 * common) / (wide[..., 3:] + 1e-4)
    spread = weight * _weight(colour, around, weight)
    total = spread[..., None] + PULL
    blended = (colour * spread[..., None] + common * PULL) / total
    return push_pull(np.asarray(blended, np.float32), np.asarray(total[..., 0], np.float32))


def usual_colour(colour: Grid, weight: Grid) -> Grid:
    """The colour (3,) of most of the face: the weighted mean without what is far from it, starting at the median."""
    seen = colour[weight > 0.5 * weight.max()]
    centre = np.median(seen, axis=0)
    for _ in range(5):
        w = weight * _weight(colour, centre, weight)
        centre = (colour * w[..., None]).sum(axis=(0, 1)) / max(float(w.sum()), 1e-6)
    return np.asarray(centre, dtype=np.float32)


def _weight(colour: Grid, centre: Grid, weight: Grid) -> Grid:
    """(r, c), 0 to 1: how near colours are to `centre`, on the scale of the nearest third of the face."""
    away = np.abs(colour - centre).max(axis=2)
    scale = max(UNUSUAL, 1.5 * float(np.percentile(away[weight > 0.5 * weight.max()], 30)))
    return np.asarray(np.exp(-0.5 * (away / scale) ** 2), dtype=np.float32)


def push_pull(colour: Grid, weight: Grid) -> Grid:
    """Colours (r, c, 3) with the holes, weight (r, c) = 0, filled smoothly from what surrounds them.

    Gortler et al. 1996: averages over ever larger squares are taken from known cells only, then handed down to the
    unknown ones. Something must be known.
    """
    known = np.clip(weight, 0, 1)[..., None]
    if min(colour.shape[:2]) == 1 and max(colour.shape[:2]) == 1:
        return colour
    size = (-(-colour.shape[1] // 2), -(-colour.shape[0] // 2))
    summed = _halve(np.concatenate([colour * known, known], axis=2))
    coarse = np.asarray(summed[..., :3] / np.maximum(summed[..., 3:], 1e-6), dtype=np.float32)
    below = push_pull(coarse, np.minimum(summed[..., 3] * 4, 1)) if (summed[..., 3] < 0.25).any() else coarse
    wide = cv2.resize(below, (size[0] * 2, size[1] * 2), interpolation=cv2.INTER_LINEAR)
    wide = wide[: colour.shape[0], : colour.shape[1]]
    return np.asarray(colour * known + wide * (1 - known))


def _halve(grid: Grid) -> Grid:
    """Means of 2 x 2 cells; an odd last row or column counts as if there were nothing beyond."""
    even = cv2.copyMakeBorder(grid, 0, grid.shape[0] % 2, 0, grid.shape[1] % 2, cv2.BORDER_CONSTANT)
    half = cv2.resize(even, (even.shape[1] // 2, even.shape[0] // 2), interpolation=cv2.INTER_AREA)
    return np.asarray(half)
