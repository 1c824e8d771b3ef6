"""Furniture along walls and in the middle of rooms, which a scanner takes for walls: where images are to look."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from recon.geometry import Array
from recon.model import Layout, Wall

LENGTH = (0.3, 5.0)
"""m along the wall, of one thing or several in a row."""
DEPTH = (0.2, 1.1)
"""m from its front to the wall behind."""
ISLAND = 0.15, 5.0
"""m^2, of blocks with the room all round ..."""
MOST_SIDES = 10
"""... and so many walls."""
PARALLEL = np.cos(np.radians(10.0))
FARTHEST = 6.0
"""m along the wall behind to where it was seen."""
OVERLAP = 0.2
"""Share of the thing's length within which the wall behind may have been seen."""
OUTSIDE = 0.8
"""Share of the footprint that no room holds."""
MARGIN = 0.05
"""m before and beside a footprint within which lines are the thing's."""
BACK = 0.4
"""Share of the depth, from the wall behind, in which lines are the wall's."""
SLIT = 0.02
"""m between a thing and the wall behind it."""


@dataclass(frozen=True)
class Furniture:
    """What stands before a wall, or as an island in a room: footprint (n, 2), m, map frame, counter-clockwise, convex.

    Before a wall (n = 4) the first two corners are those of the front, seen from the room from right to left, the
    others are on the wall behind.
    """

    footprint: Array
    island: bool = False

    @property
    def polygon(self) -> shapely.Polygon:
        """The footprint."""
        return shapely.Polygon(self.footprint)

    @property
    def depth(self) -> float:
        """m from the wall behind to the front."""
        return float(np.linalg.norm(self.footprint[2:].mean(axis=0) - self.footprint[:2].mean(axis=0)))

    @property
    def normal(self) -> Array:
        """Unit vector (2,) from the wall behind to the front."""
        return np.asarray((self.footprint[:2].mean(axis=0) - self.footprint[2:].mean(axis=0)) / self.depth)

    @property
    def clear_footprint(self) -> Array:
        """The footprint (n, 2), m, just clear of the wall behind."""
        if self.island:
            return self.footprint
        return np.asarray(self.footprint + np.array([0.0, 0.0, 1.0, 1.0])[:, None] * SLIT * self.normal)

    def owns(self, points: Array) -> NDArray[np.bool_]:
        """(N,) whether points (N, 2) lie on its front or its sides, and not on the wall behind."""
        inside = shapely.contains_xy(self.polygon.buffer(MARGIN, join_style="mitre"), points[:, 0], points[:, 1])
        if self.island:
            return np.asarray(inside)
        return np.asarray(inside & ((points - self.footprint[2]) @ self.normal > BACK * self.depth))


def suspects(layout: Layout) -> list[Furniture]:
    """Walls that may be furniture: short ones before the line of another, small blocks with the room all round.

    No room lies between the two, or in the block.
    """
    inner = shapely.union_all([shapely.Polygon(room.polygon) for room in layout.rooms])
    seen = [wall for wall in layout.walls if wall.source == "lidar" and wall.length >= LENGTH[0]]
    fronts = [_before_a_wall(wall, seen) for wall in seen if wall.length <= LENGTH[1]]
    found = [thing for thing in fronts if thing is not None] + _islands(layout.walls)
    return [
        thing
        for thing in found
        if shapely.area(thing.polygon.intersection(inner)) <= (1 - OUTSIDE) * thing.polygon.area
    ]


def _islands(walls: Sequence[Wall]) -> list[Furniture]:
    """Closed chains of walls, clockwise as free space is on their left, around no more than furniture covers."""
    after = {tuple(np.round(wall.start, 3).tolist()): wall for wall in walls}
    found, used = [], set()
    for first in walls:
        chain = [first]
        while len(chain) <= MOST_SIDES and chain[-1].id not in used:
            used.add(chain[-1].id)
            following = after.get(tuple(np.round(chain[-1].end, 3).tolist()))
            if following is None:
                break
            if following is first:
                found += _block(chain)
                break
            chain.append(following)
    return found


def _block(chain: Sequence[Wall]) -> list[Furniture]:
    """What a closed chain of walls holds, if it is of furniture's size and somebody saw it."""
    ring = shapely.LinearRing([wall.start for wall in chain]) if len(chain) > 2 else None
    if ring is None or ring.is_ccw or all(wall.source == "inferred" for wall in chain):
        return []
    hull = shapely.orient_polygons(ring.convex_hull)
    long = max(np.ptp(np.asarray(shapely.oriented_envelope(ring).exterior.coords), axis=0))
    if not ISLAND[0] <= hull.area <= ISLAND[1] or long > LENGTH[1]:
        return []
    return [Furniture(np.asarray(hull.exterior.coords)[:-1], island=True)]


def _before_a_wall(wall: Wall, others: Sequence[Wall]) -> Furniture | None:
    """What a wall is the front of if it is no wall: it reaches back to the nearest line that is seen beside it."""
    best: tuple[float, Wall] | None = None
    for other in others:
        if other.normal @ wall.normal < PARALLEL:
            continue
        ends = np.stack([wall.start, wall.end]) - other.start
        depth, along = ends @ other.normal, ends @ other.direction
        gap = max(along.min() - other.length, -along.max())
        before = DEPTH[0] <= depth.min() and depth.max() <= DEPTH[1] and -OVERLAP * wall.length <= gap <= FARTHEST
        if before and (best is None or gap < best[0]):
            best = gap, other
    if best is None:
        return None
    other = best[1]
    back = [end - ((end - other.start) @ other.normal) * other.normal for end in (wall.start, wall.end)]
    return Furniture(np.stack([wall.end, wall.start, *back]))
