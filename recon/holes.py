"""Openings as their walls show them in 3D: rectangles cut out of the wall's face."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from recon.facing import rooms_before
from recon.geometry import Array
from recon.model import Layout, Opening, Room, Wall

DECIMALS = 6
"""Places that coordinates in m are rounded to, so that faces that meet share their corners to the last bit."""
SMALLEST = 0.01
"""m: narrower or lower openings are not cut."""
END = 0.01
"""m of wall left at either end, so that its corners stay whole."""


@dataclass(frozen=True)
class Hole:
    """A rectangle in the face of a wall, m: left < right from the wall's end, bottom < top above the floor.

    Left and right are those of a viewer in the room, who has the wall's end on the left.
    """

    opening: Opening
    wall: Wall
    left: float
    bottom: float
    right: float
    top: float

    def ground(self, across: float) -> Array:
        """The point (2,) of the wall's foot `across` m from the wall's end, map frame."""
        return np.asarray((self.wall.end - across * self.wall.direction).round(DECIMALS) + 0.0)

    @property
    def middle(self) -> Array:
        """(2,), m, map frame."""
        return self.ground((self.left + self.right) / 2)

    def overlaps(self, other: Hole) -> bool:
        """Whether two holes of one wall have more than an edge in common."""
        beside = min(self.right, other.right) - max(self.left, other.left)
        return beside > 0 and min(self.top, other.top) - max(self.bottom, other.bottom) > 0


def holes_of(layout: Layout) -> tuple[Hole, ...]:
    """Every opening as a hole, clipped to its wall but for its ends (`END`), in the order of the layout.

    Left out: what is too small, and of openings that overlap all but the first.
    """
    heights, walls = wall_heights(layout), {wall.id: wall for wall in layout.walls}
    by_wall: dict[int, list[Hole]] = {}
    found = []
    for opening in layout.openings:
        wall = walls[opening.wall]
        left, right = sorted(float((wall.end - p) @ wall.direction) for p in (opening.start, opening.end))
        across = max(left, END), min(right, wall.length - END)
        upward = max(opening.bottom, 0.0), min(opening.top, heights[wall.id])
        hole = Hole(opening, wall, across[0], upward[0], across[1], upward[1])
        others = by_wall.setdefault(wall.id, [])
        if min(hole.right - hole.left, hole.top - hole.bottom) > SMALLEST and not any(map(hole.overlaps, others)):
            others.append(hole)
            found.append(hole)
    return tuple(found)


def room_height(layout: Layout, room: Room) -> float:
    """Height of a room's ceiling, m: its own, else the layout's."""
    return layout.extrusion_height if room.ceiling_height is None else room.ceiling_height


def wall_heights(layout: Layout) -> dict[int, float]:
    """Height, m, of every wall (by id): that of the room before it."""
    rooms = rooms_before(layout)
    return {
        wall: layout.extrusion_height if room is None else room_height(layout, room) for wall, room in rooms.items()
    }
