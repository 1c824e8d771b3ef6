"""What submaps saw to be empty, and closures of submaps that have little in common."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scan_drive import FULL, cast_scans, polygon

from recon.config import LidarConfig
from recon.geometry import Array, apply2, between2, wrap_angle
from recon.lidar.cloud import make_cloud
from recon.lidar.clouds import Clouds
from recon.lidar.localmap import CELL, LocalMap, build_map
from recon.lidar.noise import with_noise
from recon.lidar.points import scan_points
from recon.loops.closure import Closer
from recon.loops.free_space import contradicted, free_space
from recon.loops.submap import Submaps, make_submaps

HALL = polygon(
    (-9, -2),
    (2, -2),
    (2, -2.8),
    (3.4, -2.8),
    (3.4, -2),
    (9, -2),
    (9, 2),
    (0.5, 2),
    (0.5, 3.5),
    (-2, 3.5),
    (-2, 2),
    (-9, 2),
)
"""18 m by 4 m with a niche and a recess."""


def straight(start: float, end: float, y: float, heading: float) -> Array:
    x = np.arange(start, end, 0.2 if end > start else -0.2)
    return np.column_stack([x, np.full(len(x), y), np.full(len(x), heading)])


def submaps_of(walls: Array, poses: Array, reach: float = 5.0) -> tuple[Submaps, LidarConfig]:
    """Every scan a keyframe, cast from true poses (N, 3)."""
    scans = cast_scans(walls, poses, 240, FULL, sigma=0.01, reach=reach)
    config = with_noise(scans, LidarConfig())
    numbers = np.arange(len(poses))
    clouds = Clouds.pack(make_cloud(scan_points(scans, int(k), None), config) for k in numbers)
    return make_submaps(numbers, clouds, poses), config


def middle_submap() -> tuple[Submaps, Array, LocalMap, NDArray[np.bool_]]:
    poses = straight(-6.0, 6.0, 0.3, 0.0)
    submaps, config = submaps_of(HALL, poses)
    local = build_map(submaps.cloud(1, poses, around=1), np.zeros(2), config)
    return submaps, poses, local, free_space(submaps, 1, poses, local)


def test_the_floor_inside_is_free_and_walls_and_what_is_behind_are_not() -> None:
    submaps, poses, local, free = middle_submap()
    middles = (np.argwhere(free) + 0.5) * CELL + local.corner
    there = apply2(poses[submaps.anchor_scans[1]], middles)
    in_hall = (np.abs(there[:, 0]) < 9) & (np.abs(there[:, 1]) < 2)
    in_recess = (there[:, 0] > -2) & (there[:, 0] < 0.5) & (there[:, 1] > 0) & (there[:, 1] < 3.5)
    in_niche = (there[:, 0] > 2) & (there[:, 0] < 3.4) & (there[:, 1] < 0) & (there[:, 1] > -2.8)
    assert (in_hall | in_recess | in_niche).all()
    nearest = np.min(np.linalg.norm(middles[:, None] - local.points[None], axis=2), axis=1)
    assert nearest.min() > 0.15
    # of the floor within sight most is known to be free
    assert CELL**2 * in_hall.sum() > 0.7 * 16 * 3.4


def test_what_stands_on_free_floor_contradicts_and_what_was_out_of_sight_does_not() -> None:
    submaps, poses, local, free = middle_submap()
    xy = submaps.cloud(1, poses).xy
    assert contradicted(xy, np.zeros(3), local, free) < 0.02
    assert contradicted(xy, np.array([0.0, 0.8, 0.0]), local, free) > 0.3
    assert contradicted(xy, np.array([40.0, 0.0, 0.0]), local, free) == 0.0
    assert contradicted(np.zeros((0, 2)), np.zeros(3), local, free) == 0.0


def back_again() -> tuple[Closer, int, int, Array]:
    """Past the niche, round somewhere else, and back into the hall from the other end with a scanner that reaches 5 m:
    the last submap and the first have a part of the hall in common."""
    poses = np.concatenate([straight(-8.0, -2.0, 0.0, 0.0), straight(7.6, -1.2, -0.4, np.pi)])
    submaps, config = submaps_of(HALL, poses)
    true = between2(poses[submaps.anchor_scans[0]], poses[submaps.anchor_scans[-1]])
    return Closer(submaps, poses, config), 0, len(submaps) - 1, true


@pytest.mark.parametrize("seed", range(3))
def test_submaps_with_a_part_in_common_are_found(seed: int) -> None:
    closer, first, second, true = back_again()
    rng = np.random.default_rng(seed)
    found = closer.find(second, first, true + rng.uniform(-1, 1, 3) * [0.8, 0.8, 0.15], np.array([1.0, 0.2]))
    assert found is not None and found.overlap < 0.55
    error = found.relative - true
    error[2] = wrap_angle(error[2])
    assert np.hypot(error[0], error[1]) < 0.06 and abs(error[2]) < 0.01
    assert error @ np.linalg.solve(found.covariance, error) < 16.3


@pytest.mark.parametrize("shift", [-3.0, -2.0, 2.0, 3.0])
def test_the_hall_a_few_metres_on_is_no_closure(shift: float) -> None:
    """Its walls lie on one another there, but for a recess and a niche that the other submap saw to be wall."""
    closer, first, second, true = back_again()
    assert closer.find(second, first, true + np.array([shift, 0.0, 0.0]), np.array([0.5, 0.1])) is None
