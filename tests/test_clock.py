"""The lag between odometry and scanner: found with a sigma that is honest, and used where the truth is read."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from recon.evaluate.relations import given_odometry, relation_errors
from recon.geometry import Array, between2, compose2
from recon.lidar.clock import OdometryClock, odometry_clock
from recon.sequence.groundtruth import Relations
from recon.sequence.trajectory import Trajectory
from recon.sequence.tum import write_planar


def way(times: Array, seed: int) -> Array:
    """(N, 3) true poses: 0.6 m/s, turning smoothly at random."""
    fine = np.arange(0.0, times[-1] + 1.0, 0.02)
    rng = np.random.default_rng(seed)
    rate = np.convolve(rng.normal(size=len(fine) + 99), np.hanning(100) / 8, mode="valid")
    yaw = np.cumsum(rate) * 0.02
    x, y = np.cumsum(0.6 * np.cos(yaw)) * 0.02, np.cumsum(0.6 * np.sin(yaw)) * 0.02
    return np.column_stack([np.interp(times, fine, c) for c in (x, y, yaw)])


def wheels(times: Array, poses: Array, lag: float, rng: np.random.Generator) -> Trajectory:
    """Odometry that turns 3 % too far, loses 3 degrees a metre and some at random, stamped `lag` s late."""
    steps = between2(poses[:-1], poses[1:])
    distance = np.hypot(steps[:, 0], steps[:, 1])
    steps[:, 2] = 1.03 * steps[:, 2] + 0.05 * distance + 0.005 * np.sqrt(distance) * rng.normal(size=len(steps))
    out = [np.zeros(3)]
    for step in steps:
        out.append(compose2(out[-1], step))
    return Trajectory(times + lag, np.array(out))


def drives(lag: float, seed: int, interval: float) -> tuple[Trajectory, Trajectory]:
    """Poses at scans, 3 mrad off each, and odometry at 5 Hz."""
    rng = np.random.default_rng(seed)
    stamps, ticks = np.arange(2.0, 198.0, interval), np.arange(0.0, 200.0, 0.2)
    poses = way(stamps, seed) + rng.normal(size=(len(stamps), 3)) * [0.01, 0.01, 0.003]
    return Trajectory(stamps, poses), wheels(ticks, way(ticks, seed), lag, rng)


@pytest.mark.parametrize("interval", [0.2, 1.0])
@pytest.mark.parametrize("lag", [-0.21, 0.1])
def test_the_lag_is_found_and_its_sigma_honest(lag: float, interval: float) -> None:
    found = [odometry_clock(*drives(lag, seed, interval)) for seed in range(6)]
    normalised = [(clock.lag - lag) / clock.sigma for clock in found]
    assert 0.2 < np.sqrt(np.mean(np.square(normalised))) < 3.0
    assert max(abs(clock.lag - lag) for clock in found) < 0.02
    assert all(clock.believed == clock.lag for clock in found)


def test_no_lag_is_none() -> None:
    """What is not significant is not used."""
    found = [odometry_clock(*drives(0.0, seed, 1.0)) for seed in range(6)]
    assert sum(clock.believed == 0.0 for clock in found) >= 5
    assert max(abs(clock.lag) for clock in found) < 0.01
    assert OdometryClock(0.1, 0.05).believed == 0.0
    matched, odometry = drives(0.0, 0, 1.0)
    np.testing.assert_array_equal(OdometryClock(0.3, np.inf).on_scan_clock(odometry).timestamps, odometry.timestamps)
    assert len(matched) > 100


def test_a_straight_drive_shows_no_lag() -> None:
    times = np.arange(0.0, 60.0, 0.5)
    straight = np.column_stack([0.5 * times, 0 * times, 1e-4 * np.sin(times)])
    clock = odometry_clock(Trajectory(times, straight), Trajectory(times + 0.2, straight))
    assert (clock.lag, clock.sigma, clock.believed) == (0.0, np.inf, 0.0)


def test_relations_between_scans_are_read_on_the_right_clock(tmp_path: Path) -> None:
    """Scans a second apart, relations between them: read along odometry whose lag is known, they are right."""
    matched, odometry = drives(0.25, 3, 1.0)
    write_planar(tmp_path / "odometry.txt", odometry)
    first = np.arange(10.0, 180.0, 2.37)
    truth = Relations(first, first + 3.3, between2(way(first, 3), way(first + 3.3, 3)))
    moved, clock = given_odometry(tmp_path, matched)
    assert clock is not None and clock.believed == pytest.approx(0.25, abs=0.02)
    right, wrong = (relation_errors(matched, truth, o).rotation.mean for o in (moved, odometry))
    assert right < 0.45  # scans that are off by 3 mrad each, 0.17 deg
    assert wrong > 2 * right
    assert given_odometry(tmp_path / "none", matched) == (None, None)
