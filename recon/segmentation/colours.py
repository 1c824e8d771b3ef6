"""How colours are distributed over things and what is around them."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array

BINS = 24
LIGHTNESS, HUE = 11.0, 5.0
"""Levels of CIE Lab (8 bit) a bin."""
BLUR = 2
"""Rounds of `smooth`: the standard deviation is the root of half of them, in bins."""


def colour_bins(image: NDArray[np.uint8]) -> NDArray[np.int64]:
    """Bin (H, W) of every pixel's colour, image (H, W, 3) BGR."""
    lab = cv2.cvtColor(image, cv2.COLOR_BGR2LAB).astype(np.float32)
    light = (lab[..., 0] / LIGHTNESS).astype(np.int64)
    a, b = (((lab[..., k] - 128) / HUE + BINS / 2).astype(np.int64).clip(0, BINS - 1) for k in (1, 2))
    return np.asarray((light.clip(0, BINS - 1) * BINS + a) * BINS + b)


def density(bins: NDArray[np.int64], weight: Array, unknown: float) -> Array:
    """Density (BINS^3,) of colours with weights, 1 on average; blurred, the share `unknown` spread evenly."""
    from recon.segmentation.kernels import smooth  # numba takes a while to import

    counts = np.bincount(bins.ravel(), weight.ravel(), BINS**3)
    total = float(counts.sum())
    if total <= 0:
        return np.ones(BINS**3)
    grid = smooth(counts.reshape(BINS, BINS, BINS).astype(np.float64), BLUR)
    return np.asarray((1 - unknown) * (BINS**3 / total) * grid.ravel() + unknown)
