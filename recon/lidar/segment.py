"""Line segments of one scan."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array


@dataclass(frozen=True)
class Segments:
    """M line segments of one scan in the platform frame.

    endpoints: (M, 2, 2) m; walking from the first to the second end the scanner is on the left.
    covariance: (M, 2, 2) of (offset m, angle rad) of the line at the middle of the segment.
    counts: (M,) points behind each. beams: (M, 2) first and last beam (inclusive; the first is the larger one where a
    segment crosses the seam of a full-circle scanner).
    """

    endpoints: Array
    covariance: Array
    counts: NDArray[np.int64]
    beams: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.endpoints)

    @property
    def midpoints(self) -> Array:
        """(M, 2) m."""
        return np.asarray(self.endpoints.mean(axis=1))

    @property
    def lengths(self) -> Array:
        """(M,) m."""
        return np.asarray(np.linalg.norm(self.endpoints[:, 1] - self.endpoints[:, 0], axis=1))

    @property
    def angles(self) -> Array:
        """(M,) rad, direction from the first to the second end."""
        d = self.endpoints[:, 1] - self.endpoints[:, 0]
        return np.asarray(np.arctan2(d[:, 1], d[:, 0]))
