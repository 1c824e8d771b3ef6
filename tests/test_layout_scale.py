"""The layout's work grows with the building, not with its square; finding by place finds what a full search does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from recon.geometry import Array
from recon.layout.cells import FURTHEST, cut_plane
from recon.layout.evidence import FreeSpace
from recon.layout.frontier import frontier_lines
from recon.layout.labelling import areas
from recon.layout.line import NONE, PlanLine
from recon.layout.simplify import free_area
from recon.layout.stretches import Stretches

LOW, HIGH = np.array([-6.0, -6.0]), np.array([16.0, 16.0])


def random_lines(seed: int, count: int, frontiers: bool = False) -> list[PlanLine]:
    """Lines with one to three stretches each, in any direction."""
    rng, out = np.random.default_rng(seed), []
    for _ in range(count):
        angle = rng.uniform(0, 2 * np.pi)
        direction = np.array([np.cos(angle), np.sin(angle)])
        stretches = np.sort(rng.uniform(-4, 4, 2 * rng.integers(1, 4))).reshape(-1, 2)
        frontier = np.sort(rng.uniform(-4, 4, 2))[None] if frontiers else NONE
        line = PlanLine(rng.uniform(0, 10, 2), direction, stretches, NONE, 0.01, 0.01, "lidar", 3, frontier)
        out.append(line)
    return out


def segments(line: PlanLine) -> shapely.Geometry:
    return shapely.MultiLineString([line.point(stretch) for stretch in line.support])


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10_000), st.integers(1, 20), st.floats(0.05, 3.0))
def test_stretches_are_those_of_a_full_search(seed: int, count: int, reach: float) -> None:
    lines = random_lines(seed, count)
    points = np.random.default_rng(seed).uniform(-5, 15, (15, 2))
    apart = np.array([[shapely.distance(segments(line), shapely.Point(p)) for line in lines] for p in points])
    index = Stretches(lines)
    assert index.distance(points) == pytest.approx(apart.min(axis=1), abs=1e-9)
    assert [index.nearest(p) for p in points] == np.argmin(apart, axis=1).tolist()
    row, line = index.around(points, reach)
    assert set(zip(row.tolist(), line.tolist(), strict=True)) == set(zip(*np.nonzero(apart <= reach), strict=True))
    between = np.array([[segments(a).distance(segments(b)) for b in lines] for a in lines])
    np.fill_diagonal(between, np.inf)
    assert [n.tolist() for n in index.neighbours(reach)] == [np.flatnonzero(row <= reach).tolist() for row in between]


def test_no_lines_are_far_from_everything() -> None:
    index = Stretches([])
    assert np.isinf(index.distance(np.zeros((3, 2)))).all()
    assert index.nearest(np.zeros(2)) == -1
    assert len(index.around(np.zeros((3, 2)), 1.0)[0]) == 0


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10_000), st.integers(1, 20), st.floats(0.07, 0.4))
def test_areas_count_the_middles_of_grid_cells_in_each_polygon(seed: int, count: int, resolution: float) -> None:
    cells = cut_plane(random_lines(seed, count), LOW, HIGH)
    rng = np.random.default_rng(seed)
    mask = rng.random((40, 60)) < 0.5
    space = FreeSpace(rng.uniform(-8, 5, 2), resolution, mask, ~mask, mask)  # partly outside the cells
    x, y = space.centres(mask).T
    inside = [shapely.contains_xy(polygon, x, y).sum() for polygon in cells.polygons]
    (found, rest) = areas(cells, space, mask, ~mask)
    assert found == pytest.approx(np.array(inside) * resolution**2, abs=1e-9)
    x, y = space.centres(~mask).T
    assert rest.sum() == pytest.approx(((x > -6) & (x < 16) & (y > -6) & (y < 16)).sum() * resolution**2)


def test_free_area_is_that_of_the_cells_in_the_polygon() -> None:
    free = np.random.default_rng(0).random((50, 70)) < 0.6
    space = FreeSpace(np.array([-1.0, 2.0]), 0.1, free, ~free, ~free)
    polygon = shapely.Polygon([(0, 3), (4, 2.5), (5, 6), (1, 5)])
    x, y = space.centres(free).T
    assert free_area(polygon, space) == pytest.approx(shapely.contains_xy(polygon, x, y).sum() * 0.01)


def office(columns: int, rows: int) -> list[PlanLine]:
    """Walls of rooms of 4 by 3 m, 0.12 m apart, seen from inside, not quite in line; some corners are hidden."""
    rng, out = np.random.default_rng(1), []
    for column in range(columns):
        for row in range(rows):
            low = np.array([4.12 * column, 3.12 * row])
            corners = low + np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0]])
            for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
                length = float(np.linalg.norm(b - a))
                middle = (a + b) / 2 + rng.normal(0, 0.004, 2)
                turn = rng.normal(0, 0.001)
                along = (b - a) / length @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
                hidden = np.where(rng.random(2) < 0.15, rng.uniform(0.2, 0.8, 2), 0.03)
                stretch = np.array([[hidden[0] - length / 2, length / 2 - hidden[1]]])
                out.append(PlanLine(middle, along, stretch, NONE, 0.003, 0.001, "lidar", 50))
    return out


def office_box(columns: int, rows: int) -> tuple[Array, Array]:
    return np.array([-1.0, -1.0]), np.array([4.12 * columns + 1.0, 3.12 * rows + 1.0])


def test_cells_grow_with_the_number_of_rooms() -> None:
    counts = {}
    for columns, rows in ((5, 4), (10, 4), (10, 8), (20, 10)):
        cells = cut_plane(office(columns, rows), *office_box(columns, rows))
        counts[columns * rows] = len(cells.polygons)
        assert sum(p.area for p in cells.polygons) == pytest.approx(
            float(np.prod(np.subtract(*office_box(columns, rows)[::-1]))), rel=1e-4
        )
    per_room = {rooms: count / rooms for rooms, count in counts.items()}
    assert all(1.0 <= share <= 1.3 * per_room[20] for share in per_room.values()), per_room


def test_lines_cut_the_plan_near_what_was_seen_of_them_only() -> None:
    rooms = [replace(line, front=line.front + np.array([[0.1, -0.1]])) for line in office(20, 2)]  # no corner is seen
    cells = cut_plane(rooms, *office_box(20, 2))
    spans = cells.spans(rooms)
    beyond = []
    for k, line in enumerate(rooms):
        beyond.append((line.front[0, 0] - spans[cells.line == k], spans[cells.line == k] - line.front[0, 1]))
    furthest = max(float(np.max(np.maximum(before, after), initial=0.0)) for before, after in beyond)
    assert 4.0 < furthest <= FURTHEST, "on through the corners that nobody saw, but not through the whole building"


def test_frontiers_of_far_rooms_do_not_change_those_of_near_ones() -> None:
    free = np.zeros((200, 400), np.bool_)
    free[20:60, 20:90] = True
    near = FreeSpace(np.array([-1.0, -1.0]), 0.05, free, ~free, ~free)
    both = free.copy()
    both[120:170, 280:360] = True
    far = FreeSpace(np.array([-1.0, -1.0]), 0.05, both, ~both, ~both)
    wall = PlanLine(np.array([1.75, 0.0]), np.array([1.0, 0.0]), np.array([[-1.7, 1.7]]), NONE, 0.01, 0.01, "lidar", 9)
    alone = frontier_lines(near, [wall])
    together = frontier_lines(far, [wall])
    assert alone
    for line in alone:
        same = [
            np.allclose(line.origin, other.origin) and np.allclose(line.direction, other.direction)
            for other in together
        ]
        assert any(same)
