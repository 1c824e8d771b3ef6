"""The layout from above: what plans draw of walls, their bodies and openings. Metres, map frame."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from recon.geometry import Array
from recon.model import Layout, Opening, Wall

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

DRAWN_THICKNESS = 0.12
"""m behind a wall's face that drawings fill; how thick a wall is cannot be seen from one side."""
THICKEST_FILLED = 0.45
"""m between the faces of two rooms that still make one solid wall."""
_FLATTEST_CORNER = float(np.sin(np.radians(1.0)))


def dominant_angle(layout: Layout) -> float:
    """Direction in (-pi/4, pi/4] to which most metres of wall are parallel or square; 0 without walls.

    Walls that no sensor saw count only where there are no others.
    """
    walls = [w for w in layout.walls if w.source != "inferred"] or layout.walls
    if not walls:
        return 0.0
    steps = np.array([w.end - w.start for w in walls])
    fourfold = np.arctan2(steps[:, 1], steps[:, 0]) * 4
    weights = np.linalg.norm(steps, axis=1)
    return float(np.angle((weights * np.exp(1j * fourfold)).sum()) / 4)


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
    """Ground taken by the walls: as deep behind each face as it was seen, else DRAWN_THICKNESS, never inside a room.

    Corners are mitred; where the faces of two rooms stand back to back, what is between them is filled. walls: only
    these (default all). cut: leave out the openings.
    """
    import shapely

    chosen = layout.walls if walls is None else walls
    parts = [behind(np.array([wall.start, wall.end]), wall, drawn_depth(wall)) for wall in chosen]
    parts += corner_bodies(layout, {wall.id for wall in chosen})
    rooms, gap = room_area(layout), (THICKEST_FILLED - 2 * DRAWN_THICKNESS) / 2
    solid = shapely.unary_union(parts)
    solid = closed(solid, gap).difference(rooms)
    if cut:
        holes = [behind(ends, wall, depth + 1e-3, front=0.02) for wall, ends, depth in _holes(layout)]
        solid = solid.difference(shapely.unary_union(holes))
    return solid


def closed(shape: BaseGeometry, gap: float) -> BaseGeometry:
    """The shape with gaps of up to 2 `gap` m closed; negative: without its parts narrower than that."""
    with np.errstate(divide="ignore", invalid="ignore"):  # GEOS leaves flags behind; numpy would warn of them
        return shape.buffer(gap, join_style="mitre").buffer(-gap, join_style="mitre")


def drawn_depth(wall: Wall) -> float:
    """m from the face of a wall to its back: measured, else DRAWN_THICKNESS."""
    return DRAWN_THICKNESS if wall.thickness is None else wall.thickness


def opening_depths(layout: Layout) -> list[float]:
    """m, for each opening, through its wall: to the wall's other face, or to the room behind; else DRAWN_THICKNESS."""
    return [depth for _, _, depth in _holes(layout)]


def _holes(layout: Layout) -> list[tuple[Wall, Array, float]]:
    """Of every opening the wall, the ends (2, 2) and the depth."""
    import shapely

    walls = {wall.id: wall for wall in layout.walls}
    rooms = np.array([shapely.Polygon(room.polygon) for room in layout.rooms], dtype=object)
    tree = shapely.STRtree(rooms)
    out = []
    for opening in layout.openings:
        wall = walls[opening.wall]
        ends = opening_ends(opening, wall)
        depth = wall.thickness
        if depth is None:
            middle = ends.mean(axis=0)
            way = shapely.LineString([middle - 0.02 * wall.normal, middle - THICKEST_FILLED * wall.normal])
            face = shapely.Point(middle)
            hit = [face.distance(way.intersection(rooms[k])) for k in tree.query(way, predicate="intersects")]
            depth = min((d for d in hit if d > 0.02 + 1e-6), default=DRAWN_THICKNESS)
        out.append((wall, ends, depth))
    return out


def corner_bodies(layout: Layout, chosen: set[int], both: bool = False) -> list[BaseGeometry]:
    """What lies behind both walls of a corner that the room has on its inside, where one (or both) are `chosen`."""
    import shapely

    starting = {tuple(np.round(wall.start, 6).tolist()): wall for wall in layout.walls}
    out = []
    for a in layout.walls:
        b = starting.get(tuple(np.round(a.end, 6).tolist()))
        if b is None or len(chosen & {a.id, b.id}) < 1 + both:
            continue
        turn = float(a.direction[0] * b.direction[1] - a.direction[1] * b.direction[0])
        if turn < _FLATTEST_CORNER:
            continue
        corner, deep = a.end, (drawn_depth(a), drawn_depth(b))
        backs = corner - deep[0] * a.normal, corner - deep[1] * b.normal
        tip = corner - np.linalg.solve(np.stack([a.normal, b.normal]), np.array(deep))
        sharp = np.linalg.norm(tip - corner) > 4 * max(deep)
        points = [corner, *backs] if sharp else [corner, *backs, tip]
        out.append(shapely.MultiPoint(np.array(points)).convex_hull)
    return out
