"""How the platform is expected to move from one scan to the next, before the scan is looked at."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from recon.geometry import Array, between2, wrap_angle
from recon.sequence.sequence import Scans
from recon.sequence.trajectory import Trajectory

ODOMETRY_LAG = 0.1
"""s: clocks of odometry and scanner may differ by this much."""
ODOMETRY_FLOOR = (0.005, 0.004)
"""m, rad: noise of any odometry increment, before its quality is known."""
ODOMETRY_SLIP = (0.05, 0.05)
"""m a metre, rad a radian."""
ODOMETRY_DRIFT = 0.02
"""rad a metre: heading lost while driving straight."""
MAX_HOLE = 1.0
"""s: a longer hole in the odometry is no odometry."""
ACCELERATION = (0.03, 0.5, 0.05, 0.8)
"""Without odometry: m, and m a second, rad, and rad a second, that a motion may differ from the last one."""
MAX_COAST = 1.0
"""s: velocity is not carried on for longer."""
MAX_SIGMA = (1.0, 1.0)
"""m, rad: no prediction is taken to be worse (people and ground robots are slow indoors)."""


@dataclass(frozen=True)
class Motion:
    """A relative motion [x, y, yaw] in the frame of the earlier pose with standard deviations, both (3,).

    lag: (3,) the part of the deviations that a lag of the odometry makes; the rest scales with its quality.
    """

    mean: Array
    sigma: Array
    lag: Array
    from_odometry: bool


def predict(odometry: Trajectory | None, start: float, end: float, velocity: Array) -> Motion:
    """The motion from time `start` to `end` (s): odometry where it covers both, else constant velocity (3,)."""
    if odometry is not None and _covers(odometry, start, end):
        return _from_odometry(odometry, start, end)
    elapsed = end - start
    sigma_xy = min(ACCELERATION[0] + ACCELERATION[1] * elapsed, MAX_SIGMA[0])
    sigma_yaw = min(ACCELERATION[2] + ACCELERATION[3] * elapsed, MAX_SIGMA[1])
    sigma = np.array([sigma_xy, sigma_xy, sigma_yaw])
    return Motion(velocity * min(elapsed, MAX_COAST), sigma, np.zeros(3), False)


def _covers(odometry: Trajectory, start: float, end: float) -> bool:
    t = odometry.timestamps
    if len(t) < 2 or start < t[0] - ODOMETRY_LAG or end > t[-1] + ODOMETRY_LAG:
        return False
    first, last = np.searchsorted(t, start, side="right") - 1, np.searchsorted(t, end)
    return bool(np.diff(t[max(int(first), 0) : int(last) + 1]).max(initial=0.0) <= max(MAX_HOLE, end - start))


def _from_odometry(odometry: Trajectory, start: float, end: float) -> Motion:
    lags = np.array([0.0, -ODOMETRY_LAG, ODOMETRY_LAG])
    motions = between2(odometry.at(start + lags), odometry.at(end + lags))
    mean, lagged = motions[0], motions[1:] - motions[0]
    lagged[:, 2] = wrap_angle(lagged[:, 2])
    # what a lag would change: nothing while moving evenly, most where a turn begins
    lag = 0.5 * np.abs(lagged).max(axis=0)
    distance, turn = float(np.hypot(mean[0], mean[1])), abs(float(mean[2]))
    slip = ODOMETRY_FLOOR[0] + ODOMETRY_SLIP[0] * distance
    twist = ODOMETRY_FLOOR[1] + ODOMETRY_SLIP[1] * turn + ODOMETRY_DRIFT * distance
    return Motion(mean, np.array([slip, slip, twist]), lag, True)


def scan_velocities(scans: Scans, trajectory: Trajectory) -> Array:
    """(N, 3) m/s, m/s, rad/s in the platform frame: the velocity in the middle of each scan, by the trajectory.

    Smoothed over three steps: an error of one pose would otherwise come back, larger, through the distortion that is
    taken out of its scan.
    """
    if len(scans) < 2:
        return np.zeros((len(scans), 3))
    times, poses = scans.timestamps, trajectory.at(scans.timestamps)
    rates = between2(poses[:-1], poses[1:]) / np.diff(times)[:, None]
    padded = np.concatenate([rates[:1], rates, rates[-1:]])
    smooth = 0.25 * padded[:-2] + 0.5 * padded[1:-1] + 0.25 * padded[2:]
    middle = times + 0.5 * scans.time_increment * scans.ranges.shape[1]
    return np.stack([np.interp(middle, 0.5 * (times[:-1] + times[1:]), smooth[:, c]) for c in range(3)], axis=1)


class OdometryQuality:
    """How far this odometry is really off, in units of what is first assumed, learnt from the scans along the way.

    One factor for distances and one for turns: wheels on carpet lose heading at every turn, a gyro hardly ever.
    """

    WINDOW = 100
    """Motions that are remembered."""
    LEAST = 10
    """Motions before anything is concluded."""
    RANGE = (0.15, 4.0)
    """Smallest and largest factor."""
    MEDIAN = 0.455
    """Median of chi-square with one degree of freedom."""

    def __init__(self) -> None:
        self._squares: tuple[list[float], list[float]] = ([], [])
        self._factors = np.ones(3)

    def sigma(self, motion: Motion) -> Array:
        """(3,) standard deviations of a motion, m, m, rad."""
        return np.hypot(motion.sigma * self._factors, motion.lag) if motion.from_odometry else motion.sigma

    def learn(self, motion: Motion, difference: Array, covariance: Array) -> None:
        """Takes note of `difference` (3,), what the scans alone say minus the motion, with its covariance (3, 3)."""
        if not motion.from_odometry:
            return
        for c in range(3):
            # excess of the difference over what scans and lag explain; only where the scans know better
            explained = covariance[c, c] + motion.lag[c] ** 2
            if explained < motion.sigma[c] ** 2:
                excess = (difference[c] ** 2 / self.MEDIAN - explained) / motion.sigma[c] ** 2
                self._squares[c // 2].append(float(excess))
        for kind, squares in enumerate(self._squares):
            if len(squares) >= self.LEAST:
                factor = np.sqrt(max(0.0, float(np.median(squares[-self.WINDOW :]))))
                self._factors[2 * kind : 2 * kind + 2] = np.clip(factor, *self.RANGE)
        self._factors[1] = self._factors[0]
