"""Ways through walls: an opening that was seen from both rooms is one doorway."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from recon.facing import rooms_before
from recon.geometry import Array
from recon.model import Layout, Opening, OpeningType, Wall
from recon.plan import opening_span
from recon.polygons import areas
from recon.strips import THICKEST

if TYPE_CHECKING:
    from shapely import STRtree

TOUCHING = 0.05
"""m: two faces of one wall overlap by no more."""
ASKEW = float(np.cos(np.radians(25.0)))
"""Cosine of the angle between the two faces that a way goes through, at least: of wedges, more than of one wall's."""
SHARED = 0.5
"""Share of the narrower opening that the other covers, at least."""
ORDER: tuple[OpeningType, ...] = ("door", "window", "passage")
"""What a doorway is where its two sides differ: the first of these."""


@dataclass(frozen=True)
class Doorway:
    """A door, window or passage through a wall, seen from one side or both.

    start, end: (2,) m, map frame, on the face of `wall` and in its direction. bottom, top: m above the floor. rooms:
    ids of the room before `wall` and the one behind it, None where no room is known.
    """

    openings: tuple[Opening, ...]
    wall: Wall
    type: OpeningType
    open: bool
    start: Array
    end: Array
    bottom: float
    top: float
    rooms: tuple[int | None, int | None]

    @property
    def id(self) -> int:
        """That of its first opening."""
        return self.openings[0].id

    @property
    def width(self) -> float:
        """m."""
        return float(np.linalg.norm(self.end - self.start))

    @property
    def sigma_top(self) -> float | None:
        """m, of the better known side; None where `top` is assumed."""
        return min((o.sigma_top for o in self.openings if o.sigma_top is not None), default=None)


def doorways(layout: Layout) -> tuple[Doorway, ...]:
    """The ways through the walls of a layout, in the order of their first openings; none without extent."""
    import shapely

    walls = {wall.id: wall for wall in layout.walls}
    before = rooms_before(layout)
    front = {wall: None if room is None else room.id for wall, room in before.items()}
    pairs = _pairs(layout.openings, walls)
    rooms = shapely.STRtree([areas(shapely.make_valid(shapely.Polygon(room.polygon))) for room in layout.rooms])
    out = []
    for i, opening in enumerate(layout.openings):
        k = pairs.get(i)
        if k is not None and k < i:
            continue
        sides = (opening,) if k is None else (opening, layout.openings[k])
        wall = walls[opening.wall]
        low, high = np.mean([opening_span(side, wall) for side in sides], axis=0)
        start, end = wall.start + low * wall.direction, wall.start + high * wall.direction
        behind = _room_behind(layout, rooms, wall, 0.5 * (start + end)) if k is None else front[layout.openings[k].wall]
        if high - low <= 0.0:
            continue
        kind = next(kind for kind in ORDER if any(side.type == kind for side in sides))
        bottom, top = _heights(sides)
        is_open = kind == "door" and any(side.open for side in sides)
        out.append(Doorway(sides, wall, kind, is_open, start, end, bottom, top, (front[wall.id], behind)))
    return tuple(out)


def _heights(sides: tuple[Opening, ...]) -> tuple[float, float]:
    """Bottom and top, m: of those whose head was seen, else of all, the mean."""
    known = [side for side in sides if side.sigma_top is not None] or list(sides)
    return float(np.mean([side.bottom for side in known])), float(np.mean([side.top for side in known]))


def _pairs(openings: tuple[Opening, ...], walls: dict[int, Wall]) -> dict[int, int]:
    """Indices of openings that are two sides of one way, both ways round; the nearest first."""
    from scipy.spatial import cKDTree

    if not openings:
        return {}
    middles = np.array([0.5 * (o.start + o.end) for o in openings])
    reach = max(float(np.linalg.norm(o.end - o.start)) for o in openings) / 2 + THICKEST
    found = []
    for i, k in sorted(cKDTree(middles).query_pairs(reach)):
        depth = _depth(openings[i], openings[k], walls)
        if depth is not None:
            found.append((abs(depth), i, k))
    out: dict[int, int] = {}
    for _, i, k in sorted(found):
        if i not in out and k not in out:
            out[i], out[k] = k, i
    return out


def _depth(first: Opening, second: Opening, walls: dict[int, Wall]) -> float | None:
    """m through the wall from one opening to the other; None where they are not two sides of one way."""
    wall, other = walls[first.wall], walls[second.wall]
    if wall.normal @ other.normal > -ASKEW:
        return None
    a, b = opening_span(first, wall), _along(second, wall)
    shared = min(a[1], b[1]) - max(a[0], b[0])
    depth = float((first.start + first.end - second.start - second.end) @ wall.normal) / 2
    beside = shared >= SHARED * min(a[1] - a[0], b[1] - b[0]) and shared > 0
    return depth if beside and -TOUCHING <= depth <= THICKEST else None


def _along(opening: Opening, wall: Wall) -> tuple[float, float]:
    low, high = sorted(float((p - wall.start) @ wall.direction) for p in (opening.start, opening.end))
    return low, high


def _room_behind(layout: Layout, rooms: STRtree, wall: Wall, middle: Array) -> int | None:
    """Id of the nearest room behind a wall at a point (2,) of its face; None where none is within THICKEST."""
    import shapely

    way = shapely.LineString([middle - 0.01 * wall.normal, middle - (THICKEST + 0.01) * wall.normal])
    point = shapely.Point(way.coords[0])
    hit = [(rooms.geometries[k].intersection(way).distance(point), int(k)) for k in rooms.query(way, "intersects")]
    return layout.rooms[min(hit)[1]].id if hit else None
