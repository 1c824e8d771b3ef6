"""The lag between the clocks of odometry and scanner."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from recon.geometry import Array, between2, wrap_angle
from recon.sequence.trajectory import Trajectory

LARGEST = 0.5
"""s"""
STEP = 0.05
"""s between the lags tried."""
LONGEST = 3.0
"""s: scans farther apart are not compared, much may have happened between them."""
MIN_TURNING = 1.0
"""rad: with less turning in all, nothing is concluded."""
SLIPPED = 0.5
"""rad: odometry that differs by more has slipped."""
ROBUST = 2.0
"""Differences beyond so many standard deviations lose their hold."""
SIGNIFICANT = 3.0
"""Standard deviations from which a lag is believed."""
ROUNDS = 10
"""Of reweighting."""


@dataclass(frozen=True)
class OdometryClock:
    """lag: s by which the odometry runs behind the scans, its pose of time t is stamped t + lag; sigma: s.

    sigma is infinite where there are too few turns to tell.
    """

    lag: float
    sigma: float

    @property
    def believed(self) -> float:
        """The lag, s, where it is significant, else 0."""
        return self.lag if abs(self.lag) > SIGNIFICANT * self.sigma else 0.0

    def on_scan_clock(self, odometry: Trajectory) -> Trajectory:
        """The odometry with the scanner's stamps."""
        return Trajectory(odometry.timestamps - self.believed, odometry.poses)


def odometry_clock(matched: Trajectory, odometry: Trajectory) -> OdometryClock:
    """The lag of `odometry` at which its turns agree best with those of `matched`, poses at the scans.

    Whatever else odometry gets wrong of a turn in proportion to the turn, the way or the time is estimated beside it:
    least squares, reweighted with Cauchy's loss, first at lags STEP apart, then with the lag as an unknown.
    """
    times = matched.timestamps
    start, end = odometry.timestamps[0] + LARGEST, odometry.timestamps[-1] - LARGEST
    usable = (times[:-1] >= start) & (times[1:] <= end) & (np.diff(times) <= LONGEST)
    steps = between2(matched.poses[:-1], matched.poses[1:])[usable, 2]
    spans = np.stack([times[:-1][usable], times[1:][usable]], axis=1)
    if len(steps) <= 4 or np.abs(steps).sum() < MIN_TURNING:
        return OdometryClock(0.0, np.inf)
    lags = np.arange(-round(LARGEST / STEP), round(LARGEST / STEP) + 1) * STEP
    misses = []
    for candidate in lags:
        motion = _motion(odometry, spans + candidate)
        misses.append(_fit(wrap_angle(steps - motion[:, 2]), _causes(motion, spans))[2])
    best = int(np.argmin(misses))
    if not 0 < best < len(lags) - 1:
        return OdometryClock(0.0, np.inf)
    lag, sigma = float(lags[best]), np.inf
    for _ in range(3):
        motion = _motion(odometry, spans + lag)
        later, earlier = _motion(odometry, spans + lag + STEP / 2), _motion(odometry, spans + lag - STEP / 2)
        rate = wrap_angle(later[:, 2] - earlier[:, 2]) / STEP
        causes = np.column_stack([_causes(motion, spans), rate])
        found, deviation, _ = _fit(wrap_angle(steps - motion[:, 2]), causes)
        lag, sigma = lag + float(np.clip(found[-1], -STEP, STEP)), float(deviation[-1])
    return OdometryClock(lag, sigma)


def _motion(odometry: Trajectory, spans: Array) -> Array:
    """(n, 3) motions of the odometry over spans (n, 2) of time."""
    return between2(odometry.at(spans[:, 0]), odometry.at(spans[:, 1]))


def _causes(motion: Array, spans: Array) -> Array:
    """(n, 3): turn, way and time."""
    return np.stack([motion[:, 2], np.hypot(motion[:, 0], motion[:, 1]), spans[:, 1] - spans[:, 0]], axis=1)


def _fit(difference: Array, causes: Array) -> tuple[Array, Array, float]:
    """Coefficients of the causes (n, k), their standard deviations, and the mean absolute rest, rad."""
    alike = np.abs(difference) < SLIPPED
    y, a = difference[alike], causes[alike]
    weight = np.ones(len(y))
    scale = 1.0
    found: Array = np.zeros(a.shape[1])
    inverse: Array = np.eye(a.shape[1])
    for _ in range(ROUNDS):
        inverse = np.asarray(np.linalg.pinv((a.T * weight) @ a))
        found = inverse @ (a.T @ (weight * y))
        rest = y - a @ found
        scale = max(1.4826 * float(np.median(np.abs(rest))), 1e-9)
        weight = 1.0 / (1.0 + (rest / (ROBUST * scale)) ** 2)
    return found, scale * np.sqrt(np.diag(inverse)), float(np.mean(np.abs(rest)))
