"""What one image says in lines."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array

VERTICAL, HORIZONTAL_1, HORIZONTAL_2, OUTLIER = 0, 1, 2, -1


@dataclass(frozen=True)
class FrameLines:
    """Line segments and vanishing points of one image.

    endpoints: (L, 2, 2) pixels of the *rectified* (undistorted, same K) image.
    sigmas: (L,) pixels, standard deviation of the fit across the line.
    labels: (L,) VERTICAL, HORIZONTAL_1, HORIZONTAL_2 or OUTLIER: the vanishing point each line belongs to.
    directions: (3, 3) rows are unit vectors in the camera optical frame towards the vertical (pointing DOWN to the
        floor) and the two horizontal vanishing points; nan rows where not found.
    boundary: (B,) indices of ground-wall boundary candidates: not vertical, wholly below the horizon
        (all below the image middle's horizon is unknown when the vertical is).
    """

    endpoints: Array
    sigmas: Array
    labels: NDArray[np.int64]
    directions: Array
    boundary: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.endpoints)

    @property
    def lengths(self) -> Array:
        """(L,) pixels."""
        return np.asarray(np.linalg.norm(self.endpoints[:, 1] - self.endpoints[:, 0], axis=1))
