"""Poses and walls from simulated drives with known truth, and from a path-traced one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from graph_drive import Drive, drive, polygon, simulate

from recon.config import GraphConfig
from recon.geometry import Array, apply2, between2, compose2, wrap_angle
from recon.graph.edges import Edges
from recon.graph.estimate import MapEstimate, WallLine
from recon.graph.motion import Motion
from recon.graph.observation import WallObservations
from recon.graph.solve import solve_graph
from recon.sequence.trajectory import Trajectory

FREE = GraphConfig(manhattan=False)
ROOM = polygon([(-1, -1.5), (7, -2.4), (8.5, 1), (7.2, 5.5), (2.8, 6.1), (2.2, 2.5), (-1.3, 1.9)])
"""No two walls at right angles."""
CORRIDORS = polygon([(-1, -1), (9, -1), (9, 8), (-1, 8), (-1, 6), (7, 6), (7, 1), (-1, 1)])
"""Three corridors, 2 m wide, in a U."""
U_TURN = drive([(0, 0), (8, 0), (8, 7), (0, 7)])


def wall_errors(estimate: MapEstimate, truth: Array) -> list[tuple[int, float, float, WallLine]]:
    """(true wall, offset m, angle rad, wall) of every estimated wall, against the true wall nearest by line."""
    out = []
    for wall in estimate.walls:
        along = truth[:, 1] - truth[:, 0]
        turn = wrap_angle(wall.pose[2] - np.arctan2(along[:, 1], along[:, 0]))
        to = wall.pose[:2] - truth[:, 0]
        length = np.linalg.norm(along, axis=1)
        offset = (along[:, 0] * to[:, 1] - along[:, 1] * to[:, 0]) / length
        share = np.sum(to * along, axis=1) / length**2
        cost = np.abs(offset) + np.abs(turn) + 10 * ((share < 0) | (share > 1))
        k = int(np.argmin(cost))
        out.append((k, float(offset[k]), float(turn[k]), wall))
    return out


def solve(run: Drive, config: GraphConfig | None = None, odometry: Trajectory | None = None) -> MapEstimate:
    return solve_graph(run.start, run.motion, run.observations, odometry, config)


def test_sigmas_are_honest() -> None:
    """Normalised squared errors of poses and walls average one, between a half and two."""
    poses, offsets, angles = [], [], []
    for seed in range(8):
        run = simulate(ROOM, drive([(0, 0), (6, 0), (6.5, 2.5), (4.5, 4)]), seed)
        estimate = solve(run, FREE)
        assert len(estimate.walls) == len(ROOM)
        error = estimate.trajectory.poses - run.truth
        error[:, 2] = wrap_angle(error[:, 2])
        poses.append(np.mean((error / estimate.pose_sigmas)[1:] ** 2, axis=0))
        for _, offset, angle, wall in wall_errors(estimate, run.walls):
            offsets.append((offset / wall.sigma_offset) ** 2)
            angles.append((angle / wall.sigma_angle) ** 2)
    for squared in (*np.mean(poses, axis=0), np.mean(offsets), np.mean(angles)):
        assert 0.5 < squared < 2.0


def test_walls_that_are_not_square_are_not_bent() -> None:
    """A building mostly of right angles with corners of 88 and 91.5 degrees keeps them."""
    slope_88, slope_915 = np.tan(np.radians(2.0)), np.tan(np.radians(1.5))
    plan = polygon(
        [(-1, -1), (9, -1), (9 - 9 * slope_88, 8), (-1, 8), (-1, 6), (7, 6), (7 - 5 * slope_915, 1), (-1, 1)]
    )
    for seed in range(3):
        run = simulate(plan, drive([(0, 0), (7.8, 0), (7.8, 7), (0, 7)]), seed)
        errors = wall_errors(solve(run), run.walls)
        assert {k for k, *_ in errors} == set(range(8))
        for _, offset, angle, wall in errors:
            assert abs(angle) < 3 * wall.sigma_angle
            assert abs(angle) < np.radians(0.25)
            assert abs(offset) < 3 * wall.sigma_offset + 0.001


def test_right_angles_straighten_a_noisy_building() -> None:
    """In a right-angled building they take most of the walls' errors of direction away."""
    square: list[float] = []
    free: list[float] = []
    for seed in range(4):
        run = simulate(CORRIDORS, U_TURN, seed, sigma=0.03, reach=4.0)
        for config, spread in ((GraphConfig(), square), (FREE, free)):
            spread.append(float(np.std([angle for _, _, angle, _ in wall_errors(solve(run, config), run.walls)])))
    assert np.mean(square) < 0.5 * np.mean(free)


def odometry_of(run: Drive, scale: float, seed: int) -> Trajectory:
    """Odometry that says `scale` times too little, ten times as often as scans, on its own clock ticks."""
    rng = np.random.default_rng(seed)
    stamps = np.arange(run.start.timestamps[0] - 0.05, run.start.timestamps[-1] + 0.1, 0.02)
    steps = between2(*(Trajectory(run.start.timestamps, run.truth).at(t) for t in (stamps[:-1], stamps[1:])))
    steps = steps * [1 / scale, 1 / scale, 1] + rng.normal(size=steps.shape) * [0.0007, 0.0003, 0.0003]
    chain = [np.array([5.0, -3.0, 2.0])]
    for step in steps:
        chain.append(compose2(chain[-1], step))
    return Trajectory(stamps, np.array(chain))


def test_odometry_scale_is_found() -> None:
    for seed, scale in enumerate((1.03, 0.97)):
        run = simulate(CORRIDORS, U_TURN, seed)
        found = solve(run, odometry=odometry_of(run, scale, seed)).odometry_scale
        assert found is not None and abs(found - scale) < 0.005


def test_odometry_holds_where_walls_say_nothing() -> None:
    """Along an endless corridor only odometry tells how far it went."""
    walls = np.array([[[-50.0, -1], [50, -1]], [[50, 1], [-50, 1]]])
    run = simulate(walls, drive([(0, 0), (10, 0)]), 3)
    noise = np.random.default_rng(0).normal(size=len(run.motion)) * 0.3
    vague = Motion(run.motion.relative + np.outer(noise, [1, 0, 0]), run.motion.covariance + np.diag([0.3**2, 0, 0]))
    run = replace(run, motion=vague)
    way = between2(run.truth[0], run.truth[-1])[0]
    held, free = solve(run, odometry=odometry_of(run, 1.0, 0)), solve(run)
    assert abs(held.trajectory.poses[-1, 0] - way) < 0.4
    assert 0.05 < held.pose_sigmas[-1, 0] < 1.0
    assert abs(free.trajectory.poses[-1, 0] - way) > 0.8
    assert free.pose_sigmas[-1, 0] == pytest.approx(np.hypot(0.3, 0.006) * np.sqrt(len(run.motion)), rel=0.1)


def there_and_back(seed: int, sigma: Array) -> tuple[Drive, Edges]:
    """Along an endless corridor and back, blind along it; three places on the way back measured from the way there."""
    walls = np.array([[[-50.0, -1], [50, -1]], [[50, 1], [-50, 1]]])
    run = simulate(walls, drive([(0, 0), (10, 0), (0, 0)]), seed)
    rng = np.random.default_rng([seed, 7])
    slip = np.outer(rng.normal(size=len(run.motion)) * 0.05, [1, 0, 0])
    motion = Motion(run.motion.relative + slip, run.motion.covariance + np.diag([0.05**2, 0, 0]))
    there = np.array([0, 18, 36])
    back = len(run.truth) - 1 - there
    relative = between2(run.truth[there], run.truth[back]) + rng.normal(size=(3, 3)) * sigma
    covariance = np.broadcast_to(np.diag(sigma**2), (3, 3, 3)).copy()
    return replace(run, motion=motion), Edges(there, back, relative, covariance)


def test_closures_hold_where_walls_say_nothing_and_sigmas_stay_honest() -> None:
    """Out and back along a blind corridor poses are as wrong as they say, and far better than without closures."""
    squared = []
    for seed in range(20):
        run, closures = there_and_back(seed, np.array([0.02, 0.02, 0.004]))
        estimate = solve_graph(run.start, run.motion, run.observations, config=FREE, closures=closures)
        error = estimate.trajectory.poses - run.truth
        error[:, 2] = wrap_angle(error[:, 2])
        squared.append(np.mean((error / estimate.pose_sigmas)[1:] ** 2, axis=0))
    free = solve_graph(run.start, run.motion, run.observations, config=FREE)
    assert 0.015 < estimate.pose_sigmas[-1, 0] < 0.03  # the start is seen again, to 2 cm
    assert free.pose_sigmas[-1, 0] > 10 * estimate.pose_sigmas[-1, 0]
    assert estimate.pose_sigmas[len(run.truth) // 2, 0] < 0.8 * free.pose_sigmas[len(run.truth) // 2, 0]
    for component in np.mean(squared, axis=0):
        assert 0.5 < component < 2.0


def test_closures_count_points_of_walls_once() -> None:
    """In a room whose walls say everything, closures of the same scans make nothing surer by more than a little."""
    run = simulate(ROOM, drive([(0, 0), (6, 0), (0, 0)]), 2)
    back = np.arange(len(run.truth) - 8, len(run.truth))
    there = len(run.truth) - 1 - back
    sigma = np.array([0.002, 0.002, 0.0005])
    covariance = np.broadcast_to(np.diag(sigma**2), (8, 3, 3)).copy()
    closures = Edges(there, back, between2(run.truth[there], run.truth[back]), covariance)
    with_them = solve_graph(run.start, run.motion, run.observations, config=FREE, closures=closures)
    without = solve(run, FREE)
    ratio = with_them.pose_sigmas[back] / without.pose_sigmas[back]
    assert np.all(ratio > 0.7) and np.all(ratio < 1.05)


def test_gross_outliers_bend_nothing() -> None:
    """A tenth of the segments moved or turned anywhere leaves the walls where they are."""
    run = simulate(ROOM, drive([(0, 0), (6, 0), (6.5, 2.5), (4.5, 4)]), 7)
    rng = np.random.default_rng(7)
    ends = run.observations.endpoints.copy()
    for k in np.flatnonzero(rng.random(len(ends)) < 0.1):
        ends[k] = apply2(rng.uniform(-1, 1, 3) * [0.5, 0.5, 0.3], ends[k])
    estimate = solve(replace(run, observations=replace(run.observations, endpoints=ends)), FREE)
    long = [e for e in wall_errors(estimate, run.walls) if e[3].observations > 10]
    assert {k for k, *_ in long} == set(range(len(ROOM)))
    for _, offset, angle, wall in long:
        assert abs(offset) < 4 * wall.sigma_offset + 0.001
        assert abs(angle) < 4 * wall.sigma_angle
    assert np.abs(estimate.trajectory.poses - run.truth)[:, :2].max() < 0.02


def test_recesses_and_thin_walls_stay_apart() -> None:
    """A door leaf 6 cm behind the wall, and the two faces of an 8 cm wall, are lines of their own; the wall goes on."""
    front = [(-1, -1), (4, -1), (4, -1.06), (5, -1.06), (5, -1), (9, -1)]
    room = polygon([*front, (9, 4), (3.08, 4), (3.08, 1), (3, 1), (3, 4), (-1, 4)])
    path = drive([(0, 0), (0.5, 2.5), (2, 2.5), (2, 0), (5, 0), (5, 2.5), (7.5, 2.5), (7.5, 0)])
    run = simulate(room, path, 1)
    errors = wall_errors(solve(run, FREE), run.walls)
    # walls 7 and 9 are the faces of the thin one; wall 2 is the leaf, in front of which the middle of the wall lies too
    assert sorted(k for k, *_ in errors) == [2, 2, 5, 6, 7, 9, 11]
    leaf, wall = sorted((e for e in errors if e[0] == 2), key=lambda e: abs(e[1]))
    for _, offset, angle, line in [e for e in errors if e is not wall]:
        assert abs(offset) < 4 * line.sigma_offset + 0.001 and abs(angle) < 4 * line.sigma_angle
    assert wall[1] == pytest.approx(0.06, abs=0.005)
    assert len(wall[3].intervals) == 2
    np.testing.assert_allclose(wall[3].intervals[:, 1] - wall[3].intervals[:, 0], [5.0, 4.0], atol=0.1)
    np.testing.assert_allclose(np.diff(leaf[3].intervals), [[1.0]], atol=0.1)


def with_images(run: Drive, wall: Array, scans: range) -> Drive:
    """The wall (2, 2) also seen in an image at each of `scans`, 3 cm and 1 degree sure."""
    rng = np.random.default_rng(5)
    ends = []
    for k in scans:
        pose = run.truth[k]
        seen = apply2(between2(pose, np.zeros(3)), wall)
        seen = seen + rng.normal() * 0.03 * np.array([-np.sin(-pose[2]), np.cos(-pose[2])])
        ends.append(seen)
    covariance = np.broadcast_to(np.diag([0.03**2, np.radians(1) ** 2]), (len(ends), 2, 2))
    images = WallObservations(np.array(scans), np.array(ends), covariance, np.arange(len(ends)))
    return replace(run, observations=WallObservations.concatenate([run.observations, images]))


@pytest.mark.parametrize(("images", "expected"), [(2, 0), (6, 1)])
def test_images_add_walls_beyond_the_scanner(images: int, expected: int) -> None:
    """The end wall of a corridor longer than the LiDAR's range, seen in three images or more."""
    walls = np.array([[[-50.0, -1], [40, -1]], [[40, -1], [40, 1]], [[40, 1], [-50, 1]]])
    run = simulate(walls, drive([(0, 0), (6, 0)]), 3)
    estimate = solve(with_images(run, run.walls[1], range(2, 2 + images)))
    seen = [w for w in estimate.walls if w.source == "image"]
    assert len(seen) == expected
    for wall in seen:
        assert abs(wall.pose[0] - 40) < 3 * wall.sigma_offset < 0.2
        assert wall.observations == images


def test_nothing_to_see() -> None:
    """Without a segment the motions alone remain, and one scan alone is one pose."""
    none = WallObservations(np.zeros(0, np.int64), np.zeros((0, 2, 2)), np.zeros((0, 2, 2)), np.zeros(0, np.int64))
    relative = np.tile([0.1, 0.0, 0.05], (4, 1))
    chain = [np.zeros(3)]
    for step in relative:
        chain.append(compose2(chain[-1], step))
    motion = Motion(relative, np.tile(np.eye(3) * 1e-4, (4, 1, 1)))
    estimate = solve_graph(Trajectory(np.arange(5.0), np.array(chain)), motion, none)
    assert estimate.walls == ()
    np.testing.assert_allclose(estimate.trajectory.poses, chain, atol=1e-6)
    np.testing.assert_allclose(estimate.pose_sigmas[1:, 2], 0.01 * np.sqrt(np.arange(1, 5)), rtol=1e-3)
    single = simulate(ROOM, np.zeros((1, 3)), 0)
    alone = solve_graph(single.start, Motion(np.zeros((0, 3)), np.zeros((0, 3, 3))), single.observations)
    assert len(alone.walls) == len(set(single.wall_of))
    for _, offset, angle, wall in wall_errors(alone, single.walls):
        assert abs(offset) < 4 * wall.sigma_offset and abs(angle) < 4 * wall.sigma_angle


def test_the_same_input_gives_the_same_bytes() -> None:
    run = simulate(ROOM, drive([(0, 0), (4, 0)]), 2)
    first, second = solve(run), solve(run)
    assert first.trajectory.poses.tobytes() == second.trajectory.poses.tobytes()
    assert [w.pose.tobytes() for w in first.walls] == [w.pose.tobytes() for w in second.walls]
