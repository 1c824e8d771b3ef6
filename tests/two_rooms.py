"""A small model made by hand: an L-shaped room and a square one, with a passage, doors and a window."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array
from recon.model import Face, FloorObject, Layout, Model, Opening, Room, Wall

HEIGHT = 2.5
QUADRANTS = {
    "lower left": (40, 60, 220),
    "lower right": (230, 200, 30),
    "upper right": (30, 170, 60),
    "upper left": (210, 40, 30),
}
"""Colours of the four quarters of every texture, so that a mirrored or turned picture is noticed."""

L_ROOM = np.array([[0.0, 0.0], [6.0, 0.0], [6.0, 2.0], [2.0, 2.0], [2.0, 5.0], [0.0, 5.0]])
SQUARE_ROOM = np.array([[2.2, 2.2], [6.0, 2.2], [6.0, 5.0], [2.2, 5.0]])


def two_rooms(textured: bool = True) -> Model:
    """The model, in metres: floor at z = 0, ceiling at HEIGHT, bounds (0, 0) to (6, 5). Odd walls have no texture."""
    rooms = (Room(0, "Büro 1", L_ROOM), Room(1, "Küche & Flur <2>", SQUARE_ROOM))
    walls: list[Wall] = []
    for room in rooms:
        for start, end in zip(room.polygon, np.roll(room.polygon, -1, axis=0), strict=True):
            walls.append(Wall(len(walls), start, end, 0.01 + 0.001 * len(walls), 0.002, "lidar", 10 + len(walls)))
    openings = (
        Opening(0, "door", 0, np.array([1.0, 0.0]), np.array([1.9, 0.0]), 0.0, 2.05),
        Opening(1, "passage", 2, np.array([4.5, 2.0]), np.array([3.5, 2.0]), 0.0, 2.1),
        Opening(2, "passage", 6, np.array([3.5, 2.2]), np.array([4.5, 2.2]), 0.0, 2.1),
        Opening(3, "window", 5, np.array([0.0, 3.0]), np.array([0.0, 1.5]), 0.9, 2.0),
    )
    objects = (FloorObject(0, np.array([[5.0, 4.0], [5.6, 4.0], [5.6, 4.6], [5.0, 4.6]])),)
    layout = Layout(tuple(walls), rooms, openings, objects, ceiling_height=HEIGHT)
    faces = [wall_face(w, picture(w.length, HEIGHT) if textured and w.id % 2 == 0 else None) for w in walls]
    for room in rooms:
        faces += [flat_face(room, up, picture(6.0, 5.0) if textured else None) for up in (True, False)]
    return Model("Büro", layout, tuple(faces), notes=("The ceiling height is assumed.",), metadata={"source": "hand"})


def picture(width: float, height: float) -> NDArray[np.uint8]:
    """A texture of 2 cm texels for width x height m, its quarters in QUADRANTS."""
    rows, columns = round(height / 0.02), round(width / 0.02)
    texture = np.zeros((rows, columns, 3), np.uint8)
    for name, colour in QUADRANTS.items():
        vertical = slice(rows // 2) if "upper" in name else slice(rows // 2, None)
        horizontal = slice(columns // 2) if "left" in name else slice(columns // 2, None)
        texture[vertical, horizontal] = colour
    return texture


def wall_face(wall: Wall, texture: NDArray[np.uint8] | None) -> Face:
    """Who looks at a wall from the free space has its end on the left and its start on the right."""
    ground = np.array([wall.end, wall.start, wall.start, wall.end])
    vertices = np.column_stack([ground, [0.0, 0.0, HEIGHT, HEIGHT]])
    uv = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    triangles = np.array([[0, 1, 2], [0, 2, 3]])
    return Face(f"wall_{wall.id:03d}", "wall", wall.id, vertices, triangles, uv, texture, 0.02, 0.75)


def flat_face(room: Room, floor: bool, texture: NDArray[np.uint8] | None) -> Face:
    """Floor or ceiling, cut into triangles from its first corner (which sees all others in both rooms)."""
    low, high = room.polygon.min(axis=0), room.polygon.max(axis=0)
    uv = (room.polygon - low) / (high - low)
    n = len(room.polygon)
    fan = np.array([[0, i, i + 1] for i in range(1, n - 1)])
    vertices = np.column_stack([room.polygon, np.full(n, 0.0 if floor else HEIGHT)])
    if floor:
        return Face(f"floor_{room.id:03d}", "floor", room.id, vertices, fan, uv, texture, 0.02, 1.0)
    uv = uv * [-1, 1] + [1, 0]  # from below, x runs to the left
    return Face(f"ceiling_{room.id:03d}", "ceiling", room.id, vertices, fan[:, ::-1], uv, texture, 0.02, 0.5)


def corner(face: Face, name: str) -> Array:
    """The vertex (3,) at a corner of the picture, by its name in QUADRANTS."""
    target = [float("right" in name), float("upper" in name)]
    return np.asarray(face.vertices[np.linalg.norm(face.uv - target, axis=1).argmin()])
