"""All that was measured, before it is solved for poses and walls."""

from __future__ import annotations

from dataclasses import dataclass

from recon.calibration.result import Calibration
from recon.geometry import Array
from recon.lidar.matching import ScanMatching
from recon.lidar.segment import ScanSegments
from recon.loops.close import ClosedLoops
from recon.vision.frame import FrameLines


@dataclass(frozen=True)
class Views:
    """lines: of every image, None of a corrupt one. vertical: the direction down (3,) in the camera frame that all
    images share, and its standard deviation in rad; None where no image shows any."""

    lines: list[FrameLines | None]
    vertical: tuple[Array, float] | None


@dataclass(frozen=True)
class Observed:
    """matching: odometry from scans. segments: line segments of all scans. calibration: of the camera on the platform,
    None where it was not found. closed: places visited again."""

    matching: ScanMatching
    segments: ScanSegments
    views: Views
    calibration: Calibration | None
    closed: ClosedLoops
