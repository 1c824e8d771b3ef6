"""Loop closure: the search, the choice of what is right, and whole drives with known truth."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scan_drive import FULL, OFFICE, cast_scans, polygon, wheel_odometry

from recon.config import LidarConfig
from recon.evaluate.trajectory import trajectory_errors
from recon.geometry import Array, apply2, between2, compose2, wrap_angle
from recon.graph.edges import Edges
from recon.lidar.cloud import Cloud
from recon.lidar.clouds import Clouds
from recon.lidar.matching import match_scans
from recon.loops.agreement import agreeing
from recon.loops.branch_and_bound import search
from recon.loops.close import close_loops
from recon.loops.drift import Drift, chain_between
from recon.loops.grid import CELL, build_pyramid
from recon.loops.pose_graph import BARC, solve, solve_consistent
from recon.loops.search import CANDIDATES, LoopSearch
from recon.loops.submap import make_submaps
from recon.loops.ties import VISITS
from recon.simulate import office_plan, simulate_scans

Ints = NDArray[np.int64]


def outline(walls: Array, spacing: float = 0.1) -> Array:
    """Points (n, 2) along walls (W, 2, 2)."""
    steps = [np.linspace(0, 1, max(2, int(np.linalg.norm(b - a) / spacing)))[:, None] for a, b in walls]
    return np.concatenate([a + s * (b - a) for (a, b), s in zip(walls, steps, strict=True)])


def exhaustive(xy: Array, grid: Array, corner: Array, guess: Array, shifts: int, turns: Array) -> float:
    """Best mean likelihood over all shifts and turns, one by one."""
    best = 0.0
    for turn in turns:
        cells = np.floor((apply2([guess[0], guess[1], guess[2] + turn], xy) - corner) / CELL).astype(int)
        for du in range(-shifts, shifts + 1):
            for dv in range(-shifts, shifts + 1):
                u, v = cells[:, 0] + du, cells[:, 1] + dv
                inside = (u >= 0) & (v >= 0) & (u < grid.shape[0]) & (v < grid.shape[1])
                best = max(best, float(grid[u[inside], v[inside]].sum()) / (255.0 * len(xy)))
    return best


@settings(max_examples=8, deadline=None)
@given(st.integers(0, 1000))
def test_branch_and_bound_finds_what_trying_everything_finds(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = outline(OFFICE) + rng.normal(0, 0.02, (len(outline(OFFICE)), 2))
    pyramid = build_pyramid(points)
    grid = pyramid.levels[0, pyramid.pad :, pyramid.pad :].astype(float)
    pose = np.array([4.0, 3.0, rng.uniform(-3, 3)])
    xy = apply2(between2(pose, np.zeros(3)), points[rng.permutation(len(points))[:60]])
    guess = pose + rng.uniform(-1, 1, 3) * [0.8, 0.8, 0.1]
    found = search(xy, pyramid, guess, np.array([1.0, 0.15]), 0.1)
    assert found is not None
    reach = max(2.0, float(np.percentile(np.hypot(*xy.T), 90)))
    turns = np.asarray(
        np.arange(-int(0.15 * reach / CELL), int(0.15 * reach / CELL) + 1) * CELL / reach, dtype=np.float64
    )
    assert found.score == pytest.approx(exhaustive(xy, grid, pyramid.corner, guess, 11, turns), abs=1e-9)
    assert np.abs(found.pose[:2] - pose[:2]).max() < 0.25


def test_the_second_best_place_is_another_one() -> None:
    """A row of equal niches: the niches 2 m and 4 m away look the same."""
    niches = np.concatenate([polygon((x, 0), (x + 0.6, 0), (x + 0.6, 1), (x, 1)) for x in np.arange(0, 12, 2.0)])
    pyramid, xy = build_pyramid(outline(niches)), outline(niches[8:16]) - [6.0, 0.5]
    best = search(xy, pyramid, np.array([6.0, 0.5, 0.0]), np.array([3.0, 0.1]), 0.3)
    assert best is not None and best.score > 0.7
    other = search(xy, pyramid, np.array([6.0, 0.5, 0.0]), np.array([3.0, 0.1]), 0.3, best)
    assert other is not None
    apart = np.linalg.norm(other.pose[:2] - best.pose[:2])
    assert apart > 1.5 and apart / 2.0 == pytest.approx(round(apart / 2.0), abs=0.1)
    assert other.score > 0.85 * best.score


def ring_of_poses(rng: np.random.Generator, laps: int = 3, count: int = 40) -> tuple[Array, Edges, Edges]:
    """True poses of `laps` rounds, the drifting chain, and right closures from each lap to the one before."""
    angle = np.arange(laps * count) * 2 * np.pi / count
    true = np.column_stack([20 * np.cos(angle), 20 * np.sin(angle), wrap_angle(angle + np.pi / 2)])
    sigma = np.array([0.02, 0.02, 0.004])
    numbers = np.arange(len(true), dtype=np.int64)

    def measured(first: Ints, second: Ints, sigma: Array) -> Edges:
        relative = between2(true[first], true[second]) + rng.normal(size=(len(first), 3)) * sigma
        return Edges(first, second, relative, np.tile(np.diag(sigma**2), (len(first), 1, 1)))

    chain = measured(numbers[:-1], numbers[1:], sigma)
    later = numbers[count + 2 :: 2]
    return true, chain, measured(later - count, later, np.array([0.03, 0.03, 0.006]))


def chained(edges: Edges, start: Array) -> Array:
    poses = [start]
    for step in edges.relative:
        poses.append(compose2(poses[-1], step))
    return np.array(poses)


@pytest.mark.parametrize("seed", range(3))
def test_planted_wrong_closures_are_rejected_as_a_set(seed: int) -> None:
    """A third of all closures is wrong: lone ones, and a row that agree with one another (a corridor that looks the
    same elsewhere)."""
    rng = np.random.default_rng(seed)
    true, chain, right = ring_of_poses(rng)
    start = chained(chain, true[0])
    first, second = rng.integers(0, 40, 14), rng.integers(60, 120, 14)
    lone = Edges(first, second, rng.uniform(-3, 3, (14, 3)), np.tile(right.covariance[:1], (14, 1, 1)))
    row = np.arange(6)
    shifted = compose2(between2(true[5 + row], true[55 + row]), [2.0, 0.0, 0.0])
    alias = Edges(5 + row, 55 + row, shifted, np.tile(right.covariance[:1], (6, 1, 1)))
    closures = Edges.concatenate([right, lone, alias])
    wrong = np.arange(len(closures)) >= len(right)
    likely = agreeing(closures, start, np.arange(len(true), dtype=np.float64) * np.pi)
    assert likely[~wrong].mean() > 0.95
    poses, kept = solve_consistent(start, chain, closures[likely])
    assert not kept[wrong[likely]].any()
    assert kept[~wrong[likely]].mean() > 0.95
    assert (
        np.linalg.norm((poses - true)[:, :2], axis=1).max() < 0.25 < np.linalg.norm((start - true)[:, :2], axis=1).max()
    )


def test_solving_without_closures_changes_nothing() -> None:
    true, chain, _ = ring_of_poses(np.random.default_rng(0), 1)
    start = chained(chain, true[0])
    np.testing.assert_allclose(solve(start, chain, Edges.none()), start, atol=1e-6)
    poses, kept = solve_consistent(start, chain, Edges.none())
    assert len(kept) == 0 and poses is start


def test_the_drift_is_that_of_the_chain_and_closures_end_it() -> None:
    """Monte Carlo: the spread of the last pose, and after a closure that of the short way."""
    true, chain, closures = ring_of_poses(np.random.default_rng(0))
    ends = []
    for seed in range(300):
        noise = np.random.default_rng(seed).normal(size=(len(chain), 3)) * [0.02, 0.02, 0.004]
        relative = between2(true[:-1], true[1:]) + noise
        ends.append(chained(Edges(chain.first, chain.second, relative, chain.covariance), true[0])[25])
    spread = np.var(np.array(ends) - true[25], axis=0)
    found = Drift(len(true), chain).spread(0, true, np.inf, np.array([25, 42]))
    assert found[0, 0] == pytest.approx(spread[0] + spread[1], rel=0.6)
    assert found[0, 1] == pytest.approx(spread[2], rel=0.25)
    composed, covariance = chain_between(between2(true[:-1], true[1:]), chain.covariance, np.array([0, 25]))
    np.testing.assert_allclose(composed[0], between2(true[0], true[25]), atol=1e-9)
    assert np.trace(covariance[0, :2, :2]) == pytest.approx(spread[0] + spread[1], rel=0.25)
    closed = Drift(len(true), Edges.concatenate([chain, closures])).spread(42, true, np.inf, np.array([2]))
    assert closed[0, 0] < 0.01 < found[1, 0]
    assert np.isinf(Drift(len(true), chain).spread(0, true, 0.01, np.array([42]))).all()


def drive(corners: list[tuple[float, float]], step: float = 0.15) -> Array:
    """(N, 3) poses along a way with rounded corners."""
    points = np.array(corners, dtype=float)
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    at = np.arange(0.0, way[-1], step)
    xy = np.stack([np.interp(at, way, points[:, k]) for k in (0, 1)], axis=1)
    smooth = np.stack([np.convolve(np.pad(c, 3, mode="edge"), np.full(7, 1 / 7), mode="valid") for c in xy.T], axis=1)
    heading = np.unwrap(np.arctan2(*np.gradient(smooth, axis=0).T[::-1]))
    return np.column_stack([smooth, heading])


def ring_corridor(niche: float) -> Array:
    """A corridor 2 m wide around a block of 20 m x 14 m, each side alike: equal niches every 4 m; one more, of 1.5 m x
    `niche`, somewhere."""

    def side(length: float, odd: bool) -> list[tuple[float, float]]:
        out = [(0.0, 0.0)]
        for x in np.arange(2.0, length - 1.5, 4.0):
            out += [(x, 0.0), (x, -0.3), (x + 1.0, -0.3), (x + 1.0, 0.0)]
            if odd and x == 6.0 and niche > 0:
                out += [(x + 1.5, 0.0), (x + 1.5, -niche), (x + 3.0, -niche), (x + 3.0, 0.0)]
        return out

    corners, lengths = [(0.0, 0.0), (24.0, 0.0), (24.0, 18.0), (0.0, 18.0)], [24.0, 18.0, 24.0, 18.0]
    outer = []
    for k, (corner, length) in enumerate(zip(corners, lengths, strict=True)):
        pose = np.array([*corner, k * np.pi / 2])
        outer += [tuple(p) for p in apply2(pose, np.array(side(length, k == 0)))]
    inner = [(2.0, 2.0), (2.0, 16.0), (22.0, 16.0), (22.0, 2.0)]
    return np.concatenate([polygon(*outer), polygon(*inner)])


ROUND = [(1.0, 1.0), (23.0, 1.0), (23.0, 17.0), (1.0, 17.0)]


@pytest.mark.parametrize("niche", [0.0, 1.2])
def test_a_self_similar_ring_closes_rightly(niche: float) -> None:
    """One and a half rounds with odometry that loses 4 degrees a round: afterwards the second round lies on the first;
    no side is taken for another, no niche for the next one."""
    true = drive([*ROUND, *ROUND[:3]])
    scans = cast_scans(ring_corridor(niche), true, 180, FULL, sigma=0.01, reach=8.0)
    matching = match_scans(scans, wheel_odometry(scans.timestamps, true, 1.01, 0.0009), LidarConfig())
    closed = close_loops(scans, matching, LidarConfig())
    true = between2(true[0], true)
    before = np.linalg.norm(matching.trajectory.poses[:, :2] - true[:, :2], axis=1)
    after = np.linalg.norm(closed.trajectory.poses[:, :2] - true[:, :2], axis=1)
    assert len(closed.closures) > 5
    error = between2(true[closed.closures.first], true[closed.closures.second]) - closed.closures.relative
    assert np.linalg.norm(error[:, :2], axis=1).max() < 0.3
    assert after.max() < max(0.25, 0.7 * before.max())


def test_rooms_that_are_all_alike_are_told_apart_without_odometry() -> None:
    """Empty rooms of one size with their doors in the same place, wall to wall along corridors that look the same."""
    scans, truth, _ = simulate_scans(office_plan(5, 24, 200.0, variety=0.0, clutter=0.0), 5)
    closed = close_loops(scans, match_scans(scans, None, LidarConfig()), LidarConfig())
    assert len(closed.closures) > 20 and len(closed.ties) > 500
    assert closed.closures.residuals(truth.poses).max() < BARC
    assert closed.ties.residuals(truth.poses).max() < BARC
    assert trajectory_errors(closed.trajectory, truth).ate < 0.02


def test_a_place_visited_often_is_searched_for_a_few_times() -> None:
    """Rounds of the same hall: however many came before, a submap is looked for in a bounded number of older ones."""
    laps = drive([*ROUND] * 24, 0.4)
    scans = np.arange(len(laps))
    empty = Cloud(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0, np.bool_), np.zeros(0))
    submaps = make_submaps(scans, Clouds.pack(empty for _ in scans), laps)
    nodes = laps[submaps.anchor_scans]
    numbers = np.arange(len(nodes))
    steps = between2(nodes[:-1], nodes[1:])
    chain = Edges(numbers[:-1], numbers[1:], steps, np.tile(np.diag([1e-4, 1e-4, 1e-6]), (len(steps), 1, 1)))
    found = LoopSearch(submaps, laps, chain, LidarConfig()).candidates(2.0)
    counts = np.bincount([c.second for c in found], minlength=len(nodes))
    assert counts[-20:].min() >= 3 and counts.max() <= CANDIDATES
    assert all(c.first < c.second for c in found)
    assert np.array_equal([between2(nodes[c.first], nodes[c.second]) for c in found], [c.guess for c in found])


def test_keyframes_are_tied_to_a_few_visits_and_threads_change_nothing() -> None:
    true = drive([*ROUND, *ROUND[:3]], 0.3)
    scans = cast_scans(ring_corridor(1.2), true, 180, FULL, sigma=0.01, reach=8.0)
    matching = match_scans(scans, wheel_odometry(scans.timestamps, true, 1.0, 0.0002), LidarConfig())
    one, two = (close_loops(scans, matching, LidarConfig(), workers) for workers in (1, 2))
    for name in ("closures", "ties"):
        a, b = getattr(one, name), getattr(two, name)
        assert np.array_equal(a.relative, b.relative) and np.array_equal(a.first, b.first) and len(a) > 5
    assert np.array_equal(one.trajectory.poses, two.trajectory.poses)
    assert np.bincount(one.ties.second).max() <= VISITS


def test_packed_clouds_move_as_single_ones() -> None:
    rng = np.random.default_rng(0)
    clouds = []
    for n in (4, 0, 7):
        angle = rng.uniform(-3, 3, n)
        normals = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        clouds.append(Cloud(rng.normal(size=(n, 2)) * 5, normals, rng.random(n) < 0.5, rng.uniform(10, 1000, n)))
    poses = rng.normal(size=(3, 3)) * [10, 10, 1]
    packed = Clouds.pack(iter(clouds)).moved(1, 3, poses[1:])
    single = Cloud.concatenate([c.moved(p) for c, p in zip(clouds[1:], poses[1:], strict=True)])
    np.testing.assert_allclose(packed.xy, single.xy, atol=1e-5)
    np.testing.assert_allclose(packed.normals, single.normals, atol=1e-6)
    np.testing.assert_allclose(packed.information, single.information, rtol=1e-6)
    assert np.array_equal(packed.flat, single.flat)


def test_a_drive_that_visits_nothing_twice_stays_as_it_is() -> None:
    true = drive([(-20.0, 0.0), (20.0, 0.0)])
    hall = polygon((-24, -1.1), (24, -1.1), (24, 1.1), (3, 1.1), (3, 3), (2, 3), (2, 1.1), (-24, 1.1))
    scans = cast_scans(hall, true, 180, FULL, sigma=0.01, reach=8.0)
    matching = match_scans(scans, wheel_odometry(scans.timestamps, true, 1.0, 0.0), LidarConfig())
    closed = close_loops(scans, matching, LidarConfig())
    assert len(closed.closures) == 0 and closed.trajectory is matching.trajectory
