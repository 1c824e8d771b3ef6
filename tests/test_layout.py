"""Layouts of hand-made buildings with known truth; rays are cast here, by a few lines of their own."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from layout_drive import chain, check_sound, corner_error, drive, estimated, layout_of, line, ring

from recon.config import LayoutConfig
from recon.geometry import Array
from recon.graph.estimate import WallLine
from recon.layout.build import build_layout
from recon.model import Layout
from recon.sequence.sequence import Scans

L_CORNERS = [(0.0, 0.0), (10.0, 0.0), (10.0, 8.0), (8.0, 8.0), (8.0, 2.0), (0.0, 2.0)]


def corridor() -> tuple[Layout, Scans, Array]:
    """An L-shaped corridor with a recessed door in two walls and one that fills most of the end wall."""
    solid = chain((0, 0), (3, 0), (3, -0.08), (4, -0.08), (4, 0), (10, 0), (10, 8), (9.7, 8), (9.7, 8.07), (8.3, 8.07))
    solid += chain((8.3, 8.07), (8.3, 8), (8, 8), (8, 2), (6, 2), (6, 2.1), (5.1, 2.1), (5.1, 2), (0, 2), (0, 0))
    walls = [
        line((0, 0), (10, 0), (0, 3), (4, 10)),
        line((10, 0), (10, 8)),
        line((10, 8), (8, 8), (0, 0.3), (1.7, 2)),
        line((8, 8), (8, 2)),
        line((8, 2), (0, 2), (0, 2), (2.9, 8)),
        line((0, 2), (0, 0)),
        line((3, -0.08), (4, -0.08)),
        line((9.7, 8.07), (8.3, 8.07)),
        line((6, 2.1), (5.1, 2.1)),
    ]
    poses = drive((1, 1), (9, 1), (9, 6.5))
    layout, scans = layout_of(solid, walls, poses)
    return layout, scans, poses


def test_corridor_goes_on_through_its_recessed_doors() -> None:
    layout, scans, poses = corridor()
    check_sound(layout, scans, poses)
    assert len(layout.walls) == 6 and all(wall.source == "lidar" for wall in layout.walls)
    assert [room.name for room in layout.rooms] == ["corridor"]
    assert corner_error(layout.rooms[0].polygon, L_CORNERS) < 0.01
    assert all(0.003 < wall.sigma_offset < 0.01 for wall in layout.walls)
    doors = sorted((o.type, *np.sort(np.round(np.concatenate([o.start, o.end]), 3))) for o in layout.openings)
    assert len(doors) == 3 and all(door[0] == "door" for door in doors)
    for start, end in (((3, 0), (4, 0)), ((9.7, 8), (8.3, 8)), ((6, 2), (5.1, 2))):
        error = [np.abs(np.stack([o.start, o.end]) - np.array([start, end])).max() for o in layout.openings]
        assert min(error) < 0.04


def test_free_space_is_left_of_every_wall() -> None:
    layout, _, _ = corridor()
    inside = shapely.Polygon(L_CORNERS)
    for wall in layout.walls:
        middle = (wall.start + wall.end) / 2
        assert inside.contains(shapely.Point(middle + 0.1 * wall.normal))
        assert not inside.contains(shapely.Point(middle - 0.1 * wall.normal))


def test_same_input_same_layout() -> None:
    first, second = corridor()[0], corridor()[0]
    assert repr(first) == repr(second)


def test_two_rooms_joined_by_an_open_door() -> None:
    left, right = [(0.0, 0.0), (4.0, 0.0), (4.0, 3.0), (0.0, 3.0)], [(4.15, -1.0), (8.0, -1.0), (8.0, 4.0), (4.15, 4.0)]
    solid = chain((4, 1), (4, 0), (0, 0), (0, 3), (4, 3), (4, 1.9), (4.15, 1.9), (4.15, 4), (8, 4), (8, -1), (4.15, -1))
    solid += chain((4.15, -1), (4.15, 1), (4, 1))
    walls = [line((0, 0), (4, 0)), line((4, 0), (4, 3), (0, 1), (1.9, 3)), line((4, 3), (0, 3)), line((0, 3), (0, 0))]
    walls += [line((4.15, -1), (8, -1)), line((8, -1), (8, 4)), line((8, 4), (4.15, 4))]
    walls += [line((4.15, 4), (4.15, -1), (0, 2.1), (3, 5))]
    poses = drive((1, 1.5), (7, 1.4), (7, 3))
    layout, scans = layout_of(solid, walls, poses)
    check_sound(layout, scans, poses)
    assert len(layout.rooms) == 2
    assert corner_error(layout.rooms[0].polygon, right) < 0.01 and corner_error(layout.rooms[1].polygon, left) < 0.01
    assert len(layout.walls) == 8
    assert len(layout.openings) == 2 and len({o.wall for o in layout.openings}) == 2
    for opening in layout.openings:
        assert opening.type == "passage" and np.ptp([opening.start[1], opening.end[1]]) == pytest.approx(0.9, abs=0.11)
        assert (opening.start[1] + opening.end[1]) / 2 == pytest.approx(1.45, abs=0.05)


def test_walls_at_any_angle() -> None:
    corners = [(0.0, 0.0), (6.0, 0.0), (7.0, 2.5), (4.0, 5.0), (-1.0, 3.0)]
    poses = drive((1, 1), (5, 1.5), (4, 3))
    layout, scans = layout_of(chain(*corners, corners[0]), ring(*corners), poses)
    check_sound(layout, scans, poses)
    assert len(layout.walls) == 5 and corner_error(layout.rooms[0].polygon, corners) < 0.01


def test_end_out_of_range_is_closed_and_said_so() -> None:
    """A corridor 20 m long, of which the scanner sees 8 m beyond the last pose."""
    solid = chain((20, 0), (0, 0), (0, 2), (20, 2))
    poses = drive((1, 1), (6, 1))
    walls = [line((0, 0), (20, 0), (0, 13.9)), line((0, 2), (0, 0)), line((20, 2), (0, 2), (6.1, 20))]
    layout, scans = layout_of(solid, walls, poses, reach=8.0)
    check_sound(layout, scans, poses)
    inferred = [wall for wall in layout.walls if wall.source == "inferred"]
    assert len(layout.rooms) == 1 and inferred
    assert all(wall.sigma_offset >= 0.3 and wall.observations == 0 for wall in inferred)
    assert shapely.Polygon(layout.rooms[0].polygon).bounds == pytest.approx((0, 0, 14, 2), abs=0.25)
    known = sum(wall.length for wall in layout.walls if wall.source == "lidar")
    assert known == pytest.approx(2 + 2 * 13.9, abs=0.8)


def test_furniture_makes_no_walls() -> None:
    """A cupboard against a wall, a bin in a corner and a table leg: one plain room, and their footprints."""
    corners = [(0.0, 0.0), (5.0, 0.0), (5.0, 4.0), (0.0, 4.0)]
    solid = chain(*corners, corners[0]) + chain((2, 0), (2, 0.45), (3.1, 0.45), (3.1, 0))
    solid += chain((4.5, 4), (4.5, 3.6), (5, 3.6)) + chain((2, 2.5), (2.1, 2.5), (2.1, 2.6), (2, 2.6), (2, 2.5))
    walls = [
        line((0, 0), (5, 0), (0, 1.95), (3.15, 5)),
        line((5, 0), (5, 4), (0, 3.6)),
        line((5, 4), (0, 4), (0.5, 5)),
        line((0, 4), (0, 0)),
        line((2, 0.45), (3.1, 0.45)),
        line((4.5, 4), (4.5, 3.6)),
        line((4.5, 3.6), (5, 3.6)),
    ]
    poses = drive((1, 1.5), (4, 1.5), (3.8, 2.8))
    layout, scans = layout_of(solid, walls, poses)
    check_sound(layout, scans, poses)
    assert len(layout.walls) == 4 and corner_error(layout.rooms[0].polygon, corners) < 0.01
    assert not layout.openings
    boxes = [shapely.box(2, 0, 3.1, 0.45), shapely.box(4.5, 3.6, 5, 4), shapely.box(2, 2.5, 2.1, 2.6)]
    assert len(layout.objects) == 3
    for box in boxes:
        assert min(box.hausdorff_distance(shapely.Polygon(o.footprint)) for o in layout.objects) < 0.5
        assert any(shapely.Polygon(o.footprint).intersects(box) for o in layout.objects)


def test_ring_corridor_gives_simple_rooms() -> None:
    outer, inner = (
        [(0.0, 0.0), (12.0, 0.0), (12.0, 9.0), (0.0, 9.0)],
        [(2.0, 2.0), (2.0, 7.0), (10.0, 7.0), (10.0, 2.0)],
    )
    solid = chain(*outer, outer[0]) + chain(*inner, inner[0])
    poses = drive((1, 1), (11, 1), (11, 8), (1, 8), (1, 1.5))
    layout, scans = layout_of(solid, ring(*outer) + ring(*inner), poses)
    check_sound(layout, scans, poses)
    assert len(layout.walls) == 8
    assert sum(shapely.Polygon(room.polygon).area for room in layout.rooms) == pytest.approx(12 * 9 - 8 * 5, rel=0.005)


def test_lines_only_seen_by_images_close_the_outline() -> None:
    """The paper's end wall: beyond the scanner's range, its foot seen in an image."""
    solid = chain((14, 0), (0, 0), (0, 2), (14, 2))
    end = line((14, 0), (14, 2))
    end = WallLine(end.pose, end.intervals, 0.03, 0.01, "image", 4)
    walls = [line((0, 0), (14, 0), (0, 12.9)), end, line((14, 2), (0, 2), (1.1, 14)), line((0, 2), (0, 0))]
    poses = drive((1, 1), (5, 1))
    layout, _ = layout_of(solid, walls, poses, reach=8.0)
    assert corner_error(layout.rooms[0].polygon, [(0, 0), (14, 0), (14, 2), (0, 2)]) < 0.01
    assert [wall.source for wall in layout.walls if abs(wall.direction[1]) > 0.9 and wall.start[0] > 7] == ["image"]


def test_without_walls_the_seen_space_is_closed() -> None:
    """Round room: no straight wall at all, and then no return at all."""
    angle = np.linspace(0, 2 * np.pi, 61)
    circle = [(float(3 * np.cos(a)), float(3 * np.sin(a))) for a in angle]
    poses = drive((-1, 0), (1, 0))
    layout, scans = layout_of(chain(*circle), [], poses)
    check_sound(layout, scans, poses)
    assert shapely.Polygon(layout.rooms[0].polygon).area == pytest.approx(9 * np.pi, rel=0.15)
    assert all(wall.source == "inferred" for wall in layout.walls)
    nothing = Scans(
        scans.timestamps, np.full_like(scans.ranges, np.inf), scans.angle_min, scans.angle_increment, 0.1, 9
    )
    blind = build_layout(estimated([], poses), nothing, LayoutConfig())
    for room in blind.rooms:  # at most the strip that the platform stood on
        assert shapely.Polygon(room.polygon).area < 2.0
    assert all(wall.source == "inferred" for wall in blind.walls) and not blind.openings and not blind.objects
