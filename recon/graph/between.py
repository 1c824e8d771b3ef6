"""Where the platform was between two scans: along the odometry and smoothly, each as far as it can be trusted."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array, between2, compose2, wrap_angle
from recon.graph.odometry import DEFAULT_HEADING, DEFAULT_POSITION, MEDIAN, TURN_EFFORT
from recon.sequence.trajectory import Trajectory

AT_END = 1e-3
"""s: odometry that ends so little before a time still covers it."""
LEAST_EFFORT = 0.005
"""m: steps with less way (and turn) say nothing of the odometry's noise."""
MIN_STEPS = 10
FLOOR = (0.0005, np.radians(0.01))
"""m, rad: no pose between scans is better known than this."""
SPREAD = 3**-0.5
"""Standard deviation of errors that lie evenly within a bound of 1."""


@dataclass(frozen=True)
class Between:
    """Poses (M, 3) at the times asked for; sigmas (M, 2), m and rad: what being between scans adds to the errors of
    the poses at the scans."""

    poses: Array
    sigmas: Array


def poses_between(trajectory: Trajectory, times: Array, odometry: Trajectory | None = None) -> Between:
    """The platform at `times` (M,), s, from its poses at the scans and the odometry, on the scanner's clock.

    A smooth curve through the poses (cubic Hermite, central differences) is wrong where the motion changes, by no more
    than the second differences tell; the odometry, what it misses the next pose by being spread evenly, is wrong by its
    noise over the gap (a Brownian bridge). The mean of both is taken, weighted with the inverse squares. Beyond the
    ends: along the odometry; held without.
    """
    smooth, loose = _smooth(trajectory, times), np.hypot(_bends(trajectory, times), FLOOR)
    if odometry is None or len(trajectory) < 2 or len(odometry) < 2:
        return Between(smooth, SPREAD * loose)
    along, covered = along_odometry(trajectory, times, odometry)
    noise = np.where(covered[:, None], _noise(trajectory, times, odometry), np.inf)
    away = np.where(covered[:, None], along - smooth, 0.0)
    away[:, 2] = wrap_angle(away[:, 2])
    share = loose**2 / (loose**2 + noise**2)
    poses = smooth + share[:, [0, 0, 1]] * away
    poses[:, 2] = wrap_angle(poses[:, 2])
    return Between(poses, SPREAD * (loose**-2 + noise**-2) ** -0.5)


def along_odometry(trajectory: Trajectory, times: Array, odometry: Trajectory) -> tuple[Array, NDArray[np.bool_]]:
    """Poses (M, 3) at `times` along the odometry, and whether it covers them (M,).

    What it misses the later scan's pose by is spread evenly over the gap. trajectory, odometry: two poses or more.
    """
    before = _before(trajectory, times)
    start, end = trajectory.timestamps[before], trajectory.timestamps[before + 1]
    there = odometry.at(times)
    forward = compose2(trajectory.poses[before], between2(odometry.at(start), there))
    backward = compose2(trajectory.poses[before + 1], between2(odometry.at(end), there))
    miss = backward - forward
    miss[:, 2] = wrap_angle(miss[:, 2])
    along = forward + _part(trajectory, times, before)[:, None] * miss
    along[:, 2] = wrap_angle(along[:, 2])
    first, last = np.minimum(times, start), np.maximum(times, end)
    covered = (first >= odometry.timestamps[0] - AT_END) & (last <= odometry.timestamps[-1] + AT_END)
    return along, covered


def _smooth(trajectory: Trajectory, times: Array) -> Array:
    if len(trajectory) < 2:
        return trajectory.at(times)
    from scipy.interpolate import CubicHermiteSpline

    stamps, poses = trajectory.timestamps, _unwound(trajectory)
    curve = CubicHermiteSpline(stamps, poses, np.gradient(poses, stamps, axis=0))
    out = np.asarray(curve(np.clip(times, stamps[0], stamps[-1])), dtype=np.float64)
    out[:, 2] = wrap_angle(out[:, 2])
    return out


def _bends(trajectory: Trajectory, times: Array) -> Array:
    """(M, 2) m, rad: how far the way between two poses may lie from a line or curve through them.

    A velocity that changes by v somewhere in a gap of h seconds makes second differences of h v at its ends, and moves
    the pose at part u of the gap by at most u (1 - u) h v. Beyond the ends, the way that the last velocity makes.
    """
    if len(trajectory) < 2:
        return np.zeros((len(times), 2))
    stamps = trajectory.timestamps
    gap = np.diff(stamps)
    velocity = np.diff(_unwound(trajectory), axis=0) / gap[:, None]
    change = np.zeros((len(stamps), 2))
    change[1:-1] = _sizes(np.diff(velocity, axis=0))
    before = _before(trajectory, times)
    part = _part(trajectory, times, before)
    bend = (gap[before] * part * (1 - part))[:, None] * (change[before] + change[before + 1])
    beyond = np.maximum(stamps[0] - times, 0.0) + np.maximum(times - stamps[-1], 0.0)
    return np.asarray(bend + beyond[:, None] * _sizes(velocity)[before] / SPREAD)


def _noise(trajectory: Trajectory, times: Array, odometry: Trajectory) -> Array:
    """(M, 2) m, rad: errors of poses along the odometry, whose noise is that with which it misses the scans' poses."""
    at_scans = odometry.at(trajectory.timestamps)
    steps = between2(at_scans[:-1], at_scans[1:])
    miss = between2(trajectory.poses[:-1], trajectory.poses[1:]) - steps
    miss[:, 2] = wrap_angle(miss[:, 2])
    squared = _sizes(miss) ** 2
    effort = np.hypot(steps[:, 0], steps[:, 1]) + TURN_EFFORT * np.abs(steps[:, 2])
    moving = effort > LEAST_EFFORT
    rate = np.array([DEFAULT_POSITION, DEFAULT_HEADING])
    if moving.sum() >= MIN_STEPS:
        rate = np.median(squared[moving] / effort[moving, None], axis=0) / MEDIAN
    before = _before(trajectory, times)
    part = _part(trajectory, times, before)
    bridge = np.maximum(rate * effort[before, None], squared[before]) * (part * (1 - part))[:, None]
    outside = (times < trajectory.timestamps[0]) | (times > trajectory.timestamps[-1])
    bridge += np.where(outside[:, None], rate * effort[before, None], 0.0)
    return np.sqrt(bridge + _bends(odometry, times) ** 2 + np.square(FLOOR))


def _before(trajectory: Trajectory, times: Array) -> NDArray[np.int64]:
    """(M,) index of the pose at which the gap begins that holds each of `times`; the first or last gap outside."""
    found = np.searchsorted(trajectory.timestamps, times, side="right") - 1
    return np.asarray(np.clip(found, 0, len(trajectory) - 2), dtype=np.int64)


def _part(trajectory: Trajectory, times: Array, before: NDArray[np.int64]) -> Array:
    start, end = trajectory.timestamps[before], trajectory.timestamps[before + 1]
    return np.clip((times - start) / (end - start), 0.0, 1.0)


def _sizes(motions: Array) -> Array:
    """(N, 2): how far motions (N, 3) go and turn."""
    return np.column_stack([np.hypot(motions[:, 0], motions[:, 1]), np.abs(motions[:, 2])])


def _unwound(trajectory: Trajectory) -> Array:
    return np.column_stack([trajectory.poses[:, :2], np.unwrap(trajectory.poses[:, 2])])
