"""Extrinsics and the camera's clock together: headings first, then the joint refinement over all wall feet."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from recon.calibration.clock import SYSTEMATIC, UNKNOWN, ClockOffset
from recon.calibration.refine import RIGID_TIMED, refine
from recon.calibration.result import Calibration
from recon.calibration.search import REFINEMENT
from recon.calibration.support import CalibrationFrames
from recon.geometry import Array, Pose3, between2
from recon.sequence.camera import Camera
from recon.sequence.trajectory import Trajectory

MAX_ROUNDS = 4
SETTLED = 0.0005  # s
TWIST_SPAN = 0.1  # s over which the platform's velocity is taken

Solve = Callable[[CalibrationFrames], Calibration | None]


@dataclass(frozen=True)
class Drive:
    """What the clock is judged by. collect(offset): lines and wall feet of the images, stamps moved by `offset` s.

    times: (F,) image stamps. vertical: unit vector (3,) in the camera frame, pointing down, and its sigma (rad).
    tolerance: pixels, of a line from a projected foot.
    """

    collect: Callable[[float], CalibrationFrames]
    times: Array
    trajectory: Trajectory
    camera: Camera
    vertical: tuple[Array, float]
    tolerance: float


def calibrate_with_clock(drive: Drive, solve: Solve, coarse: ClockOffset) -> Calibration | None:
    """What `solve` finds, with the time offset of the images (its sigma inf where nothing tells).

    coarse: from headings; where it is no matter of chance, `solve` gets the images with it. The refinement over wall
    feet follows. An offset that is not significant is reported but not used: the clocks are then taken for one.
    """
    start = coarse.offset if coarse.is_significant else 0.0
    found = solve(drive.collect(start))
    if found is None and start:
        start, coarse = 0.0, UNKNOWN
        found = solve(drive.collect(start))
    if found is None:
        return None
    clock = refine_clock(drive, found.platform_from_camera, start)
    if clock.sigma > coarse.sigma:
        clock = coarse
    if not clock.is_significant:
        if start:
            found = solve(drive.collect(0.0)) or found
        return replace(found, measured_offset=clock.offset, sigma_time_offset=clock.sigma)
    if abs(clock.offset - start) > clock.sigma:
        found = solve(drive.collect(clock.offset)) or found
    return replace(found, time_offset=clock.offset, measured_offset=clock.offset, sigma_time_offset=clock.sigma)


def refine_clock(drive: Drive, pose: Pose3, start: float) -> ClockOffset:
    """The offset, from `start` on, in the joint refinement of pose, foot offset and time over the wall feet."""
    tolerances = tuple(drive.tolerance * t for t in REFINEMENT)
    offset, sigma = start, np.inf
    for _ in range(MAX_ROUNDS):
        frames = drive.collect(offset)
        twists = platform_twists(drive.trajectory, drive.times[frames.images] + offset)
        refined = refine(frames, drive.camera, pose, drive.vertical, tolerances, RIGID_TIMED, None, twists)
        if refined is None:
            return UNKNOWN
        offset, sigma, pose = offset + refined.time_offset, refined.sigma_time, refined.platform_from_camera
        if abs(refined.time_offset) < SETTLED:
            break
    return ClockOffset(offset, float(np.hypot(sigma, SYSTEMATIC)))


def platform_twists(trajectory: Trajectory, times: Array) -> Array:
    """(F, 3) m/s, m/s, rad/s of the platform in its own frame at `times` (F,), s."""
    before, after = trajectory.at(times - TWIST_SPAN / 2), trajectory.at(times + TWIST_SPAN / 2)
    moved = between2(trajectory.at(times), after) - between2(trajectory.at(times), before)
    return np.asarray(moved / TWIST_SPAN)
