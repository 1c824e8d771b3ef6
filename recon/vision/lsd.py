"""The line segment detector of von Gioi et al. 2010 (OpenCV's), as an alternative source of edge points."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.vision.edges import EdgeChains

# OpenCV scales the image by 0.8 and its result back without minding that a pixel's centre is half a pixel from its
# corner: the coordinates come out 0.5 / 0.8 - 0.5 px short.
SCALING_SHIFT = 0.125


def lsd_chains(grey: NDArray[np.uint8]) -> EdgeChains:
    """Segments of an image (H, W), each as a chain of points one pixel apart."""
    found = cv2.createLineSegmentDetector(cv2.LSD_REFINE_STD).detect(grey)[0]
    if found is None or len(found) == 0:
        return EdgeChains(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(1, np.int64))
    segments = np.asarray(found, dtype=np.float64).reshape(-1, 2, 2) + SCALING_SHIFT
    step = segments[:, 1] - segments[:, 0]
    lengths = np.linalg.norm(step, axis=1)
    counts = np.maximum(2, np.ceil(lengths).astype(np.int64) + 1)
    starts = np.concatenate([[0], np.cumsum(counts)])
    owner = np.repeat(np.arange(len(counts)), counts)
    share = (np.arange(starts[-1]) - starts[owner]) / (counts[owner] - 1)
    points = segments[owner, 0] + share[:, None] * step[owner]
    unit = step / np.maximum(lengths, 1e-9)[:, None]
    brighter = np.stack([unit[:, 1], -unit[:, 0]], axis=1)  # OpenCV runs with the darker side on the right hand
    return EdgeChains(points, brighter[owner], starts)
