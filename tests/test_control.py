"""Surveyed control points: a bent drive is straightened, wrong points are named, the survey's frame is found."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from graph_drive import Drive, drive, polygon, simulate
from hypothesis import given, settings
from hypothesis import strategies as st
from test_tape import LAYOUT, hall_scans, lines

from recon.config import GraphConfig
from recon.control import ControlPoints, contradictions, control_on_layout, read_control
from recon.errors import InputError
from recon.geometry import Array, align2, apply2, compose2, inverse2
from recon.graph.control import Control, agreeing, fitted_frame
from recon.graph.estimate import MapEstimate, Survey
from recon.graph.line import Lines
from recon.graph.solve import solve_graph
from recon.sequence.trajectory import Trajectory
from recon.sequence.write import write_scans

FREE = GraphConfig(manhattan=False)
SURVEY = np.array([412345.6, 5567890.1, 2.1])
"""The true survey_from_map: far away, as surveys count, and turned."""
NO_LINES = Lines(np.zeros((0, 2)), np.zeros(0), np.zeros(0), np.zeros((0, 2, 2)))
NO_IDS = np.zeros(0, np.int64)
ROOM = polygon([(-1, -1.5), (5, -1.5), (5, 2.5), (-1, 2.5)])


def bent_drive(seed: int, bias: float, steps: int = 24) -> Drive:
    """57 m along a corridor whose walls jump every 2.5 m; every step of 0.5 m is measured `bias` rad too far left."""
    rng, walls = np.random.default_rng(seed), []
    for side in (1.0, -1.0):
        y = side * (1.2 + np.where(np.arange(steps) % 2, 0.15, -0.15) + 0.05 * rng.normal(size=steps))
        points = [(2.5 * (k + end) - 2, y[k]) for k in range(steps) for end in (0, 1)]
        ends = list(pairwise(points))
        walls += ends if side < 0 else [(b, a) for a, b in ends]
    way = drive([(0, 0), (2.5 * steps - 6, 0)], step=0.5)
    run = simulate(np.array(walls), way, seed, reach=4.0)
    relative = run.motion.relative + np.array([0, 0, bias])
    poses = [np.zeros(3)]
    for step in relative:
        poses.append(compose2(poses[-1], step))
    return replace(
        run,
        motion=replace(run.motion, relative=relative),
        start=Trajectory(run.start.timestamps, np.array(poses)),
    )


def marks(
    run: Drive, rows: list[int], sigma: float = 0.005, wrong: dict[int, tuple[float, float]] | None = None
) -> Control:
    """Marks under the poses `rows`, surveyed with `sigma`; those in `wrong` are off by so much."""
    position = apply2(SURVEY, run.truth[rows][:, :2]) + np.random.default_rng(5).normal(size=(len(rows), 2)) * sigma
    for k, away in (wrong or {}).items():
        position[k] += away
    scans, names = np.array(rows), tuple(f"mark {k}" for k in rows)
    return Control(
        scans, scans + 1, np.zeros(len(rows)), NO_LINES, NO_LINES, position, np.full(len(rows), sigma), names
    )


def solve(run: Drive, control: Control | None = None) -> MapEstimate:
    return solve_graph(run.start, run.motion, run.observations, None, FREE, control=control)


def in_survey(estimate: MapEstimate, run: Drive) -> Array:
    """(N,) m: how far the poses are from the truth, in the survey's frame."""
    assert estimate.survey is not None
    mine = compose2(estimate.survey.survey_from_map, estimate.trajectory.poses)
    return np.asarray(np.linalg.norm((mine - compose2(SURVEY, run.truth))[:, :2], axis=1))


def test_a_bent_drive_is_straightened() -> None:
    """Bent by a decimetre without the points, by no more than its sigmas with them; frame and residuals are right."""
    run = bent_drive(1, 0.01)
    last = len(run.truth) - 3
    plain = solve(run)
    assert np.linalg.norm(plain.trajectory.poses[-1, :2] - run.truth[-1, :2]) > 0.1
    control = marks(run, [3, last // 3, 2 * last // 3, last])
    held = solve(run, control)
    assert in_survey(held, run).max() < 0.08
    survey = held.survey
    assert survey is not None and survey.kept.all() and survey.off.max() < 4
    assert 0.005 < np.hypot(*survey.sigma[:2]) < 0.2
    normalised = (survey.solved - control.position) / control.sigma[:, None]
    assert 0.05 < np.sqrt(np.mean(normalised**2)) < 2.0
    off = compose2(inverse2(SURVEY), survey.survey_from_map)
    assert abs(off[2]) < 4 * survey.sigma[2]
    assert plain.survey is None


@pytest.mark.parametrize(("count", "wrong"), [(5, {1: (0.5, 0.3)}), (5, {4: (10.0, 3.0)}), (3, {1: (0.0, 3.0)})])
def test_a_wrong_point_is_named_and_left_out(count: int, wrong: dict[int, tuple[float, float]]) -> None:
    run = bent_drive(2, 0.002)
    rows = np.linspace(3, len(run.truth) - 3, count).astype(int).tolist()
    control = marks(run, rows, wrong=wrong)
    held = solve(run, control)
    survey = held.survey
    assert survey is not None
    assert np.flatnonzero(~survey.kept).tolist() == list(wrong)
    assert in_survey(held, run).max() < 0.1
    number = next(iter(wrong))
    miss = np.linalg.norm(survey.solved[number] - control.position[number])
    assert miss == pytest.approx(np.hypot(*wrong[number]), abs=0.1)
    points = ControlPoints(
        run.start.timestamps[rows], NO_IDS, NO_IDS, control.position, control.sigma, ("c.csv",) * count
    )
    (line,) = contradictions(points, survey)
    assert line.startswith(f"c.csv: mark at {run.start.timestamps[rows[number]]:.3f} s: left out, it is ")
    assert "standard deviations" in line


def test_corners_tie_walls_to_the_survey() -> None:
    """All corners of a room, two of them as one each: the room lies where they say, its walls as sharp as they are."""
    run = simulate(ROOM, drive([(0, 0), (3, 0.3)], step=0.6), 3, sigma=0.03)
    plain = solve(run)
    order = [max(range(len(plain.walls)), key=lambda k: float(np.cos(plain.walls[k].pose[2] - a))) for a in
             (0.0, np.pi / 2, np.pi, -np.pi / 2)]  # fmt: skip
    first, second = lines(plain, order), lines(plain, order[1:] + order[:1])
    truth = apply2(
        inverse2(drive([(0, 0), (3, 0.3)], step=0.6)[0]), np.array([(5, -1.5), (5, 2.5), (-1, 2.5), (-1, -1.5)])
    )
    position = apply2(SURVEY, truth)
    names = tuple(f"corner {k}" for k in range(4))
    held = solve(run, Control(NO_IDS, NO_IDS, np.zeros(0), first, second, position, np.full(4, 0.001), names))
    survey = held.survey
    assert survey is not None and survey.kept.all()
    assert np.abs(survey.solved - position).max() < 0.004
    assert in_survey(held, run).max() < 0.03
    offsets = [np.median([w.sigma_offset for w in e.walls]) for e in (plain, held)]
    assert offsets[1] < offsets[0]


@settings(max_examples=30, deadline=None)
@given(x=st.floats(-1e6, 1e6), y=st.floats(-1e6, 1e6), yaw=st.floats(-3.1, 3.1), seed=st.integers(0, 1000))
def test_any_frame_is_found(x: float, y: float, yaw: float, seed: int) -> None:
    """Exact points in any frame: nothing contradicts, and the frame is that which they were put in."""
    rng = np.random.default_rng(seed)
    places = rng.uniform(-20, 20, (4, 2))
    scans = np.arange(4)
    position = apply2([x, y, yaw], places)
    control = Control(scans, scans, np.zeros(4), NO_LINES, NO_LINES, position, np.full(4, 0.01), ("a", "b", "c", "d"))
    frame = fitted_frame(control, places)
    np.testing.assert_allclose(apply2(frame, position - control.centre), places, atol=1e-6)
    kept, off = agreeing(control, places, 1e-4 * np.eye(8))
    assert kept.all() and off.max() < 1e-3
    np.testing.assert_allclose(align2(places, places + np.array([1.0, -2.0])), [1, -2, 0], atol=1e-9)


def test_points_at_one_place_give_no_frame() -> None:
    run = bent_drive(3, 0.0, steps=6)
    with pytest.raises(InputError, match=r"2 points within .* expected two or more places"):
        solve(run, marks(run, [3, 3]))
    with pytest.raises(InputError, match="1 point, expected two or more places"):
        solve(run, marks(run, [3]))


def write(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


def test_files_become_points(tmp_path: Path) -> None:
    """Marks between scans, and corners by the ids of the layout's walls; both files share one frame."""
    first = write(tmp_path / "marks.csv", "time,x,y,sigma\n10.25, 100.5, 200.25, 0.005  # door\n11.0,101,200,0.01\n")
    second = write(tmp_path / "corners.csv", "wall_a,wall_b,x,y,sigma\n0,1,104,200,0.002\n")
    points = read_control((second, first))
    assert points.names == ("mark at 10.250 s", "mark at 11.000 s", "corner of walls 0 and 1")
    control = control_on_layout(points, np.array([10.0, 10.4, 11.0]), LAYOUT)
    np.testing.assert_array_equal(control.scan, [1, 2])
    np.testing.assert_array_equal(control.other, [0, 1])
    np.testing.assert_allclose(control.part, [0.375, 0.0], atol=1e-9)
    poses: Array = np.array([[0, 0, 0], [2.0, 0, np.pi / 2], [3, 0, 0]])
    walls: Array = np.array([[2.0, 0, 0], [4, 1.5, np.pi / 2]])
    places = control.places(poses, walls, np.array([[0, 1]]))
    np.testing.assert_allclose(places, np.array([[1.25, 0], [3, 0], [4, 0]]), atol=1e-9)
    np.testing.assert_allclose(control.sigma, [0.005, 0.01, 0.002])
    np.testing.assert_allclose(control.position[2], [104, 200])


@pytest.mark.parametrize(
    ("text", "fragments"),
    [
        ("", ["header is ''", "'time,x,y,sigma' or 'wall_a,wall_b,x,y,sigma'"]),
        ("name,x,y\na,1,2\n", ["header is 'name,x,y'"]),
        ("time,x,y,sigma\n", ["0 points in all"]),
        ("time,x,y,sigma\n1,2,3,0.01\n", ["1 points in all", "two or more"]),
        ("time,x,y,sigma\n1,2,3\n", [":2", "3 columns"]),
        ("time,x,y,sigma\n1,2,north,0.1\n", [":2", "not all numbers"]),
        ("time,x,y,sigma\n10,2,3,0.01\n11,2,nan,0.01\n", ["row 2", "nan", "coordinates"]),
        ("time,x,y,sigma\n10,2,3,0.01\n11,2,4,0\n", ["row 2", "sigma is 0 m"]),
        ("time,x,y,sigma\n10,2,3,0.01\n12,2,4,0.01\n", ["mark at 12.000 s", "10.000 to 11.000 s"]),
        ("wall_a,wall_b,x,y,sigma\n0,1,4,0,0.01\n1,1,4,3,0.01\n", ["row 2", "two walls that meet"]),
        ("wall_a,wall_b,x,y,sigma\n0,1,4,0,0.01\n0,2,4,3,0.01\n", ["walls 0 and 2", "0 degrees from parallel"]),
        ("wall_a,wall_b,x,y,sigma\n0,1,4,0,0.01\n0,8,4,3,0.01\n", ["walls 0 and 8", "no wall 8"]),
        ("wall_a,wall_b,x,y,sigma\n0,1,4,0,0.01\n2,3,4,3,0.01\n", ["walls 2 and 3", "wall 3 is inferred"]),
    ],
)  # fmt: skip
def test_wrong_rows_are_one_line(text: str, fragments: list[str], tmp_path: Path) -> None:
    path = write(tmp_path / "control.csv", text)
    with pytest.raises(InputError) as error:
        control_on_layout(read_control((path,)), np.array([10.0, 10.5, 11.0]), LAYOUT)
    assert "\n" not in str(error.value)
    for fragment in ["control.csv", *fragments]:
        assert fragment in str(error.value)


def test_command_line(tmp_path: Path, run_recon: Callable[..., Any]) -> None:
    """Three marks and a corner of a room of 5 m x 4 m in survey coordinates; one mark is 1 m off."""
    (tmp_path / "room").mkdir()
    write_scans(tmp_path / "room" / "scans.npz", hall_scans(0))  # driven from (-0.6, 0) to (0.6, 0)
    assert run_recon("build", tmp_path / "room", "-o", tmp_path / "first.svg").status == 0
    walls = json.loads((tmp_path / "first.recon" / "layout.json").read_text())["walls"]
    right = next(w["id"] for w in walls if w["start"][0] > 2 and w["end"][0] > 2)
    back = next(w["id"] for w in walls if w["start"][1] > 1.5 and w["end"][1] > 1.5)
    frame, times = np.array([1000.0, 500.0, 0.5]), [10.0, 13.0, 16.0]
    stood = apply2(frame, np.array([(-0.6, 0), (0.0, 0.0), (0.6, 0)])) + np.array([[0, 0], [1.0, 0], [0, 0]])
    corner = apply2(frame, np.array([[2.5, 2.0]]))[0]
    text = "".join(f"{t},{x:.6f},{y:.6f},0.01\n" for t, (x, y) in zip(times, stood, strict=True))
    first = write(tmp_path / "marks.csv", "time,x,y,sigma\n" + text)
    second = write(
        tmp_path / "corners.csv", f"wall_a,wall_b,x,y,sigma\n{right},{back},{corner[0]:.6f},{corner[1]:.6f},0.01\n"
    )
    done = run_recon("build", tmp_path / "room", "-o", tmp_path / "b.svg", "--control", first, "--control", second)
    assert done.status == 0, done.errors
    (warning,) = [line for line in done.errors if "left out, it is" in line]
    assert "marks.csv: mark at 13.000 s" in warning
    assert [line.split(":")[1].strip() for line in done.output if line.startswith("Control:")] == [
        "mark at 10.000 s", "mark at 13.000 s", "mark at 16.000 s", f"corner of walls {right} and {back}"
    ]  # fmt: skip
    content = json.loads((tmp_path / "b.recon" / "metrics.json").read_text())["control"]
    np.testing.assert_allclose(content["survey_from_map"], compose2(frame, [-0.6, 0, 0]), atol=0.03)
    assert [p["used"] for p in content["points"]] == [True, False, True, True]
    assert np.hypot(*content["points"][1]["residual"]) == pytest.approx(100, rel=0.05)
    assert "Surveyed points" in (tmp_path / "b.recon" / "report.html").read_text()
    refused = run_recon("build", tmp_path / "room", "-o", tmp_path / "x.svg", "--control", first, "--backend", "ekf")
    assert refused.status == 2 and "marks.csv: the filter takes no distances or points" in refused.errors[-1]


def test_a_survey_says_what_was_kept() -> None:
    survey = Survey(np.zeros(3), np.ones(3), np.zeros((2, 2)), np.array([True, True]), np.zeros(2))
    points = ControlPoints(np.array([1.0, 2.0]), NO_IDS, NO_IDS, np.zeros((2, 2)), np.ones(2), ("a", "a"))
    assert contradictions(points, survey) == []
