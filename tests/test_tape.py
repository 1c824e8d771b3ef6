"""Distances measured by hand: what they do to walls, to sigmas, and what is said of wrong ones."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from graph_drive import Drive, drive, polygon, simulate
from hypothesis import given
from hypothesis import strategies as st

from recon.config import GraphConfig
from recon.errors import InputError
from recon.geometry import Array
from recon.graph.estimate import MapEstimate
from recon.graph.line import Lines
from recon.graph.observation import WallObservations
from recon.graph.solve import solve_graph
from recon.graph.tape import Spans, Tape
from recon.model import Layout, Wall
from recon.sequence.sequence import Scans
from recon.sequence.trajectory import Trajectory
from recon.sequence.write import write_scans
from recon.tape import TapeMeasures, read_tape, surprises, tape_on_layout

FREE = GraphConfig(manhattan=False)
HALL = polygon([(-1, -1.5), (11, -1.5), (11, 1.5), (-1, 1.5)])
WIDTH = 3.0


def noisy_hall(seed: int, stretch: float = 1.0) -> Drive:
    """A hall seen from six places by a scanner with 5 cm noise that says everything `stretch` times as large."""
    run = simulate(HALL, drive([(0, 0), (8, 0.3)], step=1.4), seed, sigma=0.05)
    if stretch == 1.0:
        return run
    scale = np.array([stretch, stretch, 1.0])
    return replace(
        run,
        start=Trajectory(run.start.timestamps, run.start.poses * scale),
        motion=replace(run.motion, relative=run.motion.relative * scale),
        observations=replace(run.observations, endpoints=run.observations.endpoints * stretch),
    )


def solve(run: Drive, tape: Tape | None = None) -> MapEstimate:
    return solve_graph(run.start, run.motion, run.observations, None, FREE, tape=tape)


def lines(estimate: MapEstimate, numbers: list[int]) -> Lines:
    walls = [estimate.walls[k] for k in numbers]
    return Lines(
        np.array([w.pose[:2] for w in walls]),
        np.array([w.pose[2] for w in walls]),
        np.array([np.abs(w.intervals).max() for w in walls]),
        np.zeros((len(walls), 2, 2)),
    )


def facing(estimate: MapEstimate, angle: float) -> int:
    """The longest wall that runs in a direction, rad (the hall's first wall runs along x)."""
    fit = [k for k, w in enumerate(estimate.walls) if np.cos(w.pose[2] - angle) > 0.99]
    return max(fit, key=lambda k: float(np.abs(estimate.walls[k].intervals).max()))


def across(estimate: MapEstimate, distance: float, sigma: float) -> Tape:
    """The hall's width, from its right wall to its left wall."""
    right, left = facing(estimate, 0.0), facing(estimate, np.pi)
    return Tape(
        lines(estimate, [right]), lines(estimate, [left]), np.array([distance]), np.array([sigma]), ("tape: width",)
    )


def test_a_tape_makes_walls_sharper_and_truer() -> None:
    """Errors of the hall's width shrink from the scanner's to the tape's, and so do the walls' sigmas."""
    without, with_tape = [], []
    for seed in range(6):
        run = noisy_hall(seed)
        plain = solve(run)
        tape = across(plain, WIDTH, 0.0005)
        taped = solve(run, tape)
        rough = across(plain, WIDTH, 10.0)  # says nothing, but reports the distance
        without.append(solve(run, rough).tape[0] - WIDTH)
        with_tape.append(taped.tape[0] - WIDTH)
        assert [w.observations for w in taped.walls] == [w.observations for w in plain.walls]
        sigma = taped.walls[facing(taped, 0.0)].sigma_offset
        assert 0.5 * plain.walls[facing(plain, 0.0)].sigma_offset < sigma < plain.walls[facing(plain, 0.0)].sigma_offset
    assert np.std(without) > 0.001
    assert np.abs(with_tape).max() < 0.0005


def test_a_scanner_that_says_too_much_is_put_right() -> None:
    """0.3 % too large: the tape brings the walls to their places, and what the scans would say shows as a residual."""
    run = noisy_hall(1, stretch=1.003)
    plain = solve(run)
    assert solve(run, across(plain, WIDTH, 100.0)).tape[0] == pytest.approx(1.003 * WIDTH, abs=0.005)
    taped = solve(run, across(plain, WIDTH, 0.001))
    assert taped.tape[0] == pytest.approx(WIDTH, abs=0.003)
    assert taped.residuals["tape"] == pytest.approx(abs(taped.tape[0] - WIDTH) / 0.001)
    assert taped.tape[0] > WIDTH


def test_a_slip_of_the_pen_bends_little_and_is_said() -> None:
    """30 cm too much, said to be sure to 2 mm, against what the scans say."""
    run = noisy_hall(2)
    plain = solve(run)
    taped = solve(run, across(plain, WIDTH + 0.3, 0.002))
    assert abs(taped.tape[0] - WIDTH) < 0.05
    measures = TapeMeasures("tape.csv", np.array([4]), np.array([7]), np.array([WIDTH + 0.3]), np.array([0.002]))
    (line,) = surprises(measures, taped.tape)
    assert line.startswith("tape.csv: walls 4 and 7, 3.3 m: is ")
    assert "-1" in line and "standard deviations" in line
    assert surprises(measures, measures.distance + 0.005) == []


def test_walls_that_are_gone_are_said() -> None:
    run = noisy_hall(3)
    plain = solve(run)
    tape = across(plain, WIDTH, 0.01)
    far = replace(tape, second=replace(tape.second, middle=tape.second.middle + 1.0))
    with pytest.raises(InputError, match="tape: width: one of the walls"):
        solve(run, far)
    with pytest.raises(InputError, match="or both are one"):
        solve(run, replace(tape, second=tape.first))


@given(
    turn=st.floats(-0.2, 0.2), opposite=st.booleans(), x=st.floats(-3, 3), y=st.floats(-4, 4), half=st.floats(0.5, 3)
)
def test_spans(turn: float, opposite: bool, x: float, y: float, half: float) -> None:
    """The place that is measured lies on the second wall, and its distance from the first wall's line is the span."""
    second = np.array([[x, y, turn + np.pi * opposite]])
    spans = Spans.between(np.zeros((1, 3)), second, np.array([2.0]), np.array([half]))
    place = second[0, :2] + spans.along[0] * np.array([np.cos(second[0, 2]), np.sin(second[0, 2])])
    assert place[1] == pytest.approx(spans.signed[0], abs=1e-9)
    if abs(x) < 1.5:  # the stretches overlap: it is on both
        assert abs(place[0]) <= 2.0 + 1e-9
        assert abs(spans.along[0]) <= half + 1e-9


def wall(number: int, start: tuple[float, float], end: tuple[float, float], source: Any = "lidar") -> Wall:
    return Wall(number, np.array(start), np.array(end), 0.003, 0.001, source, 20)


LAYOUT = Layout(
    (wall(0, (0, 0), (4, 0)), wall(1, (4, 0), (4, 3)), wall(2, (4, 3), (0, 3)), wall(3, (0, 3), (0, 0), "inferred")), ()
)


def test_names_become_lines(tmp_path: Path) -> None:
    path = tmp_path / "tape.csv"
    path.write_text("wall_a,wall_b,distance,sigma\n0, 2, 3.012, 0.002  # with a steel tape\n2,0,3.010,0.005\n")
    tape = tape_on_layout(read_tape(path), LAYOUT)
    np.testing.assert_allclose(tape.first.pose, np.array([[2, 0, 0], [2, 3, np.pi]]))
    np.testing.assert_allclose(tape.second.half, [2, 2])
    np.testing.assert_allclose(tape.distance, [3.012, 3.010])
    np.testing.assert_allclose(tape.sigma, [0.002, 0.005])


@pytest.mark.parametrize(
    ("rows", "fragments"),
    [
        ("", ["no row below the header"]),
        ("0,2,3.0\n", [":2", "3 columns", "wall_a wall_b distance sigma"]),
        ("0,two,3.0,0.01\n", [":2", "not all numbers"]),
        ("0,2,nan,0.01\n", ["row 1", "nan"]),
        ("0.5,2,3,0.01\n", ["row 1", "0.5", "ids of two walls"]),
        ("0,2,3,0.01\n2,2,3,0.01\n", ["row 2", "ids of two walls"]),
        ("0,2,-3,0.01\n", ["row 1", "-3 m", "positive"]),
        ("0,2,3,0\n", ["row 1", "+- 0 m", "positive"]),
        ("0,9,3,0.01\n", ["walls 0 and 9", "no wall 9", "ids 0 to 3"]),
        ("0,1,3,0.01\n", ["walls 0 and 1", "90 degrees from parallel"]),
        ("1,3,3,0.01\n", ["walls 1 and 3", "wall 3 is inferred"]),
    ],
)
def test_wrong_rows_are_one_line(rows: str, fragments: list[str], tmp_path: Path) -> None:
    path = tmp_path / "tape.csv"
    path.write_text("wall_a,wall_b,distance,sigma\n" + rows)
    with pytest.raises(InputError) as error:
        tape_on_layout(read_tape(path), LAYOUT)
    for fragment in ["tape.csv", *fragments]:
        assert fragment in str(error.value)


def hall_scans(seed: int) -> Scans:
    """30 scans of 360 beams from within a room of 5 m x 4 m, sigma 2 cm."""
    rng = np.random.default_rng(seed)
    bearings = -np.pi + np.arange(360) * 2 * np.pi / 360
    ranges = []
    for x in np.linspace(-0.6, 0.6, 30):
        c, s = np.cos(bearings), np.sin(bearings)
        with np.errstate(divide="ignore"):
            to_x, to_y = np.where(c > 0, 2.5 - x, 2.5 + x) / np.abs(c), 2.0 / np.abs(s)
        ranges.append(np.minimum(to_x, to_y) + rng.normal(size=360) * 0.02)
    stamps: Array = np.linspace(10.0, 16.0, 30)
    return Scans(stamps, np.array(ranges, np.float32), -np.pi, 2 * np.pi / 360, 0.1, 10.0)


def test_command_line(tmp_path: Path, run_recon: Callable[..., Any]) -> None:
    """Ids of a first build's layout name the walls; the second build keeps to the tape and reports the residuals."""
    (tmp_path / "room").mkdir()
    write_scans(tmp_path / "room" / "scans.npz", hall_scans(0))
    assert run_recon("build", tmp_path / "room", "-o", tmp_path / "first.svg").status == 0
    walls = json.loads((tmp_path / "first.recon" / "layout.json").read_text())["walls"]
    up = [w["id"] for w in walls if abs(w["end"][0] - w["start"][0]) > 3]
    tape = tmp_path / "tape.csv"
    tape.write_text(f"wall_a,wall_b,distance,sigma\n{up[0]},{up[1]},4.001,0.003\n{up[0]},{up[1]},3.2,0.02\n")
    done = run_recon("build", tmp_path / "room", "-o", tmp_path / "second.svg", "--tape", tape)
    assert done.status == 0
    (warning,) = [line for line in done.errors if "standard deviations" in line]
    assert "3.2 m: is " in warning and "+40" in warning
    first, second = json.loads((tmp_path / "second.recon" / "metrics.json").read_text())["tape"]
    assert first["walls"] == up
    assert first["solved"] == pytest.approx(4.001, abs=0.01)
    assert second["residual"] == pytest.approx((second["solved"] - 3.2) / 0.02, abs=0.01)
    assert "Measured by hand" in (tmp_path / "second.recon" / "report.html").read_text()
    refused = run_recon("build", tmp_path / "room", "-o", tmp_path / "x.svg", "--tape", tape, "--backend", "ekf")
    assert refused.status == 2
    assert "the filter takes no distances" in refused.errors[-1]


def test_none_is_none() -> None:
    run = noisy_hall(4)
    estimate = solve(run)
    empty: Array = estimate.tape
    assert empty.shape == (0,)
    assert "tape" not in estimate.residuals
    assert isinstance(run.observations, WallObservations)
