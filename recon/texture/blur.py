"""Motion blur and bad focus: how much an image lacks of the detail that pictures of rooms have."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.texture.view import Image

SHARP = -1.5
"""Octaves of energy by which sharp images fall from a quarter of their size to full size, in their worst direction."""
COST = 2.0
"""Octaves of sharpness lost for each octave of energy below that."""
MOST = 30.0
"""Differences of neighbours count up to here, levels: single strong edges do not decide."""
NOISE = 0.5
"""Levels squared: a plain wall without any detail is no blurred one."""


def blur_cost(image: Image) -> float:
    """Octaves of sharpness that an image (H, W, 3) or (H, W) has lost, 0 for a sharp one.

    Blur takes fine differences and leaves coarse ones; motion takes them in one direction only, so that the worst of
    four directions decides. Measured on the image itself, it needs no other one to compare with.
    """
    grey = image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
    fine = grey.astype(np.float32)
    coarse = cv2.resize(fine, (grey.shape[1] // 4, grey.shape[0] // 4), interpolation=cv2.INTER_AREA)
    fall = np.log2(_energies(fine)) - np.log2(_energies(np.asarray(coarse, np.float32)))
    return COST * max(0.0, SHARP - float(fall.min()))


def _energies(grey: NDArray[np.float32]) -> NDArray[np.float64]:
    """Mean squared differences (4,) of neighbours to the right, below, and along both diagonals, per pixel squared."""
    here, right, below, across = grey[:-1, :-1], grey[:-1, 1:], grey[1:, :-1], grey[1:, 1:]
    pairs = ((right, here, 1.0), (below, here, 1.0), (across, here, 2.0), (right, below, 2.0))
    limited = [cv2.min(cv2.absdiff(a, b), MOST) for a, b, _ in pairs]
    sums = [cv2.norm(d, cv2.NORM_L2SQR) / d.size / p[2] + NOISE for d, p in zip(limited, pairs, strict=True)]
    return np.array(sums)
