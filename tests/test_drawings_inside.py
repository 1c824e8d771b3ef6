"""Dimensions inside of rooms: where they stand."""

from __future__ import annotations

import numpy as np
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from recon.geometry import Array, rotation2
from recon.model import Dimension, FloorObject, Layout, Model, Room, Wall
from recon.plan.draw import draw_plan
from recon.plan.drawing import Dimension as Drawn
from recon.plan.placement import Taken

OUTLINE = np.array([[0.0, 0.0], [8.0, 0.0], [8.0, 6.0], [0.0, 6.0]])
PILLAR = np.array([[-0.3, -0.3], [0.3, -0.3], [0.3, 0.3], [-0.3, 0.3]])


def inside(*footprints: Array) -> list[tuple[str, Array, Array]]:
    """Text, box and line (map) of the dimensions inside a room of 8 x 6 m with objects."""
    ends = zip(OUTLINE, np.roll(OUTLINE, -1, axis=0), strict=True)
    walls = [Wall(k, a, b, 0.004, 0.001, "lidar", 5) for k, (a, b) in enumerate(ends)]
    # a wall askew, so that no chain outside says the sizes of the room
    walls.append(Wall(4, np.array([0.0, 6.0]), np.array([-0.5, 7.5]), 0.004, 0.001, "lidar", 5))
    across = Dimension(0, (0, 2), np.array([4.0, 0.0]), np.array([4.0, 6.0]), 0.006)
    along = Dimension(0, (1, 3), np.array([8.0, 3.0]), np.array([0.0, 3.0]), 0.005)
    objects = tuple(FloorObject(k, footprint) for k, footprint in enumerate(footprints))
    layout = Layout(tuple(walls), (Room(0, "room", OUTLINE),), objects=objects, dimensions=(across, along))
    drawing = draw_plan(Model("room", layout, ()))
    drawn = [e for e in drawing.plan if isinstance(e, Drawn) and not e.extensions and e.text is not None]
    return [(e.text.text, drawing.to_map(e.text.box), drawing.to_map(e.line)) for e in drawn if e.text is not None]


@given(st.floats(0.8, 7.2), st.floats(0.8, 5.2))
@settings(deadline=None, max_examples=25)
def test_figures_and_lines_keep_clear_of_what_stands_in_the_room(x: float, y: float) -> None:
    footprint = PILLAR + np.array([x, y])
    dimensions = inside(footprint)
    assert sorted(text for text, _, _ in dimensions) == ["6.000 ± 0.006 m", "8.000 ± 0.005 m"]
    for _, box, line in dimensions:
        assert not shapely.Polygon(box).intersects(shapely.Polygon(footprint))
        assert not shapely.LineString(line).intersects(shapely.Polygon(footprint))


@given(st.lists(st.tuples(st.floats(-9, 9), st.floats(-9, 9), st.floats(0.1, 4), st.floats(0, 3.2)), max_size=12))
@settings(deadline=None)
def test_places_are_taken_where_shapes_touch(boxes: list[tuple[float, float, float, float]]) -> None:
    shapes = list[shapely.Polygon]()
    taken = Taken()
    for number, (x, y, size, angle) in enumerate(boxes):
        turn = rotation2(angle if number % 2 else 0.0)
        box = np.array([x, y]) + np.array([[0.0, 0.0], [size, 0.0], [size, 1.0], [0.0, 1.0]]) @ turn.T
        outline = shapely.Polygon(box)
        near = min((outline.distance(other) for other in shapes), default=1.0)
        deep = max((outline.intersection(other).area for other in shapes), default=0.0)
        if deep > 1e-6 or near > 1e-6:  # what touches in a point may be either
            assert taken.free(box) == (near > 0)
        taken.add(box)
        shapes.append(outline)
