"""What a scan or an image says about wall lines."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array


@dataclass(frozen=True)
class WallObservations:
    """K line segments seen from K scan poses.

    pose: (K,) index of the scan whose platform frame the segment is in (an image's is carried to the nearest scan).
    endpoints: (K, 2, 2) m, platform frame, free space (the sensor's side) on the left from first to second.
    covariance: (K, 2, 2) of (offset m, angle rad) at the middle of the segment.
    image: (K,) index of the image it was seen in, -1 for a LiDAR segment.
    """

    pose: NDArray[np.int64]
    endpoints: Array
    covariance: Array
    image: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.pose)

    @staticmethod
    def concatenate(parts: list[WallObservations]) -> WallObservations:
        """One after the other."""
        if len(parts) == 1:
            return parts[0]
        return WallObservations(
            np.concatenate([p.pose for p in parts]),
            np.concatenate([p.endpoints for p in parts]),
            np.concatenate([p.covariance for p in parts]),
            np.concatenate([p.image for p in parts]),
        )
