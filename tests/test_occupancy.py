from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image
from scipy.spatial import cKDTree
from walled_plans import drive, odd_models, row_of_rooms

from recon.errors import InputError
from recon.exporters import export
from recon.exporters.options import ExportOptions
from recon.geometry import Array
from recon.layout.occupancy import build_occupancy
from recon.model import Layout, Model, Opening
from recon.occupancy import FREE, OCCUPIED, UNKNOWN, Occupancy, load_occupancy, resampled, save_occupancy
from recon.simulate.office import office_plan
from recon.simulate.simulation import Simulation, run_simulation


class NavMap:
    """map.yaml and its picture, read as map_server does (trinary mode), with PIL and PyYAML only."""

    def __init__(self, path: Path) -> None:
        self.meta: dict[str, Any] = yaml.safe_load(path.read_text(encoding="utf-8"))
        self.grey = np.asarray(Image.open(path.parent / self.meta["image"]))
        occupied = (255 - self.grey.astype(np.float64)) / 255
        self.states = np.full(self.grey.shape, UNKNOWN)
        self.states[occupied > self.meta["occupied_thresh"]] = OCCUPIED
        self.states[occupied < self.meta["free_thresh"]] = FREE

    def at(self, points: Array) -> Array:
        """States (N,) at points (N, 2); the picture's lower left corner is the origin."""
        cell = np.floor((points - self.meta["origin"][:2]) / self.meta["resolution"]).astype(int)
        rows, columns = self.grey.shape
        inside = ((cell >= 0) & (cell < [columns, rows])).all(axis=1)
        out = np.full(len(points), UNKNOWN)
        out[inside] = self.states[rows - 1 - cell[inside, 1], cell[inside, 0]]
        return out


@cache
def office() -> tuple[Simulation, Occupancy]:
    """Twelve empty rooms driven through, and the map from the true poses."""
    simulation = run_simulation(office_plan(3, rooms=12, distance=120, clutter=0.0), 1)
    return simulation, build_occupancy(simulation.truth, simulation.scans)


def along_walls(layout: Layout, off: float) -> Array:
    """Points every 0.1 m along the walls of rooms that were driven in, `off` m before them, away from openings."""
    out = []
    for wall in layout.walls:
        s = np.arange(0.3, wall.length - 0.3, 0.1)
        for opening in layout.openings:
            span = np.sort((np.stack([opening.start, opening.end]) - wall.start) @ wall.direction)
            beside = abs(float((opening.start - wall.start) @ wall.normal)) < 0.5
            s = s[(s < span[0] - 0.3) | (s > span[1] + 0.3)] if beside else s
        out.append(wall.start + s[:, None] * wall.direction + off * wall.normal)
    return np.concatenate(out)


def test_map_of_a_simulated_office_is_the_office(tmp_path: Path) -> None:
    simulation, grid = office()
    layout = simulation.layout
    export(Model("office", layout, (), occupancy=grid), tmp_path / "office map.yaml")
    found = NavMap(tmp_path / "office map.yaml")
    assert found.meta["resolution"] == 0.05
    assert found.meta["origin"][2] == 0.0
    near, _ = cKDTree(simulation.truth.poses[:, :2]).query(along_walls(layout, 0.0))
    seen = (found.at(along_walls(layout, 0.1)) != UNKNOWN) & (near < 4.0)  # some were only glanced at from far away
    assert seen.mean() > 0.5
    # At a wall or in the cell before or behind it something stands, a step before it nothing.
    around = np.stack([found.at(along_walls(layout, off)) for off in (-0.05, 0.0, 0.05)])
    at_wall: Array = (around == OCCUPIED).max(axis=0)
    assert at_wall[seen].mean() > 0.97
    assert (found.at(along_walls(layout, 0.25))[seen] == FREE).mean() > 0.97
    assert (found.at(along_walls(layout, -0.12)) == FREE).mean() < 0.01  # inside walls
    assert (found.at(simulation.truth.poses[:, :2]) == FREE).all()
    far = np.array([[-500.0, 0.0], [500.0, 500.0]])
    assert (found.at(far) == UNKNOWN).all()
    assert np.abs(shift(found, layout)).max() < 0.025  # half a cell


def shift(found: NavMap, layout: Layout) -> Array:
    """How far (2,), m, the map lies off the walls: what moves the occupied cells onto faces to either side best."""
    rows, columns = np.nonzero(found.states[::-1] == OCCUPIED)
    size = found.meta["resolution"]
    cells = np.array(found.meta["origin"][:2]) + size * (np.stack([columns, rows], axis=1) + 0.5)
    steps = [np.arange(0.0, wall.length, 0.01) for wall in layout.walls]
    faces = np.concatenate([w.start + s[:, None] * w.direction for w, s in zip(layout.walls, steps, strict=True)])
    normals = np.concatenate([np.tile(w.normal, (len(s), 1)) for w, s in zip(layout.walls, steps, strict=True)])
    away, nearest = cKDTree(faces).query(cells)
    near = away < 2 * size
    off = ((cells - faces[nearest]) * normals[nearest]).sum(axis=1)[near]
    sides = np.column_stack([normals[nearest][near], np.ones(near.sum())])
    return np.asarray(np.linalg.lstsq(sides, off)[0][:2])


def test_map_in_the_buildings_frame_is_the_same_map_turned(tmp_path: Path) -> None:
    simulation, grid = office()
    turned = row_of_rooms([3.0, 4.0], 4.0, 0.2, np.array([2.0, 1.0, 0.3]))
    model = Model("office", turned, (), occupancy=grid)
    export(model, tmp_path / "a.yaml")
    export(model, tmp_path / "b.yaml", ExportOptions(map_frame="building", map_resolution=0.1))
    a, b = NavMap(tmp_path / "a.yaml"), NavMap(tmp_path / "b.yaml")
    x, y, yaw = b.meta["map_from_building"]
    assert (x, y) == (0, 0)
    assert yaw == pytest.approx(0.3, abs=1e-6)
    assert b.meta["resolution"] == 0.1
    points = simulation.truth.poses[:, :2]
    c, s = np.cos(yaw), np.sin(yaw)
    assert (b.at(points @ np.array([[c, -s], [s, c]])) == FREE).mean() > 0.98
    assert (a.at(points) == FREE).all()


def test_glass_is_closed(tmp_path: Path) -> None:
    grid = Occupancy(np.array([0.0, 0.0]), 0.025, np.full((80, 80), FREE, np.uint8))
    layout = row_of_rooms([2.0], 2.0, 0.1)
    window = Opening(0, "window", 2, np.array([1.5, 1.0]), np.array([0.5, 1.0]), 0.0, 2.0)
    passage = replace(window, id=1, type="passage", start=np.array([1.0, 0.2]), end=np.array([1.0, 0.8]))
    export(Model("m", replace(layout, openings=(window, passage)), (), occupancy=grid), tmp_path / "a.yaml")
    found = NavMap(tmp_path / "a.yaml")
    assert (found.at(np.column_stack([np.linspace(0.5, 1.5, 41), np.full(41, 1.0)])) == OCCUPIED).all()
    assert (found.at(np.array([[0.3, 1.0], [1.0, 0.5], [1.0, 1.3]])) == FREE).all()


def test_a_result_without_occupancy_gives_the_map_of_its_layout(tmp_path: Path) -> None:
    layout = row_of_rooms([3.0, 4.0], 4.0, 0.2, np.array([-20.013, 5.027, 0.1]))
    layout = replace(layout, openings=(replace(layout.openings[0], open=True), *layout.openings[1:]))
    export(Model("m", layout, ()), tmp_path / "a.yaml")
    found = NavMap(tmp_path / "a.yaml")
    assert "drawn from the layout" in (tmp_path / "a.yaml").read_text()
    assert (found.at(np.array([room.polygon.mean(axis=0) for room in layout.rooms])) == FREE).all()
    assert (found.at(np.array([wall.start + 0.4 * wall.direction for wall in layout.walls])) == OCCUPIED).all()
    one, other = layout.openings[0], layout.openings[1]  # open as one side shows it: there is a way through
    way = 0.5 * (one.start + one.end) + np.linspace(0, 1, 9)[:, None] * 0.5 * (
        other.start + other.end - one.start - one.end
    )
    assert (found.at(way) == FREE).all()


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 1000),
    resolution=st.sampled_from([0.03, 0.05, 0.1, 0.25]),
    yaw=st.floats(-0.8, 0.8),
)
def test_nothing_that_stands_is_lost_by_resampling(seed: int, resolution: float, yaw: float) -> None:
    rng = np.random.default_rng(seed)
    cells = rng.choice([UNKNOWN, FREE, FREE, OCCUPIED], (20, 30)).astype(np.uint8)
    grid = Occupancy(rng.uniform(-5, 5, 2), 0.025, cells)
    rows, columns = np.nonzero(cells == OCCUPIED)
    centres = grid.origin + 0.025 * (np.stack([columns, rows], axis=1) + 0.5)
    for angle in (0.0, yaw):
        c, s = np.cos(angle), np.sin(angle)
        found = resampled(grid, resolution, angle).at(centres @ np.array([[c, -s], [s, c]]))
        # Turned, a sample may miss a cell by its corner; never more than a few, and never where cells lie straight.
        assert (found == OCCUPIED).mean() >= (1.0 if angle == 0.0 else 0.97)
    assert (resampled(replace(grid, cells=np.full_like(cells, FREE)), 0.05).cells == FREE).mean() > 0.9


def test_what_is_kept_comes_back(tmp_path: Path) -> None:
    _, _, grid = drive()
    assert load_occupancy(tmp_path) is None
    save_occupancy(grid, tmp_path)
    back = load_occupancy(tmp_path)
    assert back is not None
    assert (back.cells == grid.cells).all()
    assert back.origin.tolist() == grid.origin.tolist()
    assert NavMap(tmp_path / "occupancy.yaml").at(np.array([[-0.975, 2.025], [-0.875, 2.075]])).tolist() == [2, 2]
    (tmp_path / "occupancy.png").write_bytes(b"no picture")
    with pytest.raises(InputError, match=r"occupancy\.png"):
        load_occupancy(tmp_path)
    (tmp_path / "occupancy.yaml").write_text("origin: [x]")
    with pytest.raises(InputError, match=r"occupancy\.yaml"):
        load_occupancy(tmp_path)
    with pytest.raises(InputError, match="coarser"):
        resampled(replace(grid, cells=np.full((4000, 4000), FREE, np.uint8)), 0.005)


@pytest.mark.parametrize("name", odd_models())
def test_odd_plans_give_readable_maps(name: str, tmp_path: Path) -> None:
    export(odd_models()[name], tmp_path / "Plan ü 'x'.yaml")
    assert NavMap(tmp_path / "Plan ü 'x'.yaml").grey.size > 0
