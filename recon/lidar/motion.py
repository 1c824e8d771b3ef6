"""How the platform is expected to move from one scan to the next, before the scan is looked at."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from recon.geometry import Array, between2, wrap_angle
from recon.sequence.trajectory import Trajectory

ODOMETRY_LAG = 0.1
"""s: clocks of odometry and scanner may differ by this much."""
ODOMETRY_FLOOR = (0.005, 0.004)
"""m, rad: noise of any odometry increment."""
ODOMETRY_SLIP = (0.05, 0.05)
"""Errors in proportion: m a metre, rad a radian."""
ODOMETRY_DRIFT = 0.02
"""rad a metre: heading lost while driving straight."""
MAX_HOLE = 1.0
"""s: a longer hole in the odometry is no odometry."""
ACCELERATION = (0.03, 0.5, 0.05, 0.8)
"""Without odometry: m, and m a second, rad, and rad a second, that velocity may change from scan to scan."""
MAX_COAST = 1.0
"""s: velocity is not carried on for longer."""
MAX_SIGMA = (1.0, 1.0)
"""m, rad: no prior is weaker (ground robots and people stay slow indoors)."""


@dataclass(frozen=True)
class Motion:
    """A relative motion [x, y, yaw] in the frame of the earlier pose with standard deviations, both (3,)."""

    mean: Array
    sigma: Array
    from_odometry: bool


def predict(odometry: Trajectory | None, start: float, end: float, velocity: Array) -> Motion:
    """The motion from time `start` to `end` (s): odometry where it covers both, else constant velocity (3,)."""
    if odometry is not None and _covers(odometry, start, end):
        return _from_odometry(odometry, start, end)
    coast = min(end - start, MAX_COAST)
    sigma_xy = min(ACCELERATION[0] + ACCELERATION[1] * (end - start), MAX_SIGMA[0])
    sigma_yaw = min(ACCELERATION[2] + ACCELERATION[3] * (end - start), MAX_SIGMA[1])
    return Motion(velocity * coast, np.array([sigma_xy, sigma_xy, sigma_yaw]), False)


def _covers(odometry: Trajectory, start: float, end: float) -> bool:
    t = odometry.timestamps
    if len(t) < 2 or start < t[0] - ODOMETRY_LAG or end > t[-1] + ODOMETRY_LAG:
        return False
    first, last = np.searchsorted(t, start, side="right") - 1, np.searchsorted(t, end)
    return bool(np.diff(t[max(first, 0) : last + 1]).max(initial=0.0) <= max(MAX_HOLE, end - start))


def _from_odometry(odometry: Trajectory, start: float, end: float) -> Motion:
    lags = np.array([0.0, -ODOMETRY_LAG, ODOMETRY_LAG])
    motions = between2(odometry.at(start + lags), odometry.at(end + lags))
    mean, lagged = motions[0], motions[1:] - motions[0]
    lagged[:, 2] = wrap_angle(lagged[:, 2])
    # what a lag would change: nothing while moving evenly, most where a turn begins
    lag = np.abs(lagged).max(axis=0)
    distance, turn = float(np.hypot(mean[0], mean[1])), abs(float(mean[2]))
    slip = ODOMETRY_FLOOR[0] + ODOMETRY_SLIP[0] * distance
    twist = ODOMETRY_FLOOR[1] + ODOMETRY_SLIP[1] * turn + ODOMETRY_DRIFT * distance
    return Motion(mean, np.hypot(np.array([slip, slip, twist]), lag), True)
