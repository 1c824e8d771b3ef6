"""Plans with known walls: rooms in a row, and models for what exports must survive."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from recon.geometry import Array, apply2
from recon.model import FloorObject, Layout, Model, Opening, Room, Wall
from recon.occupancy import Occupancy
from recon.sequence.trajectory import Trajectory


def ring(polygon: Array, first: int = 0) -> tuple[Wall, ...]:
    """A wall for each side of a room."""
    ends = np.roll(polygon, -1, axis=0)
    return tuple(
        Wall(first + i, a, b, 0.004, 0.001, "lidar", 9) for i, (a, b) in enumerate(zip(polygon, ends, strict=True))
    )


def box(x: float, y: float, width: float, depth: float) -> Array:
    """Counter-clockwise corners (4, 2) of a rectangle."""
    return np.array([[x, y], [x + width, y], [x + width, y + depth], [x, y + depth]])


def row_of_rooms(widths: list[float], depth: float, thickness: float, pose: Array | None = None) -> Layout:
    """Rooms side by side along x, doors in the walls between them (seen from both sides), moved by a planar pose."""
    walls: list[Wall] = []
    rooms: list[Room] = []
    openings: list[Opening] = []
    left = 0.0
    for i, width in enumerate(widths):
        polygon = box(left, 0.0, width, depth)
        rooms.append(Room(i, f"Raum {i} é漢", polygon))
        walls += ring(polygon, len(walls))
        middle = depth / 2
        if i > 0:  # the door to the room on the left, as both rooms show it
            x = left - thickness
            openings.append(Opening(len(openings), "door", 4 * i - 3, _p(x, middle - 0.4), _p(x, middle + 0.4), 0, 2.0))
            ends = _p(left, middle + 0.42), _p(left, middle - 0.42)
            openings.append(Opening(len(openings), "door", 4 * i + 3, *ends, 0, 2.1, sigma_top=0.02))
        left += width + thickness
    layout = Layout(tuple(walls), tuple(rooms), tuple(openings), ceiling_height=2.5, sigma_ceiling=0.01)
    return layout if pose is None else placed(layout, pose)


def placed(layout: Layout, pose: Array) -> Layout:
    """Walls, rooms and openings moved by a planar pose."""
    return replace(
        layout,
        walls=tuple(replace(w, start=apply2(pose, w.start), end=apply2(pose, w.end)) for w in layout.walls),
        rooms=tuple(replace(r, polygon=apply2(pose, r.polygon)) for r in layout.rooms),
        openings=tuple(replace(o, start=apply2(pose, o.start), end=apply2(pose, o.end)) for o in layout.openings),
    )


def odd_models() -> dict[str, Model]:
    """What no exporter may stumble over, by name."""
    square, large, inner = box(0, 0, 4, 3), box(0, 0, 6, 6), box(2, 2, 2, 2)[::-1]
    keyed = np.array([[0, 0], [6, 0], [6, 6], [0, 6], [0, 0], [2, 2], [2, 4], [4, 4], [4, 2], [2, 2]], dtype=np.float64)
    name = "Zoë 漢字 🏠 \\X2\\ ' \" <a&b> \n\t\x00\u202e " + "x" * 400
    nothing = np.zeros(2)
    lone = Wall(0, nothing, np.array([3.0, 0.0]), 0.01, 0.001, "lidar", 3)
    empty = Wall(1, nothing, nothing, np.inf, np.inf, "inferred", 0)
    far = box(-1e4, -1e4, 4, 3)
    things = (FloorObject(0, far[:3], 0.1, 0.7), FloorObject(1, far[[0, 1, 0]]), FloorObject(2, far[1:]))
    layouts = {
        "nothing": Layout((), ()),
        "one wall": Layout((lone,), ()),
        "a wall without extent": Layout((lone, empty), (), (Opening(0, "window", 1, nothing, nothing, 0.0, 1.0),)),
        "a room with a hole": Layout(ring(large) + ring(inner, 4), (Room(0, "keyed", keyed),)),
        "a room in a room": Layout(ring(large) + ring(inner, 4), (Room(0, "a", large), Room(1, "b", inner[::-1]))),
        name: Layout(ring(square), (Room(0, name, square), Room(7, "", square - 100.0))),
        "negative": Layout(ring(far), (Room(0, "far", far),), objects=things),
        "a door as wide as its wall": Layout(
            ring(square), (Room(0, "r", square),), (Opening(0, "passage", 0, square[0], square[1], 0.0, 9.0),)
        ),
        "crossed": Layout(ring(square), (Room(0, "r", square[[0, 2, 1, 3]]), Room(1, "flat", square[[0, 1, 0]]))),
        "half a character": Layout(ring(square), (Room(0, "r\udcff", square),)),
    }
    return {title: Model(title, layout, (), (title,)) for title, layout in layouts.items()}


def drive() -> tuple[Trajectory, Array, Occupancy]:
    """Three poses, their standard deviations, and a grid of 3 x 2 cells."""
    poses = np.array([[0.0, 0.0, 0.0], [1.0, 0.5, 0.4], [2.0, -0.25, -3.0]])
    sigmas = np.array([[1e-5, 1e-5, 1e-6], [0.002, 0.003, 0.001], [0.004, 0.005, 0.0015]])
    cells = np.array([[2, 2, 0], [1, 1, 2]], np.uint8)
    return (
        Trajectory(np.array([1.5e9, 1.5e9 + 0.1, 1.5e9 + 0.25]), poses),
        sigmas,
        Occupancy(_p(-1.0, 2.0), 0.05, cells),
    )


def _p(x: float, y: float) -> Array:
    return np.array([x, y], dtype=np.float64)
