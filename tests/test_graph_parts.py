"""The pieces of the graph on their own: lines, merging, right angles, stretches, information, covariances."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from graph_drive import MOTION_SIGMA, drive, polygon, simulate
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from recon.config import LidarConfig
from recon.geometry import Array, apply2, between2, compose2, wrap_angle
from recon.graph.covariance import Covariance
from recon.graph.edges import Edges
from recon.graph.intervals import covered, union
from recon.graph.line import Lines, carry, squared_distance
from recon.graph.linear import LinearGraph
from recon.graph.merge import join, merge_labels
from recon.graph.motion import Motion, information_beyond_walls
from recon.graph.observation import WallObservations
from recon.graph.optimise import optimise, repetition
from recon.graph.problem import Problem, build
from recon.graph.relations import find_axes
from recon.graph.solve import solve_graph
from recon.lidar.noise import with_noise
from recon.lidar.split_and_merge import extract_segments
from recon.sequence.folder import read_sequence

numbers = st.floats(-5, 5)


@settings(deadline=None)
@given(numbers, numbers, numbers, st.floats(-0.1, 0.1), st.floats(0.001, 0.1), st.floats(0.001, 0.1))
def test_distance_does_not_depend_on_where_along_the_line(
    first: float, second: float, offset: float, angle: float, across: float, turn: float
) -> None:
    covariance = carry(np.diag([across**2, turn**2]), np.asarray(first))
    here = squared_distance(np.asarray(offset), np.asarray(angle), covariance)
    moved = carry(covariance, np.asarray(second))
    there = squared_distance(np.asarray(offset + second * angle), np.asarray(angle), moved)
    assert there == pytest.approx(float(here), rel=1e-4, abs=1e-6)


def line(x: float, y: float, angle: float, half: float, sigma: tuple[float, float] = (0.001, 0.001)) -> Lines:
    return Lines(np.array([[x, y]]), np.array([angle]), np.array([half]), np.diag(np.square(sigma))[None])


def apart(first: NDArray[np.int64], second: NDArray[np.int64]) -> Array:
    """Covariances between walls that know nothing of one another."""
    return np.zeros((len(first), 2, 2))


@pytest.mark.parametrize(
    ("other", "one"),
    [
        (line(3.0, 0.0005, 0.0005, 1.0), True),  # goes on behind a door
        (line(1.0, 0.006, 0.001, 1.0), True),  # overlaps, a few mm off
        (line(3.0, 0.06, 0.0, 0.5), False),  # a leaf 6 cm behind
        (line(1.0, 0.03, 0.0, 1.0), False),
        (line(1.0, 0.0, np.pi, 1.0), False),  # the other face
        (line(9.0, 0.0, 0.0, 1.0), False),  # another wall in line, far away
        (line(2.5, 0.0, 0.05, 1.0), False),  # another direction
        (line(2.6, 0.0, 0.02, 0.2, (0.05, 0.1)), False),  # beside it, but known too badly to say
    ],
)
def test_what_is_one_wall(other: Lines, one: bool) -> None:
    walls = Lines.concatenate([line(0.0, 0.0, 0.0, 1.5), other])
    labels = merge_labels(walls, apart)
    assert (labels[0] == labels[1]) == one


def test_a_vague_piece_does_not_join_a_wall_and_a_recess() -> None:
    pieces = [line(0, 0, 0, 1.5), line(2.3, 0.06, 0, 0.5), line(1.6, 0.03, 0.0, 0.2, (0.02, 0.2))]
    walls = Lines.concatenate(pieces)
    labels = merge_labels(walls, apart)
    assert labels[0] != labels[1]


@settings(deadline=None)
@given(st.floats(-3, 3), st.floats(-3, 3), st.floats(-3.1, 3.1))
def test_joining_pieces_of_one_line_gives_the_line(x: float, y: float, yaw: float) -> None:
    along = np.array([-2.0, 0.5, 3.0])
    middle = np.array([x, y]) + along[:, None] * [np.cos(yaw), np.sin(yaw)]
    covariance = np.diag([1e-6, 1e-4])[None].repeat(3, 0)
    walls = Lines(middle, np.full(3, yaw), np.array([0.5, 0.3, 1.0]), covariance)
    joined = join(walls, np.zeros(3, np.int64))
    centre = np.array([x, y]) + 0.75 * np.array([np.cos(yaw), np.sin(yaw)])
    np.testing.assert_allclose(joined.middle, [centre], atol=1e-9)
    np.testing.assert_allclose(np.abs(wrap_angle(joined.angle - yaw)), 0, atol=1e-9)
    assert joined.half[0] == pytest.approx(3.25)
    # three points on a line fix its direction far better than one piece does
    assert joined.covariance[0, 1, 1] == pytest.approx(1 / (3e4 + 1e6 * np.sum((along - along.mean()) ** 2)), rel=1e-6)


def axes_of(degrees: list[float], sigma: float, lengths: list[float] | None = None) -> list[list[int]]:
    n = len(degrees)
    found = find_axes(np.radians(degrees), np.full(n, sigma), np.eye(n) * sigma**2, np.array(lengths or [4.0] * n))
    return [axis.members.tolist() for axis in found]


def test_axes_take_only_walls_that_are_right() -> None:
    assert axes_of([10, 100.05, -170.02, 280], 0.001) == [[0, 1, 2, 3]]
    assert axes_of([10, 100, 188.0, 280, 11.5], 0.001) == [[0, 1, 3]]
    assert axes_of([0, 20, 45, 71, 100], 0.001) == []  # nothing in common
    assert axes_of([0, 90, 180, 270], 0.02) == []  # known too badly to tell
    assert axes_of([0, 90, 180, 33, 123, 213], 0.001) == [[0, 1, 2], [3, 4, 5]]  # two wings
    assert axes_of([0, 90, 33, 123, 57], 0.001) == []  # pairs are chance
    assert axes_of([0, 90, 180, 40, 60, 75], 0.001, [1, 1, 1, 9, 9, 9]) == []  # too little of the building


def test_scatter_of_an_axis_is_that_of_its_walls() -> None:
    rng = np.random.default_rng(0)
    angles = np.radians(rng.integers(0, 4, 40) * 90) + rng.normal(size=40) * 0.003
    (axis,) = find_axes(angles, np.full(40, 0.0005), np.eye(40) * 0.0005**2, np.full(40, 3.0))
    assert len(axis.members) >= 38
    assert 0.002 < axis.scatter < 0.004


@settings(max_examples=50, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 30), st.integers(1, 9)), min_size=1, max_size=8), st.integers(1, 3))
def test_covered_counts_cells(spans: list[tuple[int, int]], need: int) -> None:
    """Against counting on a grid."""
    intervals = np.array([(low, low + length) for low, length in spans], dtype=float)
    cells = np.arange(45) + 0.5
    inside = ((cells[:, None] > intervals[:, 0]) & (cells[:, None] < intervals[:, 1])).sum(axis=1) >= need
    found = covered(intervals, need)
    np.testing.assert_array_equal(((cells[:, None] > found[:, 0]) & (cells[:, None] < found[:, 1])).any(axis=1), inside)
    assert np.all(np.diff(found.reshape(-1)) >= 0)


def test_union_closes_small_gaps() -> None:
    parts = [np.array([[0.0, 1.0], [1.1, 2.0]]), np.array([[3.0, 4.0]])]
    np.testing.assert_array_equal(union(parts, 0.15), [[0.0, 2.0], [3.0, 4.0]])


@settings(deadline=None)
@given(arrays(float, 3, elements=st.floats(-0.5, 0.5)))
def test_matches_keep_only_what_walls_do_not_say(relative: Array) -> None:
    """A match of points on two parallel walls and one corner post keeps the post."""
    motion = Motion(relative[None], np.zeros((1, 3, 3)))
    ends = np.array([[[3.0, -1.0], [-1.0, -1.0]], [[-1.0, 1.0], [3.0, 1.0]]])[:, ::-1]
    both = np.concatenate([ends, ends])
    covariance = np.tile(np.diag([1e-6, 1e-6]), (4, 1, 1))
    seen = WallObservations(np.array([0, 0, 1, 1]), both, covariance, np.full(4, -1))
    labels = np.array([0, 1, 0, 1])
    c, s = np.cos(relative[2]), np.sin(relative[2])
    u, n = np.array([c, s]), np.array([-s, c])
    walls = sum(1e6 * np.outer(j, j) for y in (-1, 1) for j in ([*(n * y), 1.0 * y], [0.0, 0.0, 1.0]))
    post = 1e4 * np.outer([*u, 0.0], [*u, 0.0])
    total = walls + post
    left = information_beyond_walls(Motion(relative[None], np.asarray(np.linalg.inv(total))[None]), seen, labels)[0]
    # along the corridor all of the post's information stays; across it and in heading next to nothing
    assert u @ left[:2, :2] @ u == pytest.approx(1e4, rel=0.02)
    assert n @ left[:2, :2] @ n < 0.01 * (n @ total[:2, :2] @ n)
    assert left[2, 2] < 0.01 * total[2, 2]
    assert len(motion) == 1


def test_covariances_are_those_of_gtsam() -> None:
    gtsam: Any = pytest.importorskip("gtsam")
    run = simulate(polygon([(-1, -1), (4, -1.5), (4, 3), (-1, 2)]), drive([(0, 0), (2, 0.5)]), 0)
    first = np.unique(run.wall_of, return_index=True)[1]
    seen = Lines.of_observations(run.observations, run.truth)
    labels = np.searchsorted(np.unique(run.wall_of), run.wall_of)
    problem = Problem(run.truth, run.motion, run.observations, labels, seen[first])
    solution, factors = optimise(problem, True), build(problem, False).factors
    values = gtsam.Values()
    for key, pose in enumerate(np.concatenate([solution.poses, solution.walls])):
        values.insert(key, gtsam.Pose2(*pose))
    marginals = gtsam.Marginals(factors, values)
    variables = len(solution.poses) + len(solution.walls)
    blocks = solution.covariance.blocks()
    for number in range(variables):
        np.testing.assert_allclose(blocks[number], marginals.marginalCovariance(number), rtol=1e-4, atol=1e-12)
    # all that the graph knows is as many numbers as it has unknowns
    pull = LinearGraph(factors.linearize(values), variables).random_pull(np.arange(factors.size()), 64)
    assert solution.covariance.leverage(pull) == pytest.approx(3 * variables, rel=0.15)


def test_sparse_covariances_are_the_dense_ones(monkeypatch: pytest.MonkeyPatch) -> None:
    """Blocks, blocks between variables and what an unknown scale adds, with a closure that ties far poses together."""
    run = simulate(polygon([(-1, -1), (4, -1.5), (4, 3), (-1, 2)]), drive([(0, 0), (2, 0.5), (0, 0)]), 0)
    names, labels = np.unique(run.wall_of, return_inverse=True)
    first = np.unique(labels, return_index=True)[1]
    walls = Lines.of_observations(run.observations, run.truth)[first]
    end, sigma = len(run.truth) - 1, np.array([0.01, 0.01, 0.002])
    again = between2(run.truth[0], run.truth[end])[None]
    closures = Edges(np.array([0]), np.array([end]), again, np.diag(sigma**2)[None])
    problem = Problem(run.truth, run.motion, run.observations, labels, walls, closures=closures)
    graph, count = build(problem, False), len(run.truth) + len(names)
    linear = graph.factors.linearize(graph.initial)
    root, covariance = linear.jacobian()[0], Covariance(LinearGraph(linear, count))
    change, factors = np.random.default_rng(0).normal(size=(30, 1)), np.arange(10, 20)
    rows = root[30:60]
    dense = np.linalg.inv(root.T @ root)
    monkeypatch.setattr("recon.graph.linear.PIECE", 3)
    pull = LinearGraph(linear, count).pull(factors, change)
    np.testing.assert_allclose(pull, rows.T @ change, rtol=1e-9, atol=1e-9 * np.abs(pull).max())
    covariance.add_unknown(pull, 0.1)
    moved = 0.1 * dense @ rows.T @ change[:, 0]
    dense = dense + np.outer(moved, moved)
    one, other = (k.reshape(-1) for k in np.meshgrid(np.arange(count), np.arange(count)))
    blocks = dense.reshape(count, 3, count, 3)
    np.testing.assert_allclose(covariance.between(one, other), blocks[one, :, other], rtol=1e-5, atol=1e-11)
    own = np.arange(count)
    np.testing.assert_allclose(covariance.blocks(), blocks[own, :, own], rtol=1e-5, atol=1e-11)


def test_errors_that_segments_share_are_seen() -> None:
    """Independent noise is taken as such; where every wall's segments are off together for a while, it shows."""
    run = simulate(polygon([(-1, -1), (9, -1.5), (9, 3), (-1, 2)]), drive([(0, 0), (8, 0.5), (0, 0)]), 0)
    labels = np.unique(run.wall_of, return_inverse=True)[1]
    first = np.unique(labels, return_index=True)[1]
    walls = Lines.of_observations(run.observations, run.truth)[first]
    problem = Problem(run.truth, run.motion, run.observations, labels, walls)
    alone = repetition(problem, optimise(problem, True))
    np.testing.assert_array_less(alone, 1.4)
    rng, bend = np.random.default_rng(1), np.zeros(len(labels))
    for wall in range(len(first)):
        rows = np.flatnonzero(labels == wall)
        bend[rows] = np.repeat(rng.normal(size=len(rows) // 8 + 1), 8)[: len(rows)] * 0.01
    ends = run.observations.endpoints
    across = ends[:, 1] - ends[:, 0]
    angle = bend[:, None] * [[-1.0, 1.0]] / 2
    normal = np.stack([-across[:, 1], across[:, 0]], axis=1)
    turned = WallObservations(
        run.observations.pose,
        ends + angle[:, :, None] * normal[:, None],
        run.observations.covariance + np.diag([0.0, 0.01**2]),
        run.observations.image,
    )
    problem = Problem(run.truth, run.motion, turned, labels, walls)
    assert 2.5 < repetition(problem, optimise(problem, True))[1] < 16


def test_corridor(shared_data: Any) -> None:
    """Path-traced corridor, poses drifting as a scan matcher without a map would: millimetres remain."""
    sequence = read_sequence(shared_data("corridor"))
    truth = np.loadtxt(Path(shared_data("corridor")) / "groundtruth" / "trajectory.txt")
    true = np.column_stack([truth[:, 1:3], 2 * np.arctan2(truth[:, 6], truth[:, 7])])
    np.testing.assert_allclose(truth[:, 0], sequence.scans.timestamps, atol=1e-3)
    lidar = with_noise(sequence.scans, LidarConfig())
    segments = [extract_segments(sequence.scans, i, lidar) for i in range(len(sequence.scans))]
    observations = WallObservations(
        np.concatenate([np.full(len(s), i) for i, s in enumerate(segments)]),
        np.concatenate([s.endpoints for s in segments]),
        np.concatenate([s.covariance for s in segments]),
        np.full(sum(len(s) for s in segments), -1),
    )
    relative = between2(true[:-1], true[1:]) + np.random.default_rng(1).normal(size=(95, 3)) * MOTION_SIGMA
    chain = [np.zeros(3)]
    for step in relative:
        chain.append(compose2(chain[-1], step))
    motion = Motion(relative, np.tile(np.diag(MOTION_SIGMA**2), (95, 1, 1)))
    start = type(sequence.odometry)(sequence.scans.timestamps, np.array(chain))  # type: ignore[misc]
    estimate = solve_graph(start, motion, observations, sequence.odometry)
    assert np.hypot(*(np.array(chain) - true)[:, :2].T).max() > 0.1
    assert np.hypot(*(estimate.trajectory.poses - true)[:, :2].T).max() < 0.01
    assert estimate.odometry_scale == pytest.approx(0.991, abs=0.004)
    longest = sorted(estimate.walls, key=lambda w: -np.diff(w.intervals[[0, -1]].reshape(-1)[[0, 3]])[0])[:4]
    assert [round(float(w.intervals[-1, 1] - w.intervals[0, 0])) for w in longest] == [14, 12, 9, 6]
    ends = apply2(longest[0].pose, np.column_stack([longest[0].intervals[[0, -1], [0, 1]], np.zeros(2)]))
    np.testing.assert_allclose(ends, [[-1.408, -0.916], [12.566, -1.764]], atol=0.05)
