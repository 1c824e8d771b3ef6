"""The estimated extrinsics."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from recon.geometry import Array, Pose3

OBSERVED = 0.1
"""s: with a larger standard deviation the drive says nothing of the clock."""


@dataclass(frozen=True)
class Calibration:
    """platform_from_camera with its covariance (6, 6): rotation vector (rad, in the platform frame), translation (m).

    inlier_frames: indices of the images that support it. inlier_fraction: share of ground-wall boundary length that
    the LiDAR explains in them. time_offset: s that were added to image stamps everywhere (0: the clocks agree as far as
    can be seen). measured_offset: s, what the drive says it is, with sigma_time_offset: s, one standard deviation (inf:
    the drive does not tell).
    """

    platform_from_camera: Pose3
    covariance: Array
    source: Literal["estimated", "given"]
    inlier_frames: tuple[int, ...] = ()
    inlier_fraction: float = 0.0
    warnings: tuple[str, ...] = field(default=())
    time_offset: float = 0.0
    measured_offset: float = 0.0
    sigma_time_offset: float = float("inf")

    @property
    def clock(self) -> str:
        """What is known of the camera's clock, in words."""
        if not self.sigma_time_offset < OBSERVED:
            return "The camera clock is taken as the scanner's: the drive hardly turns and does not tell"
        millis, sigma = 1000 * self.measured_offset, 1000 * self.sigma_time_offset
        used = "added to image stamps" if self.time_offset else "no more than chance, not used"
        return f"The camera clock is off by {millis:+.0f} +- {sigma:.0f} ms ({used})"

    def on_scan_clock(self, stamps: Array) -> Array:
        """Image stamps (F,), s, as the scanner's clock would have them."""
        return stamps + self.time_offset
