"""The building as one closed solid: floor, walls with their thickness, ceilings; what is printed or run into."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array
from recon.holes import DECIMALS, holes_of, room_height
from recon.model import Layout
from recon.niches import THICKEST, Niche, niches
from recon.polygons import areas, polygons
from recon.solids import BESIDE, GRID, WallSolid, wall_solids

if TYPE_CHECKING:
    from shapely import STRtree
    from shapely.geometry.base import BaseGeometry

SLAB = 0.1
"""m of floor below the rooms, and of ceiling above the highest."""
LEAF = 0.04
"""m of leaf or glass behind its face, where the wall is less deep than that."""
BEYOND = 5e-3
"""m that what is cut away reaches past the faces it ends at, so that no film is left."""
GAP = 1e-4
"""m that rooms are smaller than they are: such as touch in an edge would leave a solid without thickness there."""
SLIT = 1e-3
"""m: half the width of gaps between walls that are filled."""
LIP = 2e-3
"""m that the floor stands out."""
PRECISION = 1e-4
"""m: smaller details are merged, which keeps the mesh closed when it is rounded to single precision."""


def building_body(layout: Layout, ceiling: bool = True) -> tuple[Array, NDArray[np.int64]]:
    """Vertices (V, 3), m, map frame, and triangles (T, 3), counter-clockwise from outside: every edge has two.

    Its inner sides are the faces of `recon.faces.extrude`: the air of every room and the niche of every opening are
    cut out of a block. Walls are those of `recon.solids`. Passages and open doors go through the whole wall; closed
    doors and windows are solid. ceiling: without it the rooms are open above. Empty where the layout is.
    """
    import shapely

    solids = wall_solids(layout)
    rooms = [areas(shapely.make_valid(shapely.Polygon(room.polygon))) for room in layout.rooms]
    heights = [room_height(layout, room) for room in layout.rooms]
    grounds = [solid.footprint for solid in solids]
    tree = shapely.STRtree(grounds)
    top = SLAB + max([*heights, *(solid.height for solid in solids)], default=0.0)
    outline = _closed(shapely.union_all([*rooms, *grounds]))
    openings = niches(holes_of(layout))
    filled = [_prism(outline, -SLAB, top)] if ceiling else [_prism(outline, -SLAB, 0.0), *_standing(solids)]
    filled += [_backing(niche) for niche in openings if not niche.hole.opening.is_hole]
    air = [
        _prism(_air(room, grounds, tree), 0.0, height if ceiling else top)
        for room, height in zip(rooms, heights, strict=True)
    ]
    air += [part for niche in openings for part in _cut(niche, solids, tree)]
    mesh = (_union(filled) - _union(air)).simplify(PRECISION).to_mesh64()
    return _welded(np.array(mesh.vert_properties).reshape(-1, 3), np.array(mesh.tri_verts, np.int64).reshape(-1, 3))


def _welded(vertices: Array, triangles: NDArray[np.int64]) -> tuple[Array, NDArray[np.int64]]:
    """The mesh with one vertex for those that are as good as one, and without the triangles that this flattens."""
    points, index = np.unique(vertices.round(DECIMALS) + 0.0, axis=0, return_inverse=True)
    triangles = index.reshape(-1)[triangles]
    a, b, c = triangles.T
    return points, triangles[(a != b) & (b != c) & (c != a)]


def _standing(solids: tuple[WallSolid, ...]) -> list[Any]:
    """Walls of one height each as one prism, which begins in the floor."""
    import shapely

    by_height: dict[float, list[Any]] = {}
    for solid in solids:
        by_height.setdefault(round(solid.height, 3), []).append(solid.footprint)
    return [
        _prism(shapely.union_all(parts).buffer(3 * GAP, join_style="mitre"), -SLAB / 2, height)
        for height, parts in sorted(by_height.items())
    ]


def _closed(outline: BaseGeometry) -> BaseGeometry:
    """The ground of everything, slits between rooms and walls filled, and a lip, with which no wall's side is level."""
    import shapely

    filled = outline.buffer(BESIDE, join_style="mitre").buffer(-BESIDE, join_style="mitre")
    return areas(shapely.union(outline, areas(filled)).buffer(LIP, join_style="mitre"))


def _air(room: BaseGeometry, grounds: list[Any], tree: STRtree) -> BaseGeometry:
    """A room less the walls that stand in it, and less slits; two that touch in a corner are GAP apart."""
    import shapely

    standing = [grounds[k] for k in np.sort(tree.query(room, predicate="intersects"))]
    free = areas(shapely.difference(room, shapely.union_all(standing), grid_size=GRID))
    return free.buffer(-SLIT, join_style="mitre").buffer(SLIT - GAP, join_style="mitre")


def _cut(niche: Niche, solids: tuple[WallSolid, ...], tree: STRtree) -> list[Any]:
    """The niche, and where nothing fills it and no opening is known behind, the way on through the wall."""
    front, back = niche.corners()
    through = niche.hole.opening.is_hole and not niche.met
    deep = max(niche.depth, _depth(niche, solids, tree) if through else 0.0)
    if deep < BEYOND:
        return []
    if through:
        back = front - deep * np.array([*niche.hole.wall.normal, 0.0])
    along = (back - front) / np.linalg.norm(back - front, axis=1, keepdims=True)
    return [_hull(front - BEYOND * along, back + BEYOND * along if niche.hole.opening.is_hole else back)]


def _depth(niche: Niche, solids: tuple[WallSolid, ...], tree: STRtree) -> float:
    """m from the face of the wall back to where the bodies behind its opening end."""
    import shapely

    wall, middle = niche.hole.wall, niche.hole.middle
    line = shapely.LineString([middle, middle - THICKEST * wall.normal])
    spans = []
    for k in tree.query(line, predicate="intersects"):
        for piece in shapely.get_parts(line.intersection(solids[k].footprint)):
            depths = (middle - shapely.get_coordinates(piece)) @ wall.normal
            spans.append((float(depths.min()), float(depths.max())))
    reach = 0.0
    for low, high in sorted(spans):
        if low <= reach + BESIDE:
            reach = max(reach, high)
    return reach


def _backing(niche: Niche) -> Any:
    """Leaf or glass behind the face that closes a niche; the wall alone may be less deep."""
    _, back = niche.corners()
    return _hull(back, back - LEAF * np.array([*niche.hole.wall.normal, 0.0]))


def _hull(first: Array, second: Array) -> Any:
    from manifold3d import Manifold

    return Manifold.hull_points(np.concatenate([first, second]))


def _prism(shape: BaseGeometry, bottom: float, top: float) -> Any:
    """A shape of any polygons, extruded."""
    from manifold3d import CrossSection, FillRule, Manifold

    rings = [ring for polygon in polygons(shape) for ring in (polygon.exterior, *polygon.interiors)]
    if shape.is_empty or top <= bottom:
        return Manifold()
    outlines = [np.asarray(ring.coords)[:-1, :2] for ring in rings]
    return Manifold.extrude(CrossSection(outlines, FillRule.EvenOdd), top - bottom).translate((0.0, 0.0, bottom))


def _union(parts: list[Any]) -> Any:
    from manifold3d import Manifold, OpType

    return Manifold.batch_boolean(parts, OpType.Add) if parts else Manifold()
