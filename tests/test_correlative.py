"""Correlative search: places that look alike are all found."""

from __future__ import annotations

import numpy as np
from numpy.testing import assert_allclose

from recon.config import LidarConfig
from recon.geometry import Array, between2
from recon.lidar.cloud import Cloud
from recon.lidar.correlative import search
from recon.lidar.localmap import build_map

EVEN = np.diag([4.0, 4.0, 4.0])


def cloud_of(xy: Array) -> Cloud:
    """Blobs at xy (n, 2)."""
    n = len(xy)
    return Cloud(xy, np.zeros((n, 2)), np.zeros(n, np.bool_), np.full(n, 600.0))


def colonnade(bays: int) -> Array:
    """Two rows of columns, one every metre."""
    along = np.arange(bays, dtype=np.float64)
    return np.concatenate([np.column_stack([along, np.full(bays, y)]) for y in (-1.2, 1.0)])


def test_all_bays_of_a_colonnade_are_found_the_expected_one_first() -> None:
    local = build_map(cloud_of(colonnade(12)), np.array([5.5, 0.0]), LidarConfig(range_sigma=0.01))
    prior = np.array([4.1, 0.05, 0.02])
    window = np.array([1.5, 0.2])
    found = search(cloud_of(colonnade(4)), local, prior, EVEN, window, 3)
    assert found.shape == (3, 3)
    assert_allclose(found[0], [4.0, 0.0, 0.0], atol=0.06)
    assert_allclose(np.sort(found[:, 0]), [3.0, 4.0, 5.0], atol=0.06)
    assert_allclose(found[:, 1:], 0.0, atol=0.06)


def test_the_first_place_does_not_depend_on_how_many_are_asked_for() -> None:
    rng = np.random.default_rng(0)
    scene = rng.uniform(-5, 5, (80, 2))
    local = build_map(cloud_of(scene), np.zeros(2), LidarConfig(range_sigma=0.01))
    pose = np.array([0.3, -0.2, 0.1])
    seen = between2(pose, np.column_stack([scene, np.zeros(len(scene))]))[:, :2]
    alone = search(cloud_of(seen), local, np.zeros(3), EVEN, np.array([0.6, 0.3]))
    several = search(cloud_of(seen), local, np.zeros(3), EVEN, np.array([0.6, 0.3]), 4)
    assert_allclose(alone[0], pose, atol=0.05)
    assert_allclose(several[0], alone[0])
    apart = several[:, None] - several[None]
    far = (np.hypot(apart[..., 0], apart[..., 1]) > 0.29) | (np.abs(apart[..., 2]) > np.radians(4.9))
    assert far[~np.eye(4, dtype=bool)].all()
