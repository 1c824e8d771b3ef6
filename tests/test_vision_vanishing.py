"""Vanishing points against directions that are known: drawn segments with noise, and pictures of a room."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from vision_scene import (
    angle_deg,
    camera_from_world,
    fisheye,
    frame_with,
    pinhole,
    render_room,
    segments_towards,
)

from recon.config import VisionConfig
from recon.geometry import Array
from recon.sequence.camera import Camera
from recon.vision.frame import OUTLIER, VERTICAL
from recon.vision.frame_lines import boundary_candidates, detect_lines, horizon, relabel
from recon.vision.jlinkage import j_linkage
from recon.vision.planes import planes_of
from recon.vision.vanishing import assign, find_directions
from recon.vision.vertical import average_vertical, vertical_direction

CAMERA = pinhole(width=640, height=480)
MOUNT = (st.floats(0, np.deg2rad(45)), st.floats(-np.deg2rad(10), np.deg2rad(10)), st.floats(-np.pi, np.pi))


def clutter(count: int, rng: np.random.Generator) -> Array:
    """Segments (count, 2, 2) of random place and direction."""
    middle = rng.uniform([20, 20], [620, 460], (count, 2))
    angle = rng.uniform(0, np.pi, count)
    half = rng.uniform(10, 40, count)[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return np.stack([middle - half, middle + half], axis=1)


def axis_errors(directions: Array, rotation: Array) -> Array:
    """Degrees of each row (3, 3) from the nearest true one: down, and for the horizontals either world axis."""
    down = angle_deg(directions[0], -rotation[:, 2])
    level = [min(angle_deg(d, s * rotation[:, k]) for k in (0, 1) for s in (1, -1)) for d in directions[1:]]
    return np.array([down, *level])


def naive_j_linkage(preferences: NDArray[np.bool_]) -> list[list[int]]:
    """As the paper words it, quadratic and plain."""
    members = {i: [i] for i in range(len(preferences))}
    sets = {i: preferences[i].copy() for i in members}
    while True:
        best = (1.0, -1, -1)
        for i in sorted(members):
            for j in sorted(members):
                both = int((sets[i] & sets[j]).sum())
                if j > i and both > 0:
                    best = min(best, (1 - both / int((sets[i] | sets[j]).sum()), i, j))
        if best[1] < 0:
            return sorted(sorted(m) for m in members.values())
        _, i, j = best
        members[i] += members.pop(j)
        sets[i] &= sets.pop(j)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**31), st.integers(1, 30), st.integers(1, 150), st.floats(0.02, 0.5))
def test_j_linkage_equals_the_plain_algorithm(seed: int, n: int, m: int, density: float) -> None:
    rng = np.random.default_rng(seed)
    preferences = rng.random((n, m)) < density
    preferences |= rng.integers(0, 3, n)[:, None] == rng.integers(0, 6, m)
    cluster = j_linkage(preferences)
    mine = sorted(sorted(np.flatnonzero(cluster == k).tolist()) for k in range(cluster.max() + 1))
    assert mine == naive_j_linkage(preferences)
    assert (np.diff(np.bincount(cluster)) <= 0).all()


@settings(max_examples=30, deadline=None)
@given(*MOUNT, st.integers(0, 2**31))
def test_three_vanishing_points_among_clutter(tilt: float, roll: float, yaw: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    rotation = camera_from_world(tilt, roll, yaw)
    lines, _ = segments_towards(rotation.T[[2, 0, 1]], 20, CAMERA, 0.2, rng)
    lines = np.concatenate([lines, clutter(30, rng)])
    lines = lines[np.argsort(-np.linalg.norm(lines[:, 1] - lines[:, 0], axis=1))]
    planes = planes_of(lines, np.full(len(lines), 0.2), CAMERA)
    directions = find_directions(planes, 0)
    assert directions @ directions.T == pytest.approx(np.eye(3), abs=1e-9)
    assert np.linalg.det(directions) == pytest.approx(1)
    assert directions[1, 2] >= abs(directions[2, 2]) - 1e-9
    assert axis_errors(directions, rotation).max() < 0.5
    labels = assign(planes, directions)
    assert 45 <= np.count_nonzero(labels != OUTLIER) <= 80


def test_the_error_of_the_vertical_shrinks_with_noise_and_is_as_told() -> None:
    """Over many draws the joint error over its standard deviation is that of two independent normal variables."""
    ratio, error = [], []
    for seed in range(30):
        rng = np.random.default_rng(seed)
        rotation = camera_from_world(rng.uniform(0, 0.7), rng.uniform(-0.15, 0.15), rng.uniform(-3, 3))
        frames = []
        for _ in range(8):
            lines, _ = segments_towards(-rotation.T[[2]], 10, CAMERA, 0.3, rng)
            frames.append(frame_with(lines, 0.3))
        found, sigma, count = vertical_direction(frames, CAMERA)
        assert count >= 72
        ratio.append(np.deg2rad(angle_deg(found, -rotation[:, 2])) / sigma)
        error.append(angle_deg(found, -rotation[:, 2]))
    assert 0.01 < np.median(error) < 0.15
    assert 0.4 < np.sqrt(np.mean(np.square(ratio))) < 1.6  # sigma is that of the worst axis


@settings(max_examples=8, deadline=None)
@given(MOUNT[0], MOUNT[1], st.integers(0, 2**31))
def test_the_joint_vertical_withstands_clutter_and_swaying(tilt: float, roll: float, seed: int) -> None:
    """Most lines are clutter, a third of the frames have nothing else, and the platform nods by 0.3 degrees."""
    rng = np.random.default_rng(seed)
    frames = []
    for k in range(24):
        rotation = camera_from_world(tilt + np.deg2rad(rng.normal(0, 0.3)), roll, rng.uniform(-3, 3))
        lines = clutter(40, rng)
        if k % 3:
            true, _ = segments_towards(rotation.T[[2, 0, 1]], 8, CAMERA, 0.3, rng)
            lines = np.concatenate([true, lines])
        frames.append(frame_with(lines, 0.3))
    down = -camera_from_world(tilt, roll, 0.0)[:, 2]
    found, sigma, _ = vertical_direction(frames, CAMERA)
    assert angle_deg(found, down) < 0.6
    assert 0.02 < np.rad2deg(sigma) < 0.5


def test_a_building_without_right_angles_does_not_bend_the_vertical() -> None:
    """Two families of walls, 70 degrees apart, and few vertical lines."""
    rng = np.random.default_rng(5)
    frames = []
    walls = np.array([[0, 0, 1], [1, 0, 0], [np.cos(np.deg2rad(70)), np.sin(np.deg2rad(70)), 0]])
    for _ in range(15):
        rotation = camera_from_world(0.25, 0.05, rng.uniform(-3, 3))
        true = [
            segments_towards(walls[[k]] @ rotation.T, n, CAMERA, 0.3, rng)[0] for k, n in ((0, 4), (1, 20), (2, 20))
        ]
        frames.append(frame_with(np.concatenate(true), 0.3))
    found, sigma, _ = vertical_direction(frames, CAMERA)
    error = np.deg2rad(angle_deg(found, -camera_from_world(0.25, 0.05, 0)[:, 2]))
    assert error < 3 * sigma
    assert 0.01 < np.rad2deg(sigma) < 0.2


def test_lines_of_a_swaying_frame_are_labelled() -> None:
    """The frame leans one degree off the drive's vertical: its own lines are known, the direction stays the drive's."""
    rng = np.random.default_rng(1)
    down = -camera_from_world(0.3, 0.0, 0.4)[:, 2]
    rotation = camera_from_world(0.3, np.deg2rad(1.0), 0.4)
    lines, owner = segments_towards(rotation.T[[2, 0, 1]], 20, CAMERA, 0.2, rng)
    again = relabel(frame_with(lines, 0.2), CAMERA, down)
    assert again.directions[0] == pytest.approx(down)
    assert np.mean(again.labels[owner == 0] == VERTICAL) > 0.9
    assert np.mean(again.labels[owner != 0] > VERTICAL) > 0.8


def test_without_lines_there_is_no_vertical() -> None:
    empty = frame_with(np.zeros((0, 2, 2)), 0.3)
    for frames in ([], [empty], [frame_with(np.array([[[10, 10], [200, 10.0]]]), 0.3), empty]):
        direction, sigma, count = vertical_direction(frames, CAMERA)
        assert np.isnan(direction).all() and sigma == np.inf and count == 0
    assert np.isnan(average_vertical([empty])).all()


@pytest.mark.parametrize("camera", [pinhole(), pinhole(distorted=True), fisheye()], ids=["plain", "bent", "fisheye"])
def test_pictures_of_a_room(camera: Camera) -> None:
    """Vertical of every picture and of all, horizontals, labels and boundary candidates, through every lens."""
    rng = np.random.default_rng(3)
    frames, rotations = [], []
    tilt, roll = np.deg2rad(17), np.deg2rad(-4)
    for yaw in rng.uniform(-np.pi, np.pi, 5):
        rotation = camera_from_world(tilt, roll, yaw)
        frames.append(detect_lines(render_room(camera, rotation), camera, VisionConfig(), 0))
        rotations.append(rotation)
    down = -rotations[0][:, 2]
    found, sigma, count = vertical_direction(frames, camera)
    assert angle_deg(found, down) < 0.06
    assert count >= 20
    assert 0.001 < np.rad2deg(sigma) < 0.1
    assert angle_deg(average_vertical(frames), down) < 0.1
    for frame, rotation in zip(frames, rotations, strict=True):
        again = relabel(frame, camera, found)
        errors = axis_errors(again.directions, rotation)
        assert np.isfinite(errors).sum() >= 2  # straight at a wall no line leads into the depth
        assert np.nanmax(errors) < 0.2
        assert np.mean(again.labels != OUTLIER) > 0.8
        assert np.array_equal(again.endpoints, frame.endpoints)
        rays = np.concatenate([again.endpoints, np.ones((len(again), 2, 1))], axis=2) @ np.linalg.inv(camera.matrix).T
        below = (rays @ found > 0).all(axis=1)
        assert np.array_equal(again.boundary, np.flatnonzero(below & (again.labels != VERTICAL)))


def test_half_the_exposure_gives_the_same_vertical() -> None:
    camera, rotation = pinhole(), camera_from_world(0.2, 0.05, 0.6)
    frames = [detect_lines(render_room(camera, rotation, e), camera, VisionConfig(), 0) for e in (0.4, 1.0)]
    for frame in frames:
        assert angle_deg(frame.directions[0], -rotation[:, 2]) < 0.1
    assert abs(len(frames[0]) - len(frames[1])) <= 3


def test_same_image_same_lines() -> None:
    camera = fisheye()
    image = render_room(camera, camera_from_world(0.2, 0.05, 0.6))
    first, second = (detect_lines(image, camera, VisionConfig(), 5) for _ in range(2))
    for name in ("endpoints", "sigmas", "labels", "directions", "boundary"):
        assert getattr(first, name).tobytes() == getattr(second, name).tobytes()


def test_boundary_candidates_without_a_vertical() -> None:
    """Nothing but the image's middle row is known then."""
    lines = np.array([[[10, 400], [300, 300]], [[10, 400], [300, 100]], [[10, 20], [300, 100.0]]])
    labels = np.full(3, OUTLIER)
    assert boundary_candidates(lines, labels, CAMERA, np.full(3, np.nan)).tolist() == [0]


@given(MOUNT[0], MOUNT[1], st.floats(-0.5, 0.5))
def test_horizon_holds_the_level_directions(tilt: float, roll: float, bearing: float) -> None:
    rotation = camera_from_world(tilt, roll, 0.0)
    line = horizon(CAMERA, -rotation[:, 2])
    level = rotation @ np.array([np.cos(bearing), np.sin(bearing), 0.0])
    lower = rotation @ np.array([np.cos(bearing), np.sin(bearing), -0.1])
    pixel, under = ((CAMERA.matrix @ d) / d[2] for d in (level, lower))
    assert line @ pixel == pytest.approx(0, abs=1e-6)
    assert line @ under > 0
    assert np.hypot(line[0], line[1]) == pytest.approx(1)
