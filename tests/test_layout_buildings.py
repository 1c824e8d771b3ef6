"""Layouts of random simulated buildings against their plans."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
import pytest
import shapely
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from recon.config import LayoutConfig
from recon.evaluate.walls import wall_scores
from recon.facing import facing_rooms
from recon.graph.estimate import MapEstimate, WallLine
from recon.layout.build import build_layout
from recon.layout.evidence import scan_rays
from recon.model import Layout, Wall
from recon.simulate import Simulation, random_plan, run_simulation


def simulated(seed: int, rooms: int, angles: Literal["manhattan", "any"], clutter: float) -> Simulation:
    plan = random_plan(seed, rooms, angles, clutter)
    return run_simulation(replace(plan, lidar=replace(plan.lidar, rate=4.0)), seed)


def wall_lines(simulation: Simulation, seed: int) -> tuple[WallLine, ...]:
    """True wall lines, 3 mm and 0.03 degrees off, with the stretches along which the scans returned something."""
    rng = np.random.default_rng(seed)
    starts, ends = scan_rays(simulation.truth, simulation.scans)
    lines = []
    for wall in simulation.layout.walls:
        offset = ends - wall.start
        along, across = offset @ wall.direction, offset @ wall.normal
        facing = (starts - wall.start) @ wall.normal > 0
        near = facing & (np.abs(across) < 0.035) & (along > 0) & (along < wall.length)
        t = np.sort(along[near])
        if len(t) < 10:
            continue
        breaks = np.flatnonzero(np.diff(t) > 0.3)
        stretches = np.stack([t[np.r_[0, breaks + 1]], t[np.r_[breaks, len(t) - 1]]], axis=1) - wall.length / 2
        stretches = stretches[np.ptp(stretches, axis=1) > 0.15]
        middle = (wall.start + wall.end) / 2 + rng.normal(0, 0.003) * wall.normal
        yaw = np.arctan2(wall.direction[1], wall.direction[0]) + rng.normal(0, 0.0005)
        lines.append(WallLine(np.array([*middle, yaw]), stretches, 0.003, 0.0005, "lidar", len(t) // 10))
    return tuple(lines)


def layout_and_truth(
    seed: int, rooms: int, angles: Literal["manhattan", "any"], clutter: float
) -> tuple[Layout, Layout]:
    simulation = simulated(seed, rooms, angles, clutter)
    sigmas = np.full((len(simulation.truth), 3), 0.003)
    estimate = MapEstimate(simulation.truth, sigmas, wall_lines(simulation, seed))
    return build_layout(estimate, simulation.scans, LayoutConfig()), simulation.layout


@pytest.mark.parametrize(
    ("seed", "rooms", "angles", "clutter"),
    [(101, 3, "manhattan", 0.0), (102, 4, "any", 0.0), (103, 5, "manhattan", 0.3), (104, 3, "any", 0.3)],
)
def test_random_building(seed: int, rooms: int, angles: Literal["manhattan", "any"], clutter: float) -> None:
    layout, truth = layout_and_truth(seed, rooms, angles, clutter)
    found, true = ([shapely.Polygon(room.polygon) for room in which.rooms] for which in (layout, truth))
    assert all(polygon.is_valid and polygon.exterior.is_ccw for polygon in found)
    assert all(a.intersection(b).area < 1e-6 for i, a in enumerate(found) for b in found[:i])
    assert len(found) == rooms
    one, other = shapely.union_all(found), shapely.union_all(true)
    assert one.intersection(other).area / one.union(other).area > (0.97 if clutter == 0 else 0.93)
    assert wall_scores(layout.walls, truth.walls).f1[1] > (0.97 if clutter == 0 else 0.88)
    doors = [o for o in truth.openings if o.type != "window"]
    middles = np.array([(o.start + o.end) / 2 for o in layout.openings])
    hit = [bool(np.any(np.linalg.norm(middles - (o.start + o.end) / 2, axis=1) < 0.25)) for o in doors]
    assert np.mean(hit) > 0.7


@settings(max_examples=4, deadline=None, derandomize=True, phases=[Phase.generate])
@given(st.integers(0, 10_000), st.integers(1, 4), st.sampled_from(["manhattan", "any"]), st.floats(0.0, 0.8))
def test_what_holds_of_every_layout(seed: int, rooms: int, angles: Literal["manhattan", "any"], clutter: float) -> None:
    """Rooms are simple, counter-clockwise and disjoint; walls face into them and close them; openings lie in walls."""
    layout, _ = layout_and_truth(seed, rooms, angles, clutter)
    polygons = [shapely.Polygon(room.polygon) for room in layout.rooms]
    assert polygons and all(p.is_valid and p.exterior.is_ccw for p in polygons)
    assert all(a.intersection(b).area < 1e-4 for i, a in enumerate(polygons) for b in polygons[:i])
    for polygon, facing in zip(polygons, by_room(layout), strict=True):
        faces = shapely.MultiLineString([np.stack([wall.start, wall.end]) for wall in facing])
        assert polygon.exterior.difference(faces.buffer(0.005)).length < 0.01
    for opening in layout.openings:
        wall = layout.wall(opening.wall)
        offset = np.stack([opening.start, opening.end]) - wall.start
        along, across = offset @ wall.direction, offset @ wall.normal
        assert along.min() > -1e-6 and along.max() < wall.length + 1e-6 and np.abs(across).max() < 1e-6
    for wall in layout.walls:
        assert wall.length > 0 and (wall.source == "inferred" or wall.sigma_offset < 0.1)
        assert np.all((wall.unseen >= -1e-6) & (wall.unseen <= wall.length + 1e-6))


def by_room(layout: Layout) -> list[list[Wall]]:
    """The walls that face each room."""
    owner = facing_rooms(layout)
    return [[wall for wall, k in zip(layout.walls, owner, strict=True) if k == i] for i in range(len(layout.rooms))]
