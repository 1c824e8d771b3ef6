from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from two_rooms import two_rooms
from walled_plans import box, odd_models, ring, row_of_rooms

from recon.doorways import doorways
from recon.model import Layout, Opening, Room
from recon.plan import DRAWN_THICKNESS
from recon.solids import FLAT, wall_solids


@settings(max_examples=25, deadline=None)
@given(
    widths=st.lists(st.floats(1.5, 6.0), min_size=1, max_size=5),
    depth=st.floats(2.0, 6.0),
    thickness=st.floats(0.05, 0.5),
    pose=st.tuples(st.floats(-50, 50), st.floats(-50, 50), st.floats(-3, 3)),
)
def test_rooms_in_a_row_have_the_walls_they_were_made_with(
    widths: list[float], depth: float, thickness: float, pose: tuple[float, float, float]
) -> None:
    layout = row_of_rooms(widths, depth, thickness, np.array(pose))
    solids = wall_solids(layout)
    between = [solid for solid in solids if solid.seen > 0]
    assert len(between) == len(widths) - 1  # two faces, one wall
    for solid in between:
        assert solid.thickness == pytest.approx(thickness, abs=1e-6)
        assert solid.seen == pytest.approx(depth, abs=1e-6)
        assert len(solid.front) == len(solid.back) == 1
        assert depth - 1e-6 <= solid.length <= depth + 2 * DRAWN_THICKNESS + 1e-6
    assert all(solid.thickness == DRAWN_THICKNESS for solid in solids if solid.seen == 0)
    # Ground: a frame around everything but the rooms, and nothing twice.
    t, inside = DRAWN_THICKNESS, sum(widths) + (len(widths) - 1) * thickness
    frame = (inside + 2 * t) * (depth + 2 * t) - depth * sum(widths)
    ground = shapely.union_all([solid.footprint for solid in solids])
    assert ground.area == pytest.approx(frame, abs=1e-5)
    assert sum(solid.footprint.area for solid in solids) == pytest.approx(frame, abs=1e-5)
    assert ground.intersection(shapely.union_all([shapely.Polygon(r.polygon) for r in layout.rooms])).area < 1e-5
    assert {face.id for solid in solids for face in solid.faces} == {wall.id for wall in layout.walls}


@settings(max_examples=25, deadline=None)
@given(st.integers(2, 5), st.floats(0.05, 0.5), st.floats(-3, 3))
def test_a_door_seen_from_both_rooms_is_one(count: int, thickness: float, yaw: float) -> None:
    layout = row_of_rooms([3.0] * count, 4.0, thickness, np.array([5.0, -7.0, yaw]))
    found = doorways(layout)
    assert [door.rooms for door in found] == [(i, i + 1) for i in range(count - 1)]
    for door in found:
        assert len(door.openings) == 2
        assert door.width == pytest.approx(0.82, abs=1e-6)  # the mean of 0.80 and 0.84
        assert door.top == 2.1  # the side whose head was seen
        assert door.sigma_top == 0.02


def test_a_long_wall_with_rooms_behind_it_is_one_wall() -> None:
    corridor = box(0.0, -2.0, 12.4, 2.0)
    offices = [box(x, 0.2, 4.0, 5.0) for x in (0.0, 4.2, 8.4)]
    rooms = [corridor, *offices]
    walls = tuple(wall for i, polygon in enumerate(rooms) for wall in ring(polygon, 4 * i))
    solids = wall_solids(Layout(walls, tuple(Room(i, f"{i}", polygon) for i, polygon in enumerate(rooms))))
    long = [solid for solid in solids if len(solid.faces) == 4]
    assert len(long) == 1
    assert {face.id for face in long[0].faces} == {2, 4, 8, 12}
    assert long[0].thickness == pytest.approx(0.2)
    assert long[0].seen == pytest.approx(12.0)
    assert sorted(round(s.thickness, 6) for s in solids if s.seen) == [0.2, 0.2, 0.2]


def test_rooms_that_touch_get_a_thin_wall_and_say_so() -> None:
    left, right = box(0, 0, 3, 3), box(3, 0, 3, 3)
    solids = wall_solids(Layout(ring(left) + ring(right, 4), (Room(0, "a", left), Room(1, "b", right))))
    flat = [solid for solid in solids if solid.flat]
    assert len(flat) == 1
    assert {face.id for face in flat[0].faces} == {1, 7}
    assert flat[0].thickness == FLAT
    assert flat[0].footprint.area == pytest.approx(3 * FLAT, rel=0.02)


def test_pillars_and_free_standing_walls_stand_in_their_room() -> None:
    hall, pillar, screen = box(0, 0, 8, 6), box(2, 2, 0.4, 0.5), box(5, 1, 0.1, 3)
    walls = ring(hall) + ring(pillar[::-1], 4) + ring(screen[::-1], 8)
    solids = wall_solids(Layout(walls, (Room(0, "hall", hall),)))
    for outline, thickness in ((pillar, {0.4, 0.5}), (screen, {0.1})):
        shape = shapely.Polygon(outline)
        inside = [solid for solid in solids if solid.footprint.intersects(shape)]
        ground = shapely.union_all([solid.footprint for solid in inside])
        assert ground.symmetric_difference(shape).area < 1e-5
        assert {round(solid.thickness, 6) for solid in inside} <= thickness
    outer = [solid for solid in solids if solid.seen == 0 and not solid.flat]
    assert sum(solid.footprint.area for solid in outer) == pytest.approx(8.24 * 6.24 - 48)


def test_walls_of_different_thickness_along_one_face_are_several() -> None:
    corridor, near, far = box(0, -2, 8, 2), box(0, 0.1, 3.9, 3), box(4.1, 0.4, 3.9, 3)
    rooms = (Room(0, "c", corridor), Room(1, "n", near), Room(2, "f", far))
    solids = wall_solids(Layout(ring(corridor) + ring(near, 4) + ring(far, 8), rooms))
    measured = sorted(round(s.thickness, 6) for s in solids if s.seen)
    assert measured[0] == 0.1
    assert measured[-1] == 0.4


def test_openings_seen_from_one_side_find_the_room_behind() -> None:
    layout = row_of_rooms([3.0, 3.0], 4.0, 0.2)
    one_sided = replace(layout, openings=layout.openings[:1])
    assert [door.rooms for door in doorways(one_sided)] == [(0, 1)]
    outside = Opening(0, "window", 0, np.array([1.0, 0.0]), np.array([2.0, 0.0]), 0.9, 2.0)
    assert [door.rooms for door in doorways(replace(layout, openings=(outside,)))] == [(0, None)]
    assert [d.type for d in doorways(two_rooms().layout)] == ["door", "passage", "window"]


@pytest.mark.parametrize("name", odd_models())
def test_odd_plans_have_sound_walls(name: str) -> None:
    for solid in wall_solids(odd_models()[name].layout):
        assert solid.footprint.is_valid
        assert solid.footprint.area > 0
        assert solid.length > 0
