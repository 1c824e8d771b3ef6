"""Objects of the layout as things that images show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely

from recon.geometry import Array
from recon.model import FloorObject, Wall
from recon.segmentation.column import Column

LEG = 0.22
"""m: what is thinner may be a leg of something."""
LEGS_APART = 1.1
"""m between neighbouring legs of one thing, at most."""
JUT = 0.06
"""m by which backs, seats and tops are wider than legs."""
AGAINST = 0.3
"""m: a thing this near a wall stands against it; what is left between them was too near the wall to be told from it."""


@dataclass(frozen=True)
class Thing:
    """What an object's pixels may be: `core` columns stopped the scanner's rays, and all of it is in `reach`.

    A solid thing fills its core; of others (tables, chairs) the scanner saw the legs.
    """

    core: tuple[Column, ...]
    reach: Column
    solid: bool

    @staticmethod
    def of(item: FloorObject, walls: tuple[Wall, ...]) -> Thing:
        """An object and the walls that it may stand against."""
        pieces = item.legs if item.legs else (item.footprint,)
        solid = len(pieces) == 1 and not _is_leg(pieces[0])
        feet = [_foot(pieces[0], wall) for wall in walls] if solid else []
        outline = convex_hull((*pieces, *feet)) if solid else _around(pieces)
        return Thing(tuple(Column(piece) for piece in pieces), Column(outline), solid)

    def lowest(self, origin: Array, directions: Array) -> Array:
        """As `Column.meet`, for the core."""
        return np.asarray(np.min([column.meet(origin, directions)[0] for column in self.core], axis=0))


def join_legs(objects: tuple[FloorObject, ...]) -> tuple[FloorObject, ...]:
    """Objects, the legs of one thing as one object; ids are counted anew."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    if not objects:
        return ()
    legs = np.array([i for i, o in enumerate(objects) if _is_leg(o.footprint)], dtype=np.int64)
    tree = shapely.STRtree([shapely.Polygon(objects[i].footprint) for i in legs])
    first, second = tree.query(tree.geometries, predicate="dwithin", distance=LEGS_APART)
    links = coo_array((np.ones(len(first)), (legs[first], legs[second])), shape=(len(objects), len(objects)))
    owner = connected_components(links, directed=False)[1]
    joined: list[FloorObject] = []
    for k in np.unique(owner):
        own = [objects[i] for i in np.flatnonzero(owner == k)]
        pieces = tuple(item.footprint for item in own)
        one = own[0] if len(own) == 1 else replace(own[0], footprint=convex_hull(pieces), legs=pieces)
        joined.append(replace(one, id=len(joined)))
    return tuple(joined)


def convex_hull(parts: Sequence[Array]) -> Array:
    """Counter-clockwise corners (n, 2) of the hull of points (m, 2)."""
    hull = shapely.MultiPoint(np.concatenate(parts)).convex_hull
    return np.asarray(shapely.orient_polygons(hull).exterior.coords)[:-1]


def _around(legs: Sequence[Array]) -> Array:
    """Corners (n, 2) of the narrowest rectangle about legs, of which some may be hidden, and what is above juts out."""
    box = shapely.oriented_envelope(shapely.MultiPoint(np.concatenate(legs)))
    return np.asarray(shapely.orient_polygons(box.buffer(JUT, join_style="mitre")).exterior.coords)[:-1]


def _is_leg(footprint: Array) -> bool:
    return bool(np.ptp(footprint, axis=0).max() <= LEG)


def _foot(footprint: Array, wall: Wall) -> Array:
    """The footprint's shadow (n, 2) on a wall that it stands against; nothing for other walls."""
    along = (footprint - wall.start) @ wall.direction
    depth = (footprint - wall.start) @ wall.normal
    beside = (along > 0) & (along < wall.length)
    if not beside.any() or not 0.0 <= depth[beside].min() <= AGAINST:
        return np.zeros((0, 2))
    near = beside & (depth < depth[beside].min() + AGAINST)
    return np.asarray(wall.start + along[near, None] * wall.direction)
