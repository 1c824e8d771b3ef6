"""The filter over wall lines: poses, walls and honest sigmas from simulated drives, and a bounded state."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from graph_drive import Drive, drive, polygon, simulate
from hypothesis import given
from hypothesis import strategies as st
from test_graph import CORRIDORS, ROOM, U_TURN, odometry_of, solve, wall_errors, with_images

from recon.config import Config, GraphConfig
from recon.config_file import load_config, to_toml
from recon.geometry import Array, apply2, between2, compose2, wrap_angle
from recon.graph import ekf
from recon.graph.ekf import solve_filter
from recon.graph.estimate import MapEstimate
from recon.graph.filter_state import FilterState, Pairing
from recon.graph.line import Lines
from recon.graph.motion import Motion
from recon.graph.observation import WallObservations
from recon.sequence.trajectory import Trajectory

LOOP = drive([(0, 0), (6, 0), (6.5, 2.5), (4.5, 4)])


def run_filter(run: Drive, odometry: Trajectory | None = None) -> MapEstimate:
    return solve_filter(run.start, run.motion, run.observations, odometry)


def pose_errors(estimate: MapEstimate, truth: Array) -> Array:
    error = estimate.trajectory.poses - truth
    error[:, 2] = wrap_angle(error[:, 2])
    return error


def test_sigmas_are_honest() -> None:
    """Normalised squared errors of poses and walls average a quarter to two: wary, not boastful."""
    poses, offsets, angles = [], [], []
    for seed in range(8):
        run = simulate(ROOM, LOOP, seed)
        estimate = run_filter(run)
        assert len(estimate.walls) == len(ROOM)
        poses.append(np.mean((pose_errors(estimate, run.truth)[1:] / estimate.pose_sigmas[1:]) ** 2, axis=0))
        for _, offset, angle, wall in wall_errors(estimate, run.walls):
            offsets.append((offset / wall.sigma_offset) ** 2)
            angles.append((angle / wall.sigma_angle) ** 2)
    for squared in (*np.mean(poses, axis=0), np.mean(offsets), np.mean(angles)):
        assert 0.25 < squared < 2.0


def test_filter_and_graph_agree() -> None:
    """In a drive without surprises both find the same walls, stretches and poses, to a few millimetres."""
    run = simulate(CORRIDORS, U_TURN, 1)
    filtered, solved = run_filter(run), solve(run, GraphConfig(manhattan=False))
    assert np.abs(filtered.trajectory.poses - solved.trajectory.poses)[:, :2].max() < 0.02
    ours, theirs = (sorted(wall_errors(e, run.walls), key=lambda w: w[0]) for e in (filtered, solved))
    assert [w[0] for w in ours] == [w[0] for w in theirs] == list(range(8))
    for mine, other in zip(ours, theirs, strict=True):
        assert mine[3].observations == pytest.approx(other[3].observations, rel=0.1)
        lengths = [np.diff(w[3].intervals, axis=1).sum() for w in (mine, other)]
        assert lengths[0] == pytest.approx(lengths[1], abs=0.2)


def test_beats_its_motion() -> None:
    """Walls hold the drift of the motions that it starts from."""
    run = simulate(CORRIDORS, U_TURN, 4)
    drift = pose_errors(MapEstimate(run.start, np.zeros((0, 3)), ()), run.truth)
    left = pose_errors(run_filter(run), run.truth)
    assert np.abs(left[:, 2]).max() < 0.2 * np.abs(drift[:, 2]).max()
    assert np.abs(left[:, :2]).max() < 0.25 * np.abs(drift[:, :2]).max()


def test_odometry_holds_where_walls_say_nothing() -> None:
    walls = np.array([[[-50.0, -1], [50, -1]], [[50, 1], [-50, 1]]])
    run = simulate(walls, drive([(0, 0), (10, 0)]), 3)
    noise = np.random.default_rng(0).normal(size=len(run.motion)) * 0.3
    vague = Motion(run.motion.relative + np.outer(noise, [1, 0, 0]), run.motion.covariance + np.diag([0.3**2, 0, 0]))
    run = replace(run, motion=vague)
    way = between2(run.truth[0], run.truth[-1])[0]
    held, free = run_filter(run, odometry_of(run, 1.0, 0)), run_filter(run)
    assert abs(held.trajectory.poses[-1, 0] - way) < 0.4
    assert held.odometry_scale is not None
    assert 0.02 < held.pose_sigmas[-1, 0] < 1.0
    assert free.pose_sigmas[-1, 0] == pytest.approx(np.hypot(0.3, 0.006) * np.sqrt(len(run.motion)), rel=0.1)


def test_gross_outliers_bend_nothing() -> None:
    run = simulate(ROOM, LOOP, 7)
    rng = np.random.default_rng(7)
    ends = run.observations.endpoints.copy()
    for k in np.flatnonzero(rng.random(len(ends)) < 0.1):
        ends[k] = apply2(rng.uniform(-1, 1, 3) * [0.5, 0.5, 0.3], ends[k])
    estimate = run_filter(replace(run, observations=replace(run.observations, endpoints=ends)))
    long = [e for e in wall_errors(estimate, run.walls) if e[3].observations > 10]
    assert {k for k, *_ in long} == set(range(len(ROOM)))
    for _, offset, angle, wall in long:
        assert abs(offset) < 4 * wall.sigma_offset + 0.002
        assert abs(angle) < 4 * wall.sigma_angle + 0.001
    assert np.abs(estimate.trajectory.poses - run.truth)[:, :2].max() < 0.03


def test_two_pieces_of_a_wall_become_one() -> None:
    """A wall seen on both sides of a cupboard, in two pieces, is one line."""
    room = polygon([(-1, -1), (9, -1), (9, 4), (-1, 4)])
    cupboard = np.array([[[3.0, 0.2], [5.0, 0.2]], [[5.0, 0.2], [5.0, -0.9]], [[3.0, -0.9], [3.0, 0.2]]])
    run = simulate(np.concatenate([room, cupboard]), drive([(0, 1), (2, 1.2), (6, 2), (8, 1)]), 2)
    along = [w for k, *_, w in wall_errors(run_filter(run), run.walls) if k == 0]
    assert len(along) == 1
    assert np.diff(along[0].intervals, axis=1).sum() > 7.0


@pytest.mark.parametrize(("images", "expected"), [(2, 0), (6, 1)])
def test_images_add_walls_beyond_the_scanner(images: int, expected: int) -> None:
    walls = np.array([[[-50.0, -1], [40, -1]], [[40, -1], [40, 1]], [[40, 1], [-50, 1]]])
    run = simulate(walls, drive([(0, 0), (6, 0)]), 3)
    estimate = run_filter(with_images(run, run.walls[1], range(2, 2 + images)))
    seen = [w for w in estimate.walls if w.source == "image"]
    assert len(seen) == expected
    for wall in seen:
        assert abs(wall.pose[0] - 40) < 3 * wall.sigma_offset < 0.2
        assert wall.observations == images


def test_state_is_bounded_and_what_it_gives_up_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    run = simulate(CORRIDORS, U_TURN, 1)
    sizes = []
    update = FilterState.update

    def counted(self: FilterState, pairing: Pairing, offset: Array) -> tuple[Array, Array]:
        sizes.append(len(self))
        return update(self, pairing, offset)

    monkeypatch.setattr(FilterState, "update", counted)
    monkeypatch.setattr(ekf, "MAX_WALLS", 4)
    monkeypatch.setattr(ekf, "TIDY_EVERY", 1)
    errors = wall_errors(run_filter(run), run.walls)
    assert max(sizes) <= 4 + 3  # what one scan adds
    assert {k for k, *_ in errors} == set(range(8))
    for _, offset, angle, wall in errors:
        assert abs(offset) < 5 * wall.sigma_offset + 0.002
        assert abs(angle) < 5 * wall.sigma_angle + 0.001


def test_nothing_to_see() -> None:
    """Without a segment the motions alone remain."""
    none = WallObservations(np.zeros(0, np.int64), np.zeros((0, 2, 2)), np.zeros((0, 2, 2)), np.zeros(0, np.int64))
    relative = np.tile([0.1, 0.0, 0.05], (4, 1))
    chain = [np.zeros(3)]
    for step in relative:
        chain.append(compose2(chain[-1], step))
    motion = Motion(relative, np.tile(np.eye(3) * 1e-4, (4, 1, 1)))
    estimate = solve_filter(Trajectory(np.arange(5.0), np.array(chain)), motion, none)
    assert estimate.walls == ()
    np.testing.assert_allclose(estimate.trajectory.poses, chain, atol=1e-9)
    np.testing.assert_allclose(estimate.pose_sigmas[1:, 2], 0.01 * np.sqrt(np.arange(1, 5)), rtol=1e-6)
    single = simulate(ROOM, np.zeros((1, 3)), 0)
    alone = solve_filter(single.start, Motion(np.zeros((0, 3)), np.zeros((0, 3, 3))), single.observations)
    assert {k for k, *_ in wall_errors(alone, single.walls)} == set(single.wall_of)


def test_the_same_input_gives_the_same_bytes() -> None:
    run = simulate(ROOM, drive([(0, 0), (4, 0)]), 2)
    first, second = run_filter(run), run_filter(run)
    assert first.trajectory.poses.tobytes() == second.trajectory.poses.tobytes()
    assert [w.pose.tobytes() for w in first.walls] == [w.pose.tobytes() for w in second.walls]


number = st.floats(-3, 3)


@given(
    pose=st.tuples(number, number, number),
    middle=st.tuples(number, number),
    angle=number,
    nudge=st.lists(st.floats(-1, 1), min_size=5, max_size=5),
)
def test_jacobians(pose: Any, middle: Any, angle: float, nudge: list[float]) -> None:
    """Where a segment lies to its wall changes with pose and wall as the filter's Jacobian says."""
    line = Lines(np.array([middle]), np.array([angle]), np.ones(1), np.eye(2)[None] * 1e-4)
    state = FilterState(np.array(pose))
    state.add(line)
    seen = Pairing(line.middle + 0.1, line.angle + 0.05, line.covariance, np.zeros(1, np.int64))
    before, jacobian, _ = state._linearised(seen)
    change = 1e-5 * np.array(nudge)
    yaw = state.frames[0, 2]
    state.pose = state.pose + change[:3]
    state.frames[0] += [-np.sin(yaw) * change[3], np.cos(yaw) * change[3], change[4]]
    after = state._linearised(seen)[0]
    np.testing.assert_allclose(wrap_angle(after - before)[0], jacobian[0] @ change, atol=1e-8)


def test_backend_is_chosen_in_file_and_on_the_command_line(
    tmp_path: Path, tiny_sequence: Path, run_recon: Callable[..., Any]
) -> None:
    path = tmp_path / "site.toml"
    path.write_text('[graph]\nbackend = "ekf"\n')
    config = load_config(path)
    assert config == replace(Config(), graph=GraphConfig(backend="ekf"))
    assert 'backend = "ekf"' in to_toml(config)
    wrong = run_recon("build", tiny_sequence, "-o", tmp_path / "a.svg", "--backend", "ukf")
    assert wrong.status == 2
    assert "'ukf' is not one of 'graph', 'ekf'" in wrong.errors[-1]
    for arguments in (["--config", path], ["--backend", "ekf"]):
        result = run_recon("build", tiny_sequence, "-o", tmp_path / "room.svg", *arguments)
        assert result.status == 0
        assert any(line.startswith("filter: ") for line in result.errors)
        assert 'backend = "ekf"' in (tmp_path / "room.recon" / "config.toml").read_text()
