"""The layout from above: what plans draw of walls, their bodies and openings. Metres, map frame."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from recon.geometry import Array
from recon.model import Dimension, Layout, Opening, Wall

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

DRAWN_THICKNESS = 0.12
"""m behind a wall's face that drawings fill; how thick a wall is cannot be seen from one side."""
_SAME_WAY = np.cos(np.radians(20.0))
_THICKEST_FILLED = 0.45  # m between the faces of two rooms that still make one solid wall


def dominant_angle(layout: Layout) -> float:
    """Direction in (-pi/4, pi/4] to which most metres of wall are parallel or square; 0 without walls."""
    if not layout.walls:
        return 0.0
    steps = np.array([w.end - w.start for w in layout.walls])
    fourfold = np.arctan2(steps[:, 1], steps[:, 0]) * 4
    weights = np.linalg.norm(steps, axis=1)
    return float(np.angle((weights * np.exp(1j * fourfold)).sum()) / 4)


def drawn_dimensions(layout: Layout) -> list[Dimension]:
    """Of the dimensions of every room the longest along each of its directions: what a plan has room for."""
    kept: list[Dimension] = []
    for dimension in sorted(layout.dimensions, key=lambda d: (d.room, -d.distance)):
        way = (dimension.end - dimension.start) / dimension.distance
        before = [(d.end - d.start) / d.distance for d in kept if d.room == dimension.room]
        if all(abs(float(way @ other)) < _SAME_WAY for other in before):
            kept.append(dimension)
    return kept


def sigma_text(sigma: float) -> str:
    """A standard deviation (m) as plans print it: in whole millimetres, rounded up."""
    return f"±{np.ceil(sigma * 1000 - 1e-6) / 1000:.3f}"


def opening_span(opening: Opening, wall: Wall) -> tuple[float, float]:
    """Where along `wall` the opening is: m from the wall's start, first < second, clipped to the wall."""
    along = np.array([opening.start - wall.start, opening.end - wall.start]) @ wall.direction
    low, high = np.clip(np.sort(along), 0.0, wall.length)
    return float(low), float(high)


def opening_ends(opening: Opening, wall: Wall) -> Array:
    """The opening's ends (2, 2) on the line of the wall, in the wall's direction."""
    return np.array([wall.start + d * wall.direction for d in opening_span(opening, wall)])


def solid_pieces(layout: Layout, wall: Wall) -> list[Array]:
    """The parts of `wall` between its openings, each (2, 2) in the wall's direction; none shorter than 1 mm."""
    spans = sorted(opening_span(o, wall) for o in layout.openings if o.wall == wall.id)
    pieces, position = [], 0.0
    for low, high in [*spans, (wall.length, wall.length)]:
        if low - position > 1e-3:
            pieces.append(np.array([wall.start + d * wall.direction for d in (position, low)]))
        position = max(position, high)
    return pieces


def unseen_pieces(wall: Wall) -> list[Array]:
    """The stretches (2, 2) of a wall that no sensor saw: all of an inferred one."""
    spans = np.array([[0.0, wall.length]]) if wall.source == "inferred" else wall.unseen
    return [wall.start + span[:, None] * wall.direction for span in spans]


def unseen_bodies(layout: Layout) -> BaseGeometry:
    """Ground behind the stretches of walls that no sensor saw; half of it where the wall's other face was seen."""
    import shapely

    parts = []
    for wall in layout.walls:
        depth = DRAWN_THICKNESS * (1.1 if wall.thickness is None else 0.5)
        parts += [behind(ends, wall, depth, front=0.02) for ends in unseen_pieces(wall)]
    return shapely.unary_union(parts)


def behind(ends: Array, wall: Wall, depth: float, front: float = 0.0) -> BaseGeometry:
    """The rectangle from `front` m before to `depth` m behind the face of `wall` between `ends` (2, 2)."""
    import shapely

    n = wall.normal
    return shapely.Polygon([ends[0] + front * n, ends[1] + front * n, ends[1] - depth * n, ends[0] - depth * n])


def room_area(layout: Layout) -> BaseGeometry:
    """Union of all rooms."""
    import shapely

    return shapely.unary_union([shapely.Polygon(room.polygon) for room in layout.rooms])


def label_spot(polygon: Array) -> tuple[Array, float]:
    """Where the label of a room (n, 2) goes, (2,), and the radius, m, of the free circle around it.

    The centroid where there is about as much room as anywhere, else the middle of the largest circle in the room.
    """
    import shapely
    from shapely.ops import polylabel

    shape = shapely.Polygon(polygon)
    centroid, widest = shape.centroid, polylabel(shape, tolerance=0.05)
    inside = shape.contains(centroid)
    enough = inside and centroid.distance(shape.exterior) > 0.9 * widest.distance(shape.exterior)
    spot = centroid if enough else widest
    return np.array([spot.x, spot.y]), float(spot.distance(shape.exterior))


def wall_bodies(layout: Layout, walls: tuple[Wall, ...] | None = None, cut: bool = True) -> BaseGeometry:
    """Ground taken by the walls: DRAWN_THICKNESS behind each face, mitred at corners, never inside a room.

    Where the faces of two rooms stand back to back, what is between them is filled. walls: only these (default all).
    cut: leave out the openings.
    """
    import shapely

    chosen = layout.walls if walls is None else walls
    rooms, t = room_area(layout), DRAWN_THICKNESS
    around = rooms.buffer(t, join_style="mitre").difference(rooms)
    parts = []
    for wall in chosen:
        ends = np.array([wall.start, wall.end])
        longer = ends + np.outer([-t, t], wall.direction)
        parts += [behind(ends, wall, t), around.intersection(behind(longer, wall, t))]
    gap = (_THICKEST_FILLED - 2 * t) / 2
    solid = shapely.unary_union(parts)
    solid = solid.buffer(gap, join_style="mitre").buffer(-gap, join_style="mitre").difference(rooms)
    if cut:
        holes = [_hole(o, layout.wall(o.wall)) for o in layout.openings]
        solid = solid.difference(shapely.unary_union(holes))
    return solid


def _hole(opening: Opening, wall: Wall) -> BaseGeometry:
    return behind(opening_ends(opening, wall), wall, _THICKEST_FILLED, front=0.02)
