"""Furniture, open doors, windows and curved walls: what is a wall and what is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely
from layout_drive import chain, check_sound, corner_error, drive, layout_of, line, ring

from recon.geometry import Array
from recon.graph.estimate import WallLine
from recon.layout.line import PlanLine
from recon.layout.sight import within_sight
from recon.model import Layout

Point = tuple[float, float]
ROOM: list[Point] = [(0.0, 0.0), (6.0, 0.0), (6.0, 4.0), (0.0, 4.0)]


@pytest.mark.parametrize(("length", "depth", "slit"), [(1.4, 0.6, 0.0), (2.0, 0.9, 0.05), (0.6, 0.6, 0.3)])
def test_a_wardrobe_in_a_corner_is_no_wall(length: float, depth: float, slit: float) -> None:
    """It fills the upper right corner, `slit` m from the right wall."""
    x0, x1, y = 6.0 - slit - length, 6.0 - slit, 4.0 - depth
    solid = [*chain(*ROOM, ROOM[0]), *chain((x0, 4), (x0, y), (x1, y), (x1, 4))]
    walls = [
        line((0, 0), (6, 0)),
        line((6, 0), (6, 4), (0, y)),
        line((6, 4), (0, 4), (6 - x0, 6)),
        line((0, 4), (0, 0)),
        line((x0, y), (x0, 4)),
        line((x1, y), (x0, y)),
    ]
    poses = drive((1, 1), (5, 1), (3, 2), (1, 2.5))
    layout, scans = layout_of(solid, walls, poses)
    check_sound(layout, scans, poses)
    assert len(layout.rooms) == 1 and corner_error(layout.rooms[0].polygon, ROOM) < 0.02
    footprint = shapely.box(x0, y, x1, 4)
    assert any(shapely.Polygon(thing.footprint).intersects(footprint) for thing in layout.objects)
    unseen = [float(np.ptp(w.unseen, axis=1).sum()) if w.source == "lidar" else w.length for w in layout.walls]
    assert sum(unseen) == pytest.approx(length + depth + slit, abs=0.05)


def test_an_alcove_of_a_room_stays() -> None:
    """An L-shaped room whose short leg is larger than furniture."""
    corners: list[Point] = [(0.0, 0.0), (6.0, 0.0), (6.0, 2.5), (3.0, 2.5), (3.0, 4.0), (0.0, 4.0)]
    poses = drive((1, 1), (5, 1), (2, 1.5), (1.5, 3))
    layout, scans = layout_of(chain(*corners, corners[0]), ring(*corners), poses)
    check_sound(layout, scans, poses)
    assert corner_error(layout.rooms[0].polygon, corners) < 0.01


def test_an_open_leaf_before_a_corner_is_no_wall() -> None:
    """Its hinge is on the jamb next to the corner; nobody sees the corner behind it."""
    solid = [*chain((0.2, 4), (0, 4), (0, 0), (6, 0), (6, 4), (1.2, 4)), *chain((1.2, 4.15), (6, 4.15), (6, 8), (0, 8))]
    solid += [
        *chain((0, 8), (0, 4.15), (0.2, 4.15), (0.2, 4)),
        *chain((1.2, 4.15), (1.2, 4)),
        *chain((0.2, 4), (0.35, 3.02)),
    ]
    walls = [
        line((6, 4), (0, 4), (0, 4.8)),
        line((0, 4), (0, 0), (1.1, 4)),
        line((0, 0), (6, 0)),
        line((6, 0), (6, 4)),
        line((0, 4.15), (6, 4.15), (0, 0.2), (1.2, 6)),
        line((6, 4.15), (6, 8)),
        line((6, 8), (0, 8)),
        line((0, 8), (0, 4.15)),
        line((0.35, 3.02), (0.2, 4)),
    ]
    poses = drive((3, 1), (5, 2), (0.75, 3), (0.75, 5.5), (4, 6))
    layout, scans = layout_of(solid, walls, poses)
    check_sound(layout, scans, poses)
    assert len(layout.rooms) == 2
    lower = min(layout.rooms, key=lambda room: float(room.polygon[:, 1].mean()))
    assert corner_error(lower.polygon, ROOM) < 0.03
    assert any(opening.is_hole for opening in layout.openings)


def half_round(count: int) -> list[Point]:
    """A room whose right end is half a circle of `count` pieces."""
    angles = np.linspace(-np.pi / 2, np.pi / 2, count + 1)
    return [(0.0, 0.0), *((6 + 2 * float(np.cos(t)), 2 + 2 * float(np.sin(t))) for t in angles), (0.0, 4.0)]


@pytest.mark.parametrize("count", [6, 10, 14])
def test_curved_walls_survive_as_short_pieces(count: int) -> None:
    corners = half_round(count)
    poses = drive((1, 1), (5.5, 1), (5.5, 3), (1, 3))
    layout, scans = layout_of(chain(*corners, corners[0]), ring(*corners), poses)
    check_sound(layout, scans, poses)
    assert len(layout.rooms) == 1 and all(wall.source == "lidar" for wall in layout.walls)
    assert corner_error(layout.rooms[0].polygon, corners) < 0.02


def glazed(width: float, furniture: bool) -> tuple[Layout, Array]:
    """A room with a gap in its lower wall that returns no rays, or a board before the wall that hides it."""
    left, right = 3 - width / 2, 3 + width / 2
    solid = chain((right, 0), (6, 0), (6, 4), (0, 4), (0, 0), (left, 0))
    if furniture:
        solid += [*chain((left, 0), (right, 0)), *chain((left, 0), (left, 0.5), (right, 0.5), (right, 0))]
    walls = [line((0, 0), (6, 0), (0, left), (right, 6)), *ring(*ROOM)[1:]]
    layout, _ = layout_of(solid, walls, drive((1, 1), (5, 1), (5, 3), (1, 3)), reach=12.0)
    return layout, np.array([left, right])


@pytest.mark.parametrize("width", [0.8, 1.5, 2.4])
def test_rays_lost_in_an_outer_wall_are_a_window(width: float) -> None:
    layout, ends = glazed(width, furniture=False)
    windows = [opening for opening in layout.openings if opening.type == "window"]
    assert len(windows) == 1 and not windows[0].is_hole and windows[0].sigma_top is None
    assert sorted([windows[0].start[0], windows[0].end[0]]) == pytest.approx(ends, abs=0.1)
    assert all(len(wall.unseen) == 0 for wall in layout.walls)


def test_furniture_before_a_wall_makes_no_window() -> None:
    layout, ends = glazed(1.5, furniture=True)
    assert not layout.openings
    hidden = [wall for wall in layout.walls if len(wall.unseen)]
    assert len(hidden) == 1 and hidden[0].unseen[0] == pytest.approx(ends, abs=0.15)


def test_image_lines_behind_walls_are_left_out() -> None:
    none = np.zeros((0, 2))
    wall = PlanLine(np.zeros(2), np.array([1.0, 0.0]), np.array([[0.0, 6.0]]), none, 0.01, 0.001, "lidar", 9)
    before = replace(wall, origin=np.array([2.0, 1.0]), front=np.array([[0.0, 1.0]]), source="image")
    behind = replace(before, origin=np.array([2.0, -1.5]))
    path = drive((1, 2.5), (5, 2.5))[:, :2]
    assert [kept.origin[1] for kept in within_sight([wall, before, behind], path)] == [0.0, 1.0]


def test_thickness_is_the_distance_of_the_two_faces() -> None:
    """Two rooms side by side, 0.17 m between them, joined by a passage."""
    left: list[Point] = [(0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0)]
    right: list[Point] = [(4.17, 0.0), (8.0, 0.0), (8.0, 4.0), (4.17, 4.0)]
    solid = [
        *chain((4, 1.5), (4, 0), (0, 0), (0, 4), (4, 4), (4, 2.6)),
        *chain((4, 1.5), (4.17, 1.5), (4.17, 0), (8, 0)),
    ]
    solid += [*chain((8, 0), (8, 4), (4.17, 4), (4.17, 2.6), (4, 2.6))]
    walls: list[WallLine] = [w for k, w in enumerate(ring(*left)) if k != 1] + [
        w for k, w in enumerate(ring(*right)) if k != 3
    ]
    walls += [line((4, 0), (4, 4), (0, 1.5), (2.6, 4)), line((4.17, 4), (4.17, 0), (0, 1.4), (2.5, 4))]
    poses = drive((1, 1), (2, 2), (6, 2), (7, 3))
    layout, scans = layout_of(solid, walls, poses)
    check_sound(layout, scans, poses)
    thick = [wall.thickness for wall in layout.walls if wall.thickness is not None]
    assert len(layout.rooms) == 2 and thick == [pytest.approx(0.17, abs=0.01)] * 2
    assert [room.area for room in layout.rooms] == [pytest.approx(16, abs=0.1), pytest.approx(15.32, abs=0.1)]
    assert [room.perimeter for room in layout.rooms] == [pytest.approx(16, abs=0.1), pytest.approx(15.66, abs=0.1)]
