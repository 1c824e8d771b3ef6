"""The plan as a sketch: rooms, walls and openings with letters that a phone shows large enough."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING

import numpy as np

from recon.geometry import Array, rotation2
from recon.model import Layout, Room
from recon.plan import dominant_angle, label_spot, room_area, unseen_bodies, wall_bodies
from recon.report.svg import Frame

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

WIDTH = 360.0
"""Units, about the pixels of a phone."""
LETTERS, SMALL = 13.0, 11.0
"""Units: height of a room's name, and of its area."""
NARROW = 0.55
"""Width of a letter, of its height."""


def sketch(layout: Layout) -> str:
    """An SVG element whose walls stand upright; empty without walls."""
    if not layout.walls:
        return ""
    turn = rotation2(-dominant_angle(layout))
    points = np.concatenate([[w.start, w.end] for w in layout.walls]) @ turn.T
    frame = Frame.around(points, WIDTH, turn=turn)
    bodies, unseen = wall_bodies(layout), unseen_bodies(layout)
    parts = [
        f'<path class="floor" d="{frame.area(room_area(layout))}"/>',
        f'<path class="unseen" d="{frame.area(bodies.intersection(unseen))}"/>',
        f'<path class="walls" d="{frame.area(bodies.difference(unseen))}"/>',
        *(_name(room, frame) for room in layout.rooms),
    ]
    return frame.svg("sketch", "Sketch of the rooms with their areas", parts)


def _name(room: Room, frame: Frame) -> str:
    """Name and area where they fit; the area alone, or nothing, in rooms that are too small."""
    spot, _ = label_spot(room.polygon)
    x, y = frame.place(spot[None])[0]
    free = _free(room.polygon, spot, frame)
    lines = [(room.name, LETTERS, "name"), (f"{room.area:.1f} m\u00b2", SMALL, "area")]
    lines = [line for line in lines if len(line[0]) * line[1] * NARROW <= free]
    top = y - (len(lines) - 1) * LETTERS / 2
    return "".join(
        f'<text class="{kind}" x="{x:.1f}" y="{top + k * LETTERS * 1.15 + 0.35 * size:.1f}" font-size="{size:g}">'
        f"{escape(text)}</text>"
        for k, (text, size, kind) in enumerate(lines)
    )


def _free(polygon: Array, spot: Array, frame: Frame) -> float:
    """Units of the sketch that letters at `spot` have to both sides before they leave the room."""
    import shapely

    across = frame.turn.T @ np.array([1.0, 0.0]) * 1e3
    line: BaseGeometry = shapely.LineString([spot - across, spot + across])
    pieces = shapely.get_parts(line.intersection(shapely.Polygon(polygon)))
    own = min(pieces, key=lambda piece: piece.distance(shapely.Point(spot)), default=None)
    if own is None or own.is_empty:
        return 0.0
    ends = (shapely.get_coordinates(own) - spot) @ across / 1e3
    return float(2 * min(-ends.min(), ends.max()) * frame.scale)
