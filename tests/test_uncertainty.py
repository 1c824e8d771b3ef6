"""Dimensions and corners of a plan are as sure as they say: against samples, numeric derivatives and the truth."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from xml.etree import ElementTree as ET

import ezdxf
import numpy as np
import pytest

from recon.config import Config
from recon.errors import InputError
from recon.evaluate.sigmas import sigma_scores
from recon.exporters import export
from recon.geometry import Array
from recon.graph.estimate import MapEstimate, WallLine
from recon.graph.joint import Ints, WallCovariance
from recon.layout.dimensions import with_dimensions
from recon.layout.line import NONE, PlanLine, merged_lines
from recon.layout.returns import Returns
from recon.layout.surface import with_surfaces
from recon.layout.uncertainty import line_covariances, with_sigmas
from recon.layout_json import layout_from_json, layout_to_json
from recon.model import Layout, Model, Room, Wall
from recon.pipeline import build
from recon.plan.inner import chosen
from recon.sequence.sequence import Sequence
from recon.sequence.trajectory import Trajectory
from recon.simulate import random_plan, run_simulation

CORNERS = np.array([[0.0, 0.0], [5.0, 0.0], [5.5, 3.0], [0.0, 3.0]])
"""m: two parallel walls, and two that are not."""


@dataclass(frozen=True)
class Dense:
    """A joint covariance (2W, 2W) of all walls' (offset, angle)."""

    matrix: Array

    def between_walls(self, first: Ints, second: Ints) -> Array:
        count = len(self.matrix) // 2
        return np.asarray(self.matrix.reshape(count, 2, count, 2)[first, :, second])


def wall_line(start: Array, end: Array, sigma: float = 0.002, observations: int = 40) -> WallLine:
    half = float(np.linalg.norm(end - start)) / 2
    yaw = np.arctan2(*(end - start)[::-1])
    stretch = np.array([[-half, half]])
    return WallLine(np.array([*(start + end) / 2, yaw]), stretch, sigma, 0.001, "lidar", observations)


def room() -> tuple[MapEstimate, Layout]:
    """Four walls that share the platform's errors, 20 mm in x and y and 4 mrad, beside 1 mm of their own."""
    ends = list(zip(CORNERS, np.roll(CORNERS, -1, axis=0), strict=True))
    walls = tuple(wall_line(a, b) for a, b in ends)
    shared = np.zeros((8, 3))
    for k, wall in enumerate(walls):
        middle = wall.pose[:2]
        shared[2 * k] = [*wall.normal, wall.normal @ np.array([-middle[1], middle[0]])]
        shared[2 * k + 1] = [0.0, 0.0, 1.0]
    matrix = shared @ np.diag([0.02, 0.02, 0.004]) ** 2 @ shared.T + np.diag(np.tile([0.001, 0.0005], 4)) ** 2
    joint = WallCovariance(Dense(matrix), np.arange(4), np.zeros(4))
    estimate = MapEstimate(Trajectory(np.zeros(1), np.zeros((1, 3))), np.zeros((1, 3)), walls, joint=joint)
    faces = tuple(Wall(k, a, b, 0.02, 0.004, "lidar", 40) for k, (a, b) in enumerate(ends))
    return estimate, Layout(faces, (Room(0, "room 1", CORNERS),))


def sampled(estimate: MapEstimate, count: int) -> Array:
    """(count, 4, 3) poses of walls drawn from their joint covariance."""
    assert estimate.joint is not None and isinstance(estimate.joint.landmarks, Dense)
    rng = np.random.default_rng(0)
    draws = rng.multivariate_normal(np.zeros(8), estimate.joint.landmarks.matrix, count).reshape(count, 4, 2)
    pose = np.array([wall.pose for wall in estimate.walls])
    normal = np.array([wall.normal for wall in estimate.walls])
    moved = pose[None, :, :2] + draws[:, :, :1] * normal
    return np.concatenate([moved, pose[None, :, 2:] + draws[:, :, 1:]], axis=2)


def crossing(first: Array, second: Array) -> Array:
    """Where two lines, poses (3,), cross."""
    normal = np.array([[-np.sin(p[2]), np.cos(p[2])] for p in (first, second)])
    return np.asarray(np.linalg.solve(normal, [normal[0] @ first[:2], normal[1] @ second[:2]]))


def measured(estimate: MapEstimate, layout: Layout) -> Layout:
    order = np.random.default_rng(1).permutation(4)  # lines in another order than walls
    lines = with_sigmas([merged_lines((wall,))[0] for wall in estimate.walls], estimate)
    numbered = [replace(lines[k], parts=((int(k), np.eye(2)),)) for k in order]
    owner = [int(np.flatnonzero(order == k)[0]) for k in range(4)]
    return with_dimensions(layout, owner, numbered, estimate)


def test_a_dimension_is_as_sure_as_walls_that_move_together() -> None:
    estimate, layout = room()
    (dimension,) = measured(estimate, layout).dimensions
    assert dimension.walls == (0, 2)
    assert dimension.distance == pytest.approx(3.0)
    draws = sampled(estimate, 4000)
    x = dimension.start[0]
    heights = [
        draw[2, 1] + (x - draw[2, 0]) * np.tan(draw[2, 2]) - draw[0, 1] - (x - draw[0, 0]) * np.tan(draw[0, 2])
        for draw in draws
    ]
    assert dimension.sigma == pytest.approx(np.std(heights), rel=0.05)
    independent = float(np.hypot(np.std(draws[:, 0, 1]), np.std(draws[:, 2, 1])))
    assert 0.001 < dimension.sigma < 0.1 * independent, "what both walls share does not change their distance"


def test_corner_covariances_are_those_of_crossing_lines() -> None:
    estimate, layout = room()
    found = measured(estimate, layout).rooms[0].corner_covariances
    assert found is not None
    draws = sampled(estimate, 4000)
    for k in range(4):
        places = np.array([crossing(draw[k - 1], draw[k]) for draw in draws])
        spread = np.cov(places.T)
        assert found[k] == pytest.approx(spread, rel=0.08, abs=0.05 * np.trace(spread))


def test_nobody_saw_it_nobody_measures_it() -> None:
    estimate, layout = room()
    walls = (replace(layout.walls[0], source="inferred"), *layout.walls[1:])
    found = measured(estimate, replace(layout, walls=walls))
    assert found.dimensions == ()
    assert found.rooms[0].corner_covariances is not None
    assert np.isnan(found.rooms[0].corner_covariances).any(axis=(1, 2)).tolist() == [True, True, False, False]


def test_a_wall_between_two_others_hides_them_from_each_other() -> None:
    estimate, layout = room()
    notch = np.array([[0.0, 0.0], [5.0, 0.0], [5.5, 3.0], [4.9, 3.0], [4.9, 1.5], [0.1, 1.5], [0.1, 3.0], [0.0, 3.0]])
    assert measured(estimate, replace(layout, rooms=(Room(0, "room 1", notch),))).dimensions == ()


def moved(walls: tuple[WallLine, ...], k: int, offset: float, angle: float) -> tuple[WallLine, ...]:
    wall = walls[k]
    pose = wall.pose + np.array([*(offset * wall.normal), angle])
    return (*walls[:k], replace(wall, pose=pose), *walls[k + 1 :])


def test_a_joined_line_follows_its_walls() -> None:
    a, b, c = (np.array([x, 0.001]) for x in (0.0, 2.0, 3.1))
    walls = (
        wall_line(a, b),
        wall_line(c, c + np.array([1.5, 0.001]), observations=90),
        wall_line(b + np.array([0.8, 0.0]), a),
    )
    (line,) = merged_lines(walls)
    follows = dict(line.parts)
    assert sorted(follows) == [0, 1, 2]
    step = 1e-5
    for k in range(3):
        for n, (offset, angle) in enumerate(((step, 0.0), (0.0, step))):
            (other,) = merged_lines(moved(walls, k, offset, angle))
            turned = float(np.cross(np.append(line.direction, 0), np.append(other.direction, 0))[2])
            at = line.origin + 0.0  # the fit's centre may slide along the line
            shift = float(-other.offset(at[None])[0])
            assert np.array([shift, turned]) / step == pytest.approx(follows[k][:, n], abs=2e-3)


def test_joined_lines_are_surer_than_each_and_walls_at_hand_not_merged_are_independent() -> None:
    a, b, c = (np.array([x, 0.0]) for x in (0.0, 2.0, 3.0))
    walls = (
        wall_line(a, b),
        wall_line(c, c + np.array([2.0, 0.0])),
        wall_line(np.array([0.0, 4.0]), np.array([0.0, 1.0])),
    )
    estimate = MapEstimate(Trajectory(np.zeros(1), np.zeros((1, 3))), np.zeros((1, 3)), walls)
    lines = with_sigmas(merged_lines(walls), estimate)
    joined, alone = sorted(lines, key=lambda line: -len(line.parts))
    assert joined.sigma_offset == pytest.approx(0.002 / np.sqrt(2), rel=0.05)
    assert (alone.sigma_offset, alone.sigma_angle) == pytest.approx((0.002, 0.001))
    assert np.abs(line_covariances([joined], [alone], estimate)).max() == 0.0


def test_a_leaf_a_little_behind_its_wall_does_not_move_it() -> None:
    wall = (
        wall_line(np.array([0.0, 0.0]), np.array([1.5, 0.0])),
        wall_line(np.array([2.4, 0.0]), np.array([4.0, 0.0])),
    )
    leaf = wall_line(np.array([1.55, -0.031]), np.array([2.35, -0.031]))
    (line,) = merged_lines((*wall, leaf))
    assert line.offset(np.array([[0.0, 0.0], [4.0, 0.0]])) == pytest.approx([0.0, 0.0], abs=1e-6)
    assert line.supported_length == pytest.approx(3.9)


def test_sigma_along_a_line_is_that_of_its_points() -> None:
    line = PlanLine(np.zeros(2), np.array([1.0, 0.0]), np.zeros((0, 2)), np.zeros((0, 2)), 0.003, 0.002, "lidar", 5)
    line = replace(line, mixed=-4e-6)
    covariance = np.array([[0.003**2, -4e-6], [-4e-6, 0.002**2]])
    for s in (-3.0, 0.0, 1.0, 4.0):
        assert line.sigma_at(s) == pytest.approx(np.sqrt(np.array([1, s]) @ covariance @ np.array([1, s])))


def test_layout_file_keeps_dimensions_and_corners() -> None:
    estimate, layout = room()
    layout = measured(estimate, layout)
    known = layout.rooms[0].corner_covariances
    assert known is not None
    known[1] = np.nan
    data = layout_to_json(layout)
    assert data["dimensions"][0]["distance"] == pytest.approx(3.0)
    assert data["rooms"][0]["corner_covariances"][1] is None
    again = layout_from_json(data, "layout.json")
    assert again.dimensions[0].sigma == pytest.approx(layout.dimensions[0].sigma, abs=1e-6)
    assert again.rooms[0].corner_covariances == pytest.approx(known, abs=1e-12, nan_ok=True)
    assert layout_to_json(again) == data
    for change, says in (
        ({"walls": [0]}, "the ids of two walls"),
        ({"walls": [0, "x"]}, "whole number"),
        ({"start": [0]}, r"expected \[x, y\]"),
    ):
        with pytest.raises(InputError, match=f"dimensions.*{says}"):
            layout_from_json(data | {"dimensions": [data["dimensions"][0] | change]}, "layout.json")
    for value in ([None], [[1.0, 2.0], None, None, None], 3):
        rooms = [data["rooms"][0] | {"corner_covariances": value}]
        with pytest.raises(InputError, match="corner_covariances"):
            layout_from_json(data | {"rooms": rooms}, "layout.json")


def check_joint(estimate: MapEstimate) -> None:
    """The covariances between walls hold the walls' own, and make one positive matrix."""
    assert estimate.joint is not None
    count = len(estimate.walls)
    first, second = (index.ravel() for index in np.indices((count, count)))
    blocks = estimate.joint.between(first, second).reshape(count, count, 2, 2)
    whole = blocks.transpose(0, 2, 1, 3).reshape(2 * count, 2 * count)
    own = [(wall.sigma_offset, wall.sigma_angle) for wall in estimate.walls]
    assert np.sqrt(np.diag(whole)) == pytest.approx(np.ravel(own), rel=1e-6)
    assert whole == pytest.approx(whole.T, rel=1e-5, abs=1e-12)
    scale = np.sqrt(np.diag(whole))
    assert np.linalg.eigvalsh(whole / scale / scale[:, None]).min() > -1e-6


def test_simulated_walls_and_dimensions_are_as_sure_as_they_say() -> None:
    ratios: dict[str, list[Array]] = {"offset": [], "angle": [], "dimension": []}
    for seed in (403, 406, 407, 408):
        plan = random_plan(seed, 1 + seed % 100 % 6, "any" if seed % 2 else "manhattan")
        simulation = run_simulation(replace(plan, lidar=replace(plan.lidar, sigma=0.01)), seed)
        built = build(Sequence(plan.name, simulation.scans), Config())
        check_joint(built.estimate)
        scores = sigma_scores(built.model.layout, simulation.layout)
        for name, found in ratios.items():
            found.append(getattr(scores, name).ratios)
    for name, found in ratios.items():
        together = np.abs(np.concatenate(found))
        assert len(together) >= 15
        assert 0.5 < np.mean(together < 1) < 0.88, name  # 0.68 if Gaussian
        assert np.mean(together < 2) > 0.85, name


def test_plans_print_distances_with_their_sigmas(tmp_path: Path) -> None:
    layout = measured(*room())
    (dimension,) = layout.dimensions
    shorter = replace(dimension, start=np.array([4.9, 0.0]), end=np.array([4.9, 1.0]), sigma=0.0042)
    across = replace(dimension, start=np.array([0.0, 1.5]), end=np.array([5.25, 1.5]), sigma=0.0042)
    layout = replace(layout, dimensions=(shorter, dimension, across))
    assert chosen(layout) == [across, dimension, shorter], "the longest first"
    assert chosen(replace(layout, dimensions=(*layout.dimensions, dimension))) == chosen(layout), "none twice"
    model = Model("plan", replace(layout, dimensions=(dimension,)), ())
    export(model, tmp_path / "plan.svg")
    export(model, tmp_path / "plan.dxf")
    sigma = 0.001 if dimension.sigma <= 0.001 else 0.002
    texts = {text.removesuffix(" m") for text in ET.parse(tmp_path / "plan.svg").getroot().itertext()}
    assert f"3.000 ± {sigma:.3f}" in texts
    found = ezdxf.readfile(tmp_path / "plan.dxf").modelspace().query("DIMENSION")
    read = {(e.dxf.layer, round(e.get_measurement(), 3), e.dxf.text.removesuffix(" m")) for e in found}
    assert ("A-ANNO-DIMS", 3.0, f"<> ± {sigma:.3f}") in read


def uneven_wall(rng: np.random.Generator, deviation: float) -> tuple[PlanLine, Returns, float]:
    """A wall of 8 m whose half metres stand out by `deviation` (m), 40 returns on each; and the offset of a fit."""
    x = rng.uniform(-4, 4, 640)
    y = rng.normal(0, deviation, 16)[np.floor((x + 4) / 0.5).astype(int)] + rng.normal(0, 0.006, 640)
    line = PlanLine(np.zeros(2), np.array([1.0, 0.0]), np.array([[-4.0, 4.0]]), NONE, 0.0003, 0.0001, "lidar", 16)
    starts = np.tile([0.0, 2.0], (640, 1))
    return line, Returns(starts, np.stack([x, y], axis=1)), float(np.polyfit(x, y, 1)[1])


def test_boards_on_a_wall_widen_its_sigma_and_noise_does_not() -> None:
    rng, fits, sigmas, flat = np.random.default_rng(3), [], [], []
    for _ in range(60):
        line, returns, fit = uneven_wall(rng, 0.005)
        fits.append(fit)
        sigmas.append(with_surfaces([line], returns)[0].sigma_offset)
        line, returns, _ = uneven_wall(rng, 0.0)
        flat.append(with_surfaces([line], returns)[0].sigma_offset)
    assert np.sqrt(np.mean(np.square(sigmas))) == pytest.approx(np.std(fits), rel=0.3)
    assert np.mean(np.array(flat) == 0.0003) > 0.9
