"""Images where the scans are blind: a long corridor with and without them, and the parts against known geometry."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from blind_corridor import corridor_plan, drive_corridor, uneven

from recon.config import Config
from recon.geometry import Array, Pose3, between2, rotation2
from recon.graph.blind import Seen, Speeds, blind_steps, guessed_steps
from recon.graph.motion import Motion
from recon.graph.observation import WallObservations
from recon.graph.slide import Step, estimate_slide, on_surfaces, project
from recon.graph.solve import solve_graph
from recon.lidar.matching import ScanMatching, match_scans
from recon.lidar.noise import with_noise
from recon.lidar.split_and_merge import extract_segments
from recon.pipeline import build
from recon.sequence.camera import Camera
from recon.sequence.trajectory import Trajectory
from recon.simulate import simulate_scans

CAMERA = Camera(640, 480, np.array([[500.0, 0, 320.0], [0, 500.0, 240.0], [0, 0, 1]]))
FORWARD = Pose3(np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]), np.array([0.1, 0.02, 0.95]))
WALLS = np.array([[[9.0, 1.1], [-3.0, 1.1]], [[-3.0, -1.1], [9.0, -1.1]]])


def test_images_tell_the_way_along_a_corridor_that_scans_do_not(tmp_path: Path) -> None:
    """22 m, of which the scanner sees an end in the last metres only; the speed changes, there is no odometry."""
    sequence, truth = drive_corridor(corridor_plan(22.0, 5.0, (320, 240)), tmp_path / "drive", seed=3)
    seen = build(sequence, Config(), plan_only=True)
    blind = build(replace(sequence, images=None, camera=None), Config(), plan_only=True)
    away = np.linalg.norm(seen.estimate.trajectory.poses[:, :2] - truth.poses[:, :2], axis=1)
    lost = np.linalg.norm(blind.estimate.trajectory.poses[:, :2] - truth.poses[:, :2], axis=1)
    sigma = seen.estimate.pose_sigmas[:, 0]
    assert seen.counts["image motions"] > 20 and blind.counts["image motions"] == 0
    assert any("constant velocity is assumed" in warning for warning in blind.warnings)
    assert lost.max() > 1.0 and away.max() < 0.2
    assert np.all(away[10:] < 4 * sigma[10:]) and sigma.max() < 0.3
    assert np.all(np.diff(sigma[10:-40:20]) > -0.01)  # the farther, the less sure


def seen_corners(way: float, across: float, turn: float, rng: np.random.Generator) -> tuple[Array, Array]:
    """Rays of corners in a first image, and where a second one that moved has them, px."""
    pixels = rng.uniform([20, 20], [620, 460], (300, 2))
    rays = np.concatenate([CAMERA.undistort(pixels), np.ones((300, 1))], axis=1)
    points = on_surfaces(rays, FORWARD, WALLS)
    rays, points = rays[np.isfinite(points[:, 0])], points[np.isfinite(points[:, 0])]
    seen = project(points, np.array([way, across, turn]), FORWARD, CAMERA) + rng.normal(0, 0.3, (len(points), 2))
    ok = np.isfinite(seen[:, 0])
    return rays[ok], seen[ok]


@pytest.mark.parametrize("way", [-0.2, 0.0, 0.35, 0.8])
def test_a_way_comes_back_from_where_corners_went(way: float) -> None:
    rng = np.random.default_rng(4)
    rays, seen = seen_corners(way, 0.01, 0.02, rng)
    wrong = rng.random(len(seen)) < 0.3  # people, reflections
    seen[wrong] += rng.uniform(-25, 25, (wrong.sum(), 2))
    found = estimate_slide(rays, seen, Step(np.array([1.0, 0.0]), 0.02, 0.01), way + 0.02, FORWARD, CAMERA, WALLS)
    assert found is not None
    assert abs(found.way - way) < min(4 * found.sigma, 0.01)
    assert 1e-4 < found.sigma < 0.01 and found.corners > 0.5 * len(seen)


def test_the_change_with_the_cameras_pose_is_that_of_a_moved_camera() -> None:
    """A camera that is 1 cm higher than thought sees the floor run slower."""
    rays, seen = seen_corners(0.4, 0.0, 0.0, np.random.default_rng(5))
    step = Step(np.array([1.0, 0.0]), 0.0, 0.0)
    higher = Pose3(FORWARD.rotation, FORWARD.translation + np.array([0.0, 0.0, 0.01]))
    right = estimate_slide(rays, seen, step, 0.4, FORWARD, CAMERA, WALLS)
    wrong = estimate_slide(rays, seen, step, 0.4, higher, CAMERA, WALLS)
    assert right is not None and wrong is not None
    assert wrong.way - right.way == pytest.approx(0.01 * right.change[5], rel=0.2)


def test_corners_that_do_not_agree_tell_no_way() -> None:
    rng = np.random.default_rng(6)
    rays, seen = seen_corners(0.4, 0.0, 0.0, rng)
    step = Step(np.array([1.0, 0.0]), 0.0, 0.0)
    assert estimate_slide(rays, rng.permutation(seen), step, 0.4, FORWARD, CAMERA, WALLS) is None
    assert estimate_slide(rays[:3], seen[:3], step, 0.4, FORWARD, CAMERA, WALLS) is None


def test_rays_end_at_the_nearest_surface() -> None:
    rays = np.array([[0.0, 1.0, 1.0], [1.0, 0.0, 1.0], [0.0, -0.1, 1.0]])
    floor, wall, nothing = on_surfaces(rays, FORWARD, WALLS)
    assert floor == pytest.approx([1.05, 0.02, 0.0])
    assert wall == pytest.approx([0.1 + 1.12, -1.1, 0.95])
    assert np.isnan(nothing).all()


@pytest.mark.parametrize(("along", "across", "blind"), [(5.0, 0.003, True), (0.003, 0.002, False), (5.0, 4.0, False)])
def test_blind_is_what_is_vague_one_way_only(along: float, across: float, blind: bool) -> None:
    turn = np.eye(3)
    turn[:2, :2] = rotation2(0.7)
    covariance = (turn @ np.diag([along**2, across**2, 1e-6]) @ turn.T)[None]
    poses = Trajectory(np.array([0.0, 0.1]), np.zeros((2, 3)))
    matching = ScanMatching(poses, covariance, covariance, np.zeros(2, np.bool_), np.zeros((2, 3)))
    assert blind_steps(matching).tolist() == [blind]


@pytest.mark.parametrize("odometry", [False, True])
def test_a_speed_that_nothing_tells_is_in_the_sigmas(odometry: bool) -> None:
    """Scans alone do not tell the way along 40 m; their walls neither pull along themselves nor make it surer."""
    scans, truth, driven = simulate_scans(corridor_plan(40.0, 6.0, (320, 240)), 4)
    start = float(scans.timestamps[0])
    stamps = uneven(scans.timestamps, start)
    scans, ticks = replace(scans, timestamps=stamps), uneven(driven.timestamps, start)
    config = with_noise(scans, Config().lidar)
    matching = match_scans(scans, Trajectory(ticks, driven.poses) if odometry else None, config)
    poses, guessed = matching.trajectory.poses, guessed_steps(matching)
    motion = Motion(between2(poses[:-1], poses[1:]), matching.scan_covariances, guessed)
    segments = [extract_segments(scans, i, config, matching.velocities[i]) for i in range(len(scans))]
    walls = WallObservations(
        np.concatenate([np.full(len(s), i) for i, s in enumerate(segments)]),
        np.concatenate([s.endpoints for s in segments]),
        np.concatenate([s.covariance for s in segments]),
        np.full(sum(map(len, segments)), -1),
    )
    found = solve_graph(matching.trajectory, motion, walls, matching.odometry)
    error, sigma = (found.trajectory.poses - truth.poses)[5:, 0], found.pose_sigmas[5:, 0]
    assert guessed.mean() > 0.5
    assert np.abs(found.trajectory.poses - truth.poses)[:, 1].max() < (0.05 if odometry else 1.0)
    assert 0.02 < np.mean((error / sigma) ** 2) < 2.5
    assert sigma[-1] < 1.0 if odometry else 8.0 < sigma[-1] < 40.0


@pytest.mark.parametrize("blind", [[2], [5, 6], [0, 1, 2, 3, 4, 5, 6, 7, 8, 9]])
def test_what_scans_tell_of_a_pair_of_images_is_taken_off(blind: list[int]) -> None:
    """A platform that speeds up from 0.2 to 0.8 m/s between two images a second apart."""
    stamps, heading = np.linspace(0.0, 1.0, 11), np.array([np.cos(0.7), np.sin(0.7)])
    way = 0.2 * stamps + 0.3 * stamps**2
    poses = np.column_stack([way[:, None] * heading, np.full(11, 0.7)])
    sigma = np.where(np.isin(np.arange(10), blind), 0.05, 0.002)
    covariance = sigma[:, None, None] ** 2 * np.diag([1.0, 1e-4, 1e-6])
    matching = ScanMatching(
        Trajectory(stamps, poses), covariance, covariance, np.zeros(11, np.bool_), np.zeros((11, 3))
    )
    flags = blind_steps(matching)
    assert np.flatnonzero(flags).tolist() == blind
    speeds = Speeds([Seen(0.0, 1.0, heading, 0.5, 0.003**2, np.zeros(6))], 0.0)
    found = [speeds.rest(k, matching, flags) for k in blind]
    lengths, variances = zip(*((f.length, f.variance) for f in found if f is not None), strict=True)
    assert sum(lengths) == pytest.approx(float(np.diff(way)[blind].sum()), abs=1e-9)
    assert sum(variances) == pytest.approx(0.003**2 + (10 - len(blind)) * 0.002**2, rel=1e-6)
