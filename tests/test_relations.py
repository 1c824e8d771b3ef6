from __future__ import annotations

import numpy as np
import pytest

from recon.errors import InputError
from recon.evaluate.relations import poses_at, relation_errors
from recon.geometry import Array, between2, compose2
from recon.sequence.groundtruth import Relations
from recon.sequence.trajectory import Trajectory


def path(times: Array) -> Array:
    return np.column_stack([3 * np.sin(times), 2 * np.cos(0.7 * times), 0.9 * times])


def relations(count: int = 200) -> Relations:
    first, second = np.random.default_rng(0).uniform(0.0, 9.0, (2, count))
    return Relations(first, second, between2(path(first), path(second)))


def test_the_true_trajectory_has_no_error_however_the_map_lies() -> None:
    fine = np.arange(0.0, 9.001, 0.001)
    moved = compose2([4.0, -2.0, 1.3], path(fine))
    found = relation_errors(Trajectory(fine, moved), relations())
    assert found.translation.mean < 1e-4 and found.rotation.mean < 1e-3
    assert (found.used, found.left_out) == (200, 0)


def test_errors_are_those_put_in() -> None:
    """Every second stamp's pose is off by 5 cm forward and 2 degrees."""
    stamps = np.arange(20.0)
    poses = path(stamps)
    truth = Relations(stamps[0::2], stamps[1::2], between2(poses[0::2], poses[1::2]))
    poses[1::2] = compose2(poses[1::2], [0.05, 0.0, np.radians(2.0)])
    found = relation_errors(Trajectory(stamps, poses), truth)
    assert found.translation.mean == pytest.approx(0.05)
    assert found.translation.squared_mean == pytest.approx(0.0025)
    assert found.rotation.mean == pytest.approx(2.0)
    assert found.rotation.squared_deviation == pytest.approx(0.0, abs=1e-9)


def test_between_scans_the_way_is_the_odometrys() -> None:
    """With one scan a second the odometry's way is far better than the straight line, though it drifts."""
    stamps, fine = np.arange(0.0, 9.5, 1.0), np.arange(-1.0, 10.0, 0.02)
    chain = [np.zeros(3)]
    for step in between2(path(fine[:-1]), path(fine[1:])):
        chain.append(compose2(chain[-1], step * [1.02, 1.02, 1.0] + [0.0, 0.0, 0.0002]))
    coarse, odometry = Trajectory(stamps, path(stamps)), Trajectory(fine, np.array(chain))
    straight, along = relation_errors(coarse, relations()), relation_errors(coarse, relations(), odometry)
    assert straight.translation.mean > 0.1
    assert along.translation.mean < 0.02 and along.rotation.mean < 0.2
    there = poses_at(coarse, stamps, odometry)
    np.testing.assert_allclose(between2(path(stamps), there), 0, atol=1e-9)


def test_stamps_outside_are_left_out() -> None:
    stamps = np.arange(0.0, 5.0, 0.01)
    known = relations()
    outside = int(((known.first > stamps[-1]) | (known.second > stamps[-1])).sum())
    found = relation_errors(Trajectory(stamps, path(stamps)), known)
    assert found.left_out == outside > 0
    assert found.used == 200 - outside
    with pytest.raises(InputError, match="none of its 200 relations"):
        relation_errors(Trajectory(stamps + 100, path(stamps)), known)
