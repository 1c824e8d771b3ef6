from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recon.geometry import Array, between2, compose2, wrap_angle
from recon.graph.between import poses_between
from recon.sequence.trajectory import Trajectory

SCANS = np.arange(0.0, 20.0, 0.125)


def drive(times: Array) -> Array:
    """Straight at 0.6 m/s, every 2 s a turn on the spot of a quarter in 1.1 s: motion that begins and ends at once."""
    part = times % 3.1
    turned = (times // 3.1) * np.pi / 2 + np.clip((part - 2.0) / 1.1, 0.0, 1.0) * np.pi / 2
    out = np.zeros((len(times), 3))
    for leg in range(8):
        way = 0.6 * np.clip(times - 3.1 * leg, 0.0, 2.0)
        out[:, 0] += way * np.cos(leg * np.pi / 2)
        out[:, 1] += way * np.sin(leg * np.pi / 2)
    out[:, 2] = wrap_angle(turned)
    return out


def wheels(times: Array, noise: float, seed: int = 0) -> Trajectory:
    """Odometry of the drive with a wrong scale, and noise (m and rad in a root metre)."""
    rng = np.random.default_rng(seed)
    steps = between2(drive(times[:-1]), drive(times[1:]))
    root = np.sqrt(np.hypot(steps[:, 0], steps[:, 1]) + 0.2 * np.abs(steps[:, 2]))
    steps = steps * [1.03, 1.03, 1.0] + noise * root[:, None] * rng.normal(size=steps.shape) * [1.0, 0.1, 1.0]
    chain = [np.zeros(3)]
    for step in steps:
        chain.append(compose2(chain[-1], step))
    return Trajectory(times, np.array(chain))


def errors(poses: Array, times: Array) -> Array:
    """(M, 2) m and rad."""
    away = poses - drive(times)
    return np.column_stack([np.hypot(away[:, 0], away[:, 1]), np.abs(wrap_angle(away[:, 2]))])


TIMES = np.random.default_rng(1).uniform(SCANS[0], SCANS[-1], 400)
SOLVED = Trajectory(SCANS, drive(SCANS))


def rms(values: Array) -> Array:
    return np.asarray(np.sqrt((values**2).mean(axis=0)))


def test_along_good_odometry_turns_begin_where_they_do() -> None:
    odometry = wheels(np.arange(-0.5, 21.0, 0.02), 0.002)
    straight, found = errors(SOLVED.at(TIMES), TIMES), errors(poses_between(SOLVED, TIMES, odometry).poses, TIMES)
    assert straight[:, 1].max() > np.radians(1.5)
    assert found[:, 1].max() < np.radians(0.4) and (rms(found) < 0.25 * rms(straight)).all()


def test_bad_odometry_does_no_harm_where_the_motion_is_even() -> None:
    """Its noise would move poses by centimetres; where the scans tell that the platform moves evenly, they stay."""
    odometry = wheels(np.arange(-0.5, 21.0, 0.02), 0.1)
    even = np.abs(TIMES % 3.1 - 1.0) < 0.7
    found = errors(poses_between(SOLVED, TIMES, odometry).poses, TIMES)
    assert found[even, 0].max() < 1e-3 and found[even, 1].max() < np.radians(0.05)


def test_without_odometry_a_smooth_drive_is_followed() -> None:
    def curve(times: Array) -> Array:
        return np.column_stack([3 * np.sin(times), 2 * np.cos(0.7 * times), wrap_angle(1.9 * np.sin(times) + 3.0)])

    solved = Trajectory(SCANS, curve(SCANS))
    inner = TIMES[np.abs(TIMES - SCANS.mean()) < SCANS.mean() - 0.2]
    found, straight = poses_between(solved, inner).poses - curve(inner), solved.at(inner) - curve(inner)
    assert np.abs(wrap_angle(found[:, 2])).max() < 0.1 * np.abs(wrap_angle(straight[:, 2])).max()
    assert np.abs(found[:, :2]).max() < 0.1 * np.abs(straight[:, :2]).max()


@pytest.mark.parametrize("noise", [None, 0.002, 0.03])
def test_sigmas_hold_the_errors(noise: float | None) -> None:
    """Few errors beyond two sigmas, and sigmas that are large only where the motion changes."""
    odometry = None if noise is None else wheels(np.arange(-0.5, 21.0, 0.05), noise)
    found = poses_between(SOLVED, TIMES, odometry)
    off = errors(found.poses, TIMES) / found.sigmas
    assert (off > 2).mean() < 0.05 and off.max() < 5
    assert (np.median(found.sigmas, axis=0) < [0.002, np.radians(0.1)]).all()


@settings(deadline=None, max_examples=40)
@given(st.floats(-3.1, 3.1), st.floats(-20.0, 20.0), st.booleans())
def test_poses_at_scans_stay_and_the_map_may_lie_anywhere(yaw: float, x: float, wheeled: bool) -> None:
    odometry = wheels(np.arange(-0.5, 21.0, 0.05), 0.02) if wheeled else None
    moved = Trajectory(SCANS, compose2([x, 1.0, yaw], SOLVED.poses))
    at_scans = poses_between(moved, SCANS, odometry)
    np.testing.assert_allclose(between2(moved.poses, at_scans.poses), 0.0, atol=1e-9)
    there, here = poses_between(moved, TIMES, odometry).poses, poses_between(SOLVED, TIMES, odometry).poses
    off = between2(compose2([x, 1.0, yaw], here), there)
    assert np.abs(off[:, :2]).max() < 1e-9 and np.abs(wrap_angle(off[:, 2])).max() < 1e-9


def test_beyond_the_last_scan_the_way_is_the_odometrys() -> None:
    few = Trajectory(SCANS[:12], drive(SCANS[:12]))
    beyond = np.array([SCANS[11] + 0.15, SCANS[0] - 0.1])
    odometry = wheels(np.arange(-0.5, 21.0, 0.05), 0.002)
    held, found = poses_between(few, beyond), poses_between(few, beyond, odometry)
    assert errors(held.poses, beyond)[0, 0] == pytest.approx(0.09, abs=1e-6)
    assert 0.09 <= held.sigmas[0, 0] < 0.1
    assert errors(found.poses, beyond)[0, 0] < 0.01 and found.sigmas[0, 0] < 0.03


def test_odometry_that_ends_early_leaves_the_smooth_way() -> None:
    odometry = wheels(np.arange(-0.5, 10.0, 0.05), 0.002)
    late = TIMES[TIMES > 10.2]
    np.testing.assert_array_equal(poses_between(SOLVED, late, odometry).poses, poses_between(SOLVED, late).poses)


@pytest.mark.parametrize("count", [1, 2, 3])
def test_few_poses(count: int) -> None:
    few = Trajectory(SCANS[:count], drive(SCANS[:count]))
    found = poses_between(few, np.array([-0.1, 0.05, 5.0]), wheels(np.arange(-0.5, 21.0, 0.05), 0.002))
    assert np.isfinite(found.poses).all() and (found.sigmas > 0).all()
    assert len(poses_between(few, np.zeros(0)).poses) == 0
