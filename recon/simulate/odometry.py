"""Wheel odometry with a scale error, a constant drift and random errors that grow with the way driven."""

from __future__ import annotations

import numpy as np

from recon.geometry import between2, compose2
from recon.sequence.trajectory import Trajectory
from recon.simulate.drive import Drive
from recon.simulate.plan import PlanOdometry


def simulate_odometry(settings: PlanOdometry, drive: Drive, start: float, rng: np.random.Generator) -> Trajectory:
    """Integrated odometry from [0, 0, 0], on its own clock ticks; time stamps are moved by `start` s.

    A turn on the spot counts as a way of 0.2 m a radian, so that it adds a heading error too.
    """
    period = 1.0 / settings.rate
    times = np.arange(0.0, drive.duration + period, period)
    times = times + rng.uniform(0.0, 0.1 * period, len(times))
    poses = drive.at(times)
    steps = between2(poses[:-1], poses[1:])
    way = np.hypot(steps[:, 0], steps[:, 1])
    root = np.sqrt(way + 0.2 * np.abs(steps[:, 2]))
    steps[:, :2] *= settings.scale
    steps[:, 0] += settings.sigma_distance * np.sqrt(way) * rng.normal(size=len(way))
    steps[:, 2] += np.radians(settings.drift_deg) * way
    steps[:, 2] += np.radians(settings.sigma_heading_deg) * root * rng.normal(size=len(way))
    out = np.zeros((len(times), 3))
    for i, step in enumerate(steps):
        out[i + 1] = compose2(out[i], step)
    return Trajectory(times + start, out)
