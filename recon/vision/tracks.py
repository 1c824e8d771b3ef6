"""Corners followed from one image to the next (Lucas and Kanade, in pyramids)."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array

MAX_CORNERS = 400
QUALITY = 0.01  # of the best corner's strength
SPACING = 7  # px
WINDOW = (15, 15)
LEVELS = 1
"""Halvings of the image in which a corner is looked for first."""
STOP = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 20, 0.02)
MAX_RETURN = 0.5  # px: how far from its start a corner may come out when followed back


def find_corners(grey: NDArray[np.uint8]) -> Array:
    """Corners (N, 2), px, of a raw image (H, W), strongest first (Shi and Tomasi)."""
    even = cv2.createCLAHE(2.0, (8, 8)).apply(grey)
    found = cv2.goodFeaturesToTrack(even, MAX_CORNERS, QUALITY, SPACING)
    return np.zeros((0, 2)) if found is None else np.asarray(found.reshape(-1, 2), dtype=np.float64)


def follow(
    first: NDArray[np.uint8], second: NDArray[np.uint8], corners: Array, predicted: Array
) -> tuple[Array, NDArray[np.bool_]]:
    """Where corners (N, 2) of the first image are in the second (N, 2), px, and (N,) whether they were followed.

    predicted: (N, 2) px, good to some pixels. A corner counts when following it back leads to where it came from.
    """
    if not len(corners):
        return np.zeros((0, 2)), np.zeros(0, np.bool_)
    there, found = _flow(first, second, corners, predicted)
    back, returned = _flow(second, first, there, corners)
    return there, found & returned & (np.linalg.norm(back - corners, axis=1) < MAX_RETURN)


def _flow(
    first: NDArray[np.uint8], second: NDArray[np.uint8], points: Array, guess: Array
) -> tuple[Array, NDArray[np.bool_]]:
    start, there = (np.array(a, np.float32).reshape(-1, 1, 2) for a in (points, guess))
    flags = cv2.OPTFLOW_USE_INITIAL_FLOW
    there, found, _ = cv2.calcOpticalFlowPyrLK(first, second, start, there, None, None, WINDOW, LEVELS, STOP, flags)
    return np.asarray(there.reshape(-1, 2), dtype=np.float64), np.asarray(found.ravel() == 1)
