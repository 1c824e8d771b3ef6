"""Walls as a plan shows them: what they are filled with, and the lines around."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from recon.geometry import Array
from recon.model import Layout, Wall
from recon.plan.drawing import Element, Fill, Polyline
from recon.plan.layers import BACK, FILL, INFERRED, WALL
from recon.plan.walls import (
    behind,
    closed,
    corner_bodies,
    drawn_depth,
    solid_pieces,
    unseen_bodies,
    unseen_pieces,
    wall_bodies,
)

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

GRID = 1e-5
"""m; lines nearer than this are one line."""
THINNEST = 0.008
"""m; narrower leftovers of a fill are not drawn."""
CORE = 0.1
"""m; half as wide are the gaps between walls with two seen faces that are closed: where they meet."""
SHORTEST = 0.004
"""m; nor are shorter lines."""
MEASURED, ASSUMED = ((58, 63, 71), 250), ((188, 192, 197), 253)
"""Colour on paper and AutoCAD's number: of walls with two seen faces, and of those with one."""


@dataclass(frozen=True)
class Solids:
    """Ground inside walls: between two seen faces, behind one, and all of it."""

    measured: BaseGeometry
    assumed: BaseGeometry
    whole: BaseGeometry

    @staticmethod
    def of(layout: Layout) -> Solids:
        """The walls of the layout without their openings."""
        import shapely

        whole = wall_bodies(layout)
        unseen = _only(shapely.intersection, unseen_bodies(layout), whole)
        deep = [w for w in layout.walls if w.thickness is not None]
        parts = [behind(np.array([w.start, w.end]), w, drawn_depth(w)) for w in deep]
        between = shapely.unary_union(parts + corner_bodies(layout, {w.id for w in deep}, both=True))
        solid = _only(shapely.difference, whole, unseen)
        measured = _only(shapely.intersection, closed(between, CORE), solid)
        assumed = closed(_only(shapely.difference, solid, measured), -THINNEST / 2)
        seen = shapely.STRtree([shapely.LineString(f.points) for f in faces(layout) if f.layer is WALL])
        rest = np.array(_polygons(assumed), dtype=object)
        behind_seen = rest[np.unique(seen.query(rest, predicate="dwithin", distance=GRID)[0])]
        return Solids(measured, shapely.MultiPolygon(list(behind_seen)), whole)


def draw_walls(layout: Layout, solids: Solids) -> Iterator[Element]:
    """Fills, then the backs of walls, then the faces that were seen and those that were not."""
    for solid, tone in ((solids.assumed, ASSUMED), (solids.measured, MEASURED)):
        for polygon in _polygons(solid):
            rings = (polygon.exterior, *polygon.interiors)
            yield Fill(FILL, tuple(np.array(ring.coords)[:-1] for ring in rings), *tone)
    yield from _backs(layout, solids)
    yield from faces(layout)


def faces(layout: Layout) -> Iterator[Polyline]:
    """The faces of all walls between their openings, on one layer what was seen, on another what was not."""
    for wall in layout.walls:
        for piece in solid_pieces(layout, wall):
            yield from _face(wall, piece)


def _face(wall: Wall, piece: Array) -> Iterator[Polyline]:
    """A piece (2, 2) of a wall, cut where seen and unseen stretches meet."""
    low, high = (piece - wall.start) @ wall.direction
    unseen = np.array([np.sort((ends - wall.start) @ wall.direction) for ends in unseen_pieces(wall)]).reshape(-1, 2)
    cuts = np.unique(np.concatenate([[low, high], np.clip(unseen.ravel(), low, high)]))
    for a, b in pairwise(cuts):
        if b - a > 1e-6:
            hidden = bool(np.any((unseen[:, 0] < (a + b) / 2) & ((a + b) / 2 < unseen[:, 1])))
            points = wall.start + np.array([[a], [b]]) * wall.direction
            yield Polyline(INFERRED if hidden else WALL, points, source=wall)


def _backs(layout: Layout, solids: Solids) -> Iterator[Polyline]:
    """The outlines of walls that are no faces: jambs between two seen faces, and what is assumed."""
    import shapely

    walls = [shapely.LineString(piece) for wall in layout.walls for piece in solid_pieces(layout, wall)]
    rest = shapely.difference(solids.whole.boundary, shapely.unary_union(walls), grid_size=GRID)
    lines = [line for line in shapely.get_parts(shapely.line_merge(rest)) if line.length > SHORTEST]
    seen = solids.measured.buffer(10 * GRID)
    shapely.prepare(seen)
    for line in lines:
        yield Polyline(WALL if seen.covers(line) else BACK, np.array(line.coords), thin=seen.covers(line))


def _only(operation: Callable[..., BaseGeometry], a: BaseGeometry, b: BaseGeometry) -> BaseGeometry:
    """The areas that an overlay gives, on a grid (which never fails), without lines and points."""
    import shapely

    return shapely.MultiPolygon(_polygons(operation(a, b, grid_size=GRID / 10)))


def _polygons(solid: BaseGeometry) -> list[BaseGeometry]:
    import shapely

    return [p for p in shapely.get_parts(solid) if p.geom_type == "Polygon" and p.area > GRID**2]
