"""The grain of a face, for what no image saw of it: smooth colours beside a photograph look wrong."""

from __future__ import annotations

import cv2
import numpy as np

from recon.texture.fill import Grid
from recon.texture.view import Image

PATCH = 48
"""Texels a side of the patches looked at."""
TRIED, LEAST = 400, 8
"""Patches looked at, and how many must have been seen: of fewer, none is typical."""
QUIET = 0.2
"""Of the patches seen, in order of their detail: plain surface, neither a picture nor burnt out."""
COARSEST, WIDTH = 4.0, 1.0
"""Texels, standard deviations: coarser structure is left to the smooth fill; how far grain reaches."""
STRONGEST = 3.0
"""Levels: what varies more has a structure of its own, which noise would only mock."""
SIDE = 256
"""Texels after which it repeats. Noise, not pieces of the picture: their marks would repeat as a wallpaper's do."""


def grain(picture: Image, alpha: Image) -> Grid | None:
    """Noise of brightness (SIDE, SIDE), levels, that repeats in both directions, as strong as in a typical plain patch.

    picture: (H, W, 3); alpha: (H, W), 255 where it was seen. None where too few patches were seen whole.
    """
    rows, columns = picture.shape[0] // PATCH, picture.shape[1] // PATCH
    step = max(int(np.ceil(np.sqrt(rows * columns / TRIED))), 1)
    found = []
    for row in range(0, rows, step):
        for column in range(0, columns, step):
            place = np.s_[row * PATCH : (row + 1) * PATCH, column * PATCH : (column + 1) * PATCH]
            if int(alpha[place].min()) == 255:
                found.append(_deviation(picture[place]))
    if len(found) < LEAST:
        return None
    return min(float(np.quantile(found, QUIET)), STRONGEST) * _noise()


def _noise() -> Grid:
    """(SIDE, SIDE), the same every time, of mean 0 and standard deviation 1."""
    values = np.random.default_rng(0).normal(size=(SIDE, SIDE)).astype(np.float32)
    around = cv2.copyMakeBorder(values, PATCH, PATCH, PATCH, PATCH, cv2.BORDER_WRAP)
    smooth = cv2.GaussianBlur(around, (0, 0), WIDTH)[PATCH:-PATCH, PATCH:-PATCH]
    return np.asarray((smooth - smooth.mean()) / smooth.std(), dtype=np.float32)


def repeated(patch: Grid, rows: slice, columns: slice) -> Grid:
    """The patch at texels of these rows and columns, (rows, columns)."""
    y = np.arange(rows.start, rows.stop) % patch.shape[0]
    x = np.arange(columns.start, columns.stop) % patch.shape[1]
    return np.asarray(patch[np.ix_(y, x)])


def _deviation(patch: Image) -> float:
    """Standard deviation, by the median, of a patch's detail."""
    grey = cv2.cvtColor(patch, cv2.COLOR_BGR2GRAY).astype(np.float32)
    detail = grey - cv2.GaussianBlur(grey, (0, 0), COARSEST, borderType=cv2.BORDER_REFLECT)
    return 1.4826 * float(np.median(np.abs(detail)))
