"""The lag between the clocks of odometry and scanner."""

from __future__ import annotations

import numpy as np

from recon.geometry import Array, between2, wrap_angle
from recon.sequence.trajectory import Trajectory

LARGEST = 0.5
"""s"""
STEP = 0.05
"""s between the lags tried."""
MIN_TURNING = 1.0
"""rad: with less turning in all, nothing is concluded."""
MIN_GAIN = 0.15
"""Part of the disagreement that a lag must explain to be believed."""


def odometry_lag(matched: Trajectory, odometry: Trajectory) -> float:
    """Seconds by which the odometry runs behind the scans: its pose of time t is stamped t + lag.

    matched: the scans' trajectory, found without odometry. The lag is the one at which the turns of both agree best;
    0 where there are too few turns to tell or no lag explains them much better than none.
    """
    steps = between2(matched.poses[:-1], matched.poses[1:])[:, 2]
    inside = (matched.timestamps[:-1] >= odometry.timestamps[0]) & (matched.timestamps[1:] <= odometry.timestamps[-1])
    if np.abs(steps[inside]).sum() < MIN_TURNING:
        return 0.0
    lags = np.arange(-round(LARGEST / STEP), round(LARGEST / STEP) + 1) * STEP
    misses = np.array([_miss(matched.timestamps, steps, odometry, lag)[inside].mean() for lag in lags])
    best = int(np.argmin(misses))
    if misses[best] > (1.0 - MIN_GAIN) * misses[len(lags) // 2]:
        return 0.0
    if not 0 < best < len(lags) - 1:
        return float(lags[best])
    # the mean absolute difference falls and rises straight on either side of the true lag
    below, least, above = misses[best - 1 : best + 2]
    offset = 0.5 * (below - above) / max(below - least, above - least, 1e-12)
    return float(lags[best] + STEP * offset)


def _miss(times: Array, steps: Array, odometry: Trajectory, lag: float) -> Array:
    """(N-1,) rad, absolute differences of the turns when the odometry is read `lag` s later."""
    turns = between2(odometry.at(times[:-1] + lag), odometry.at(times[1:] + lag))[:, 2]
    return np.abs(wrap_angle(steps - turns))
