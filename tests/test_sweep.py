"""Drivers that list a scanner's beams against the order in which they were taken."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from recon.config import LidarConfig
from recon.evaluate.trajectory import trajectory_errors
from recon.lidar.matching import match_scans
from recon.lidar.sweep import Order, match_in_order, reordered, sweep_order
from recon.sequence.sequence import Scans
from recon.sequence.trajectory import Trajectory
from recon.simulate import random_plan, simulate_scans

CONFIG = LidarConfig()


def turning_scanner(seed: int, scan_time: float) -> tuple[Scans, Trajectory]:
    plan = random_plan(seed, rooms=2, angles="any")
    scans, truth, _ = simulate_scans(replace(plan, lidar=replace(plan.lidar, scan_time=scan_time)), seed)
    return scans, truth


def found_order(scans: Scans) -> Order:
    return sweep_order(scans, match_scans(scans, None, CONFIG), CONFIG)


@pytest.mark.parametrize("seed", [5])
def test_the_order_is_found_and_put_right(seed: int) -> None:
    """Without odometry; put right, the trajectory is as good as that of scans that were right from the start."""
    scans, truth = turning_scanner(seed, 0.1)
    assert found_order(scans) == "as given"
    wrong = reordered(scans, "backwards")
    assert found_order(wrong) == "backwards"
    errors = [
        trajectory_errors(match_scans(s, None, CONFIG).trajectory, truth)
        for s in (scans, wrong, reordered(wrong, "backwards"))
    ]
    assert errors[1].ate > 2 * errors[0].ate
    assert errors[2].ate == pytest.approx(errors[0].ate, rel=1e-6)


def test_scans_without_distortion_are_told() -> None:
    """A driver that took the distortion out and left `time_increment` in."""
    scans, _ = turning_scanner(6, 0.0)
    assert found_order(scans) == "as given"
    assert found_order(replace(scans, time_increment=0.1 / scans.ranges.shape[1])) == "at once"


def test_a_platform_that_stands_tells_nothing() -> None:
    scans, _ = turning_scanner(3, 0.1)
    first = replace(scans, timestamps=scans.timestamps[:10], ranges=np.repeat(scans.ranges[:1], 10, axis=0))
    assert found_order(reordered(first, "backwards")) == "as given"


def test_beams_keep_their_bearings() -> None:
    scans, _ = turning_scanner(5, 0.1)
    scans = replace(scans, intensities=scans.ranges * 2)
    other = reordered(scans, "backwards")
    assert other.intensities is not None
    np.testing.assert_array_equal(other.intensities, other.ranges * 2)
    np.testing.assert_allclose(other.points(7)[::-1], scans.points(7), atol=1e-9)
    assert reordered(scans, "at once").time_increment == 0.0
    twice = reordered(other, "backwards")
    np.testing.assert_array_equal(twice.ranges, scans.ranges)
    assert twice.angle_min == pytest.approx(scans.angle_min)


def test_a_turning_mirror_that_the_log_does_not_tell_of() -> None:
    """No `time_increment`: scans taken in turn, from either end, are told from scans taken at once."""
    plan = random_plan(5, rooms=2, angles="any")
    sweep = plan.lidar.fov_deg / 360 / plan.lidar.rate
    scans, truth = turning_scanner(5, sweep)
    silent = replace(scans, time_increment=0.0)
    assert found_order(silent) == "in turn"
    assert found_order(reordered(silent, "backwards")) == "in turn, backwards"
    warnings: list[str] = []
    found, matching = match_in_order(silent, None, CONFIG, warnings)
    assert found.time_increment == pytest.approx(scans.time_increment, rel=0.02)
    assert warnings == ["by the map that they make, the beams of a scan were taken in turn"]
    unaware = match_scans(silent, None, CONFIG)
    errors = [trajectory_errors(m.trajectory, truth).ate for m in (matching, unaware)]
    assert errors[0] < 0.5 * errors[1]
