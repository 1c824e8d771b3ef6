"""The fine structure of a face, for what no image saw of it: smooth colours beside a photograph look wrong."""

from __future__ import annotations

import cv2
import numpy as np

from recon.texture.fill import Grid
from recon.texture.view import Image

PATCH = 48
"""Texels a side of the patch that is repeated, mirrored so that it has no edges."""
TRIED = 400
QUIET = 0.2
"""Of the patches seen, in order of their detail: plain surface, neither a picture nor burnt out."""
LEAST = 8
"""Patches seen: of fewer, none is typical."""
STRONGEST = 3.0
"""Standard deviations (by the median): single marks are cut off there, they would show as a pattern."""
COARSEST = 4.0
"""Texels: coarser structure than this standard deviation is left to the smooth fill."""


def grain(picture: Image, alpha: Image) -> Grid | None:
    """Differences of brightness (2 PATCH, 2 PATCH), levels, that repeat in both directions, of a typical plain patch.

    picture: (H, W, 3); alpha: (H, W), 255 where it was seen. None where too few patches were seen whole.
    """
    rows, columns = picture.shape[0] // PATCH, picture.shape[1] // PATCH
    step = max(int(np.ceil(np.sqrt(rows * columns / TRIED))), 1)
    found: list[tuple[float, int, Grid]] = []
    for row in range(0, rows, step):
        for column in range(0, columns, step):
            place = np.s_[row * PATCH : (row + 1) * PATCH, column * PATCH : (column + 1) * PATCH]
            if int(alpha[place].min()) == 255:
                detail = _detail(picture[place])
                found.append((float(np.mean(detail**2)), len(found), detail))
    if len(found) < LEAST:
        return None
    chosen = sorted(found, key=lambda item: item[:2])[int(QUIET * len(found))][2]
    return np.block([[chosen, chosen[:, ::-1]], [chosen[::-1], chosen[::-1, ::-1]]])


def repeated(patch: Grid, rows: slice, columns: slice) -> Grid:
    """The patch at texels of these rows and columns, (rows, columns)."""
    y = np.arange(rows.start, rows.stop) % patch.shape[0]
    x = np.arange(columns.start, columns.stop) % patch.shape[1]
    return np.asarray(patch[np.ix_(y, x)])


def _detail(patch: Image) -> Grid:
    grey = cv2.cvtColor(patch, cv2.COLOR_BGR2GRAY).astype(np.float32)
    detail = grey - cv2.GaussianBlur(grey, (0, 0), COARSEST, borderType=cv2.BORDER_REFLECT)
    limit = max(STRONGEST * 1.4826 * float(np.median(np.abs(detail))), 1.0)
    return np.asarray(np.clip(detail, -limit, limit))
