"""Given odometry: its scale, its noise, and the motions between scans that it measures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from recon.geometry import Array, between2, turned2, wrap_angle
from recon.graph.motion import Motion
from recon.sequence.trajectory import Trajectory

WINDOW = 1.0
"""m of path (turns count too): odometry is compared with the solved trajectory over pieces of this length."""
TURN_EFFORT = 0.5
"""m/rad: a turn on the spot disturbs odometry as much as this way."""
SCALE_SIGMA = 0.1
"""Standard deviation of the scale of odometry before anything is measured."""
MEDIAN = 0.455
"""Of chi-square with one degree of freedom."""
FREEDOM = 4.0
"""Of Student's t, which differences between odometry and the solved trajectory follow."""
LEAST_HEADING = 0.002**2
"""rad^2/m: no odometry is better than this."""
DEFAULT_POSITION, DEFAULT_HEADING = 0.03**2, 0.02**2
"""m^2/m and rad^2/m where there is too little to compare with."""
DEFAULT_JITTER = 0.003**2
"""m^2 (and rad^2 for the heading): variance of every interpolated step, however short."""
RANGE = np.log(100.0)
"""How far from the default a variance may be, as a logarithm: two standard deviations."""
MIN_WINDOWS = 4


@dataclass(frozen=True)
class OdometryModel:
    """Motions between scans from odometry, distances multiplied by `scale` (with its standard deviation).

    relative: (N-1, 3) and covariance: (N-1, 3, 3) as in Motion. inside: (N-1,) bool, whether
    the odometry's time span holds the step.
    """

    scale: float
    scale_sigma: float
    motion: Motion
    inside: Array


def fit_odometry(odometry: Trajectory, solved: Trajectory, motion: Motion) -> OdometryModel:
    """Scale and noise of `odometry` from a trajectory `solved` without it, and the steps that follow.

    Scale and noise alternate: weighted least squares over windows for the one, the likelihood of what remains for the
    other. motion: the scan matches, whose covariance says where `solved` is itself weak.
    """
    at_scans = odometry.at(solved.timestamps)
    steps = between2(at_scans[:-1], at_scans[1:])
    effort = np.hypot(steps[:, 0], steps[:, 1]) + TURN_EFFORT * np.abs(steps[:, 2])
    start, end = solved.timestamps[:-1], solved.timestamps[1:]
    inside = (start >= odometry.timestamps[0] - 0.2) & (end <= odometry.timestamps[-1] + 0.2)
    windows = _windows(effort, inside)
    scale, sigma = 1.0, SCALE_SIGMA
    position, heading, jitter = DEFAULT_POSITION, DEFAULT_HEADING, DEFAULT_JITTER
    if len(windows) >= MIN_WINDOWS:
        first, last = windows[:, 0], windows[:, 1]
        said = between2(at_scans[first], at_scans[last])
        true = between2(solved.poses[first], solved.poses[last])
        way = np.concatenate([[0.0], np.cumsum(effort)])
        spread = _chain(motion, solved.poses, first, last)
        scale, sigma, position, heading = _alternate(said, true, way[last] - way[first], spread)
        known = motion.covariance[inside, :2, :2] + (position * effort[inside])[:, None, None] * np.eye(2)
        rest = between2(solved.poses[:-1], solved.poses[1:])[inside, :2] - scale * steps[inside, :2]
        jitter = _most_probable(rest, known, np.ones(len(rest)), DEFAULT_JITTER)
    return OdometryModel(scale, sigma, _motion(steps, effort, scale, (position, heading, jitter)), inside)


def _windows(effort: Array, inside: Array) -> Array:
    """(W, 2) first and last scan of neighbouring windows, WINDOW metres of effort each, wholly inside."""
    way = np.concatenate([[0.0], np.cumsum(effort)])
    cuts = np.unique(np.searchsorted(way, np.arange(0.0, way[-1] + 1e-9, WINDOW)))
    windows = np.stack([cuts[:-1], cuts[1:]], axis=1)
    whole = [bool(np.all(inside[a:b])) for a, b in windows]
    return windows[np.array(whole, dtype=bool)]


def _chain(motion: Motion, poses: Array, first: Array, last: Array) -> Array:
    """(W, 2, 2) covariance of position over each window from the scan matches, in the frame of its first scan."""
    yaw = poses[:, 2]
    steps = turned2(motion.covariance[:, :2, :2], yaw[:-1])
    total = np.concatenate([np.zeros((1, 2, 2)), np.cumsum(steps, axis=0)])
    return turned2(total[last] - total[first], -yaw[first])


def _alternate(said: Array, true: Array, way: Array, spread: Array) -> tuple[float, float, float, float]:
    """Scale and its sigma, and variance of position (m^2/m) and heading (rad^2/m), from windows said and true."""
    heading = max(LEAST_HEADING, float(np.median(wrap_angle(true[:, 2] - said[:, 2]) ** 2 / way)) / MEDIAN)
    scale, position = 1.0, DEFAULT_POSITION
    for _ in range(10):
        information = np.asarray(np.linalg.inv(spread + (position * way)[:, None, None] * np.eye(2)))
        squared = _squared(true[:, :2] - scale * said[:, :2], information)
        information = information / (1 + squared / FREEDOM)[:, None, None]
        top = np.einsum("wi,wij,wj->", said[:, :2], information, true[:, :2]) + 1 / SCALE_SIGMA**2
        bottom = np.einsum("wi,wij,wj->", said[:, :2], information, said[:, :2]) + 1 / SCALE_SIGMA**2
        scale = float(top / bottom)
        position = _most_probable(true[:, :2] - scale * said[:, :2], spread, way, DEFAULT_POSITION)
    return scale, float(bottom**-0.5), position, heading


def _most_probable(rest: Array, known: Array, way: Array, default: float) -> float:
    """Most probable variance v of differences `rest` (W, 2) with covariances known (W, 2, 2) + v * way (W,).

    Student's t for the differences, a log-normal prior around the default.
    """
    candidates = default * np.exp(np.linspace(-RANGE, RANGE, 41))
    score = -0.5 * (2 * np.linspace(-1.0, 1.0, 41)) ** 2
    for k, candidate in enumerate(candidates):
        total = known + (candidate * way)[:, None, None] * np.eye(2)
        tail = (FREEDOM + 2) * np.log1p(_squared(rest, np.asarray(np.linalg.inv(total))) / FREEDOM)
        score[k] -= 0.5 * float(np.sum(np.log(np.linalg.det(total)) + tail))
    return float(candidates[np.argmax(score)])


def _squared(rest: Array, information: Array) -> Array:
    return np.asarray(np.einsum("wi,wij,wj->w", rest, information, rest))


def _motion(steps: Array, effort: Array, scale: float, variance: tuple[float, float, float]) -> Motion:
    position, heading, jitter = variance
    covariance = np.zeros((len(steps), 3, 3))
    covariance[:, 0, 0] = covariance[:, 1, 1] = position * effort + jitter
    covariance[:, 2, 2] = heading * effort + DEFAULT_JITTER
    return Motion(steps * np.array([scale, scale, 1.0]), covariance)
