"""The estimated extrinsics."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from recon.geometry import Array, Pose3


@dataclass(frozen=True)
class Calibration:
    """platform_from_camera with its covariance (6, 6): rotation vector (rad, in the platform frame), translation (m).

    inlier_frames: indices of the images that support it. inlier_fraction: share of ground-wall boundary length that
    the LiDAR explains in them.
    """

    platform_from_camera: Pose3
    covariance: Array
    source: Literal["estimated", "given"]
    inlier_frames: tuple[int, ...] = ()
    inlier_fraction: float = 0.0
    warnings: tuple[str, ...] = field(default=())
