"""The layout in 3D: walls extruded, floors and ceilings cut into triangles."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array
from recon.model import Face, Layout, Opening, Room, Wall

if TYPE_CHECKING:
    from shapely.geometry import Polygon

Triangles = NDArray[np.int64]
SMALLEST = 1e-6
"""m, m2: walls shorter and polygons smaller than this give no face."""
GRIDS = (0.0, 1e-6, 1e-4, 1e-3)
"""m: spacing of the grids on which triangles are sought, one after the other (0: none)."""


def extrude(layout: Layout) -> tuple[Face, ...]:
    """Faces without textures, map frame: one a wall (by order in the layout), then floor and ceiling of every room.

    Triangles are counter-clockwise seen from the free space. A wall's picture is what a viewer who faces it sees: u
    runs from its end (on the left) to its start, v up. Passages and open doors are holes in their wall; closed doors
    and windows are not. In the picture of a floor or ceiling u runs along the narrowest enclosing rectangle. uv covers
    [0, 1] x [0, 1] and is proportional to metres. Walls are as high as the ceiling of the room that they face.
    """
    walls = (_wall_face(layout, wall) for wall in layout.walls if wall.length > SMALLEST)
    flats = (_flat_face(layout, room, kind) for room in layout.rooms for kind in ("floor", "ceiling"))
    return tuple(face for face in (*walls, *flats) if len(face.triangles))


def triangulate(polygon: Polygon) -> tuple[Array, Triangles]:
    """Vertices (V, 2) and counter-clockwise triangles (T, 3) of a polygon of any shape, holes included.

    Constrained Delaunay triangles: no vertex is added, long slivers are avoided.
    """
    corners = _corners(polygon)
    if not corners:
        return np.zeros((0, 2)), np.zeros((0, 3), np.int64)
    vertices, inverse = np.unique(np.concatenate(corners), axis=0, return_inverse=True)
    triangles = inverse.reshape(-1, 3).astype(np.int64)
    a, b, c = (vertices[triangles[:, i]] for i in range(3))
    area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    triangles[area < 0] = triangles[area < 0][:, ::-1]
    return vertices, triangles[np.abs(area) > SMALLEST**2]


def _corners(polygon: Polygon) -> list[Array]:
    """Triangles (3, 2). GEOS stumbles over holes that are slivers; these vanish on a grid."""
    import shapely

    for grid in GRIDS:
        shape = shapely.make_valid(polygon if grid == 0 else shapely.set_precision(polygon, grid))
        parts = [part for part in _polygons(shape) if part.area > SMALLEST**2]
        try:
            triangles = [t for p in parts for t in shapely.constrained_delaunay_triangles(p).geoms]
        except shapely.errors.GEOSException:
            if grid == GRIDS[-1]:
                raise
            continue
        return [np.asarray(t.exterior.coords)[:3] for t in triangles]
    return []


def room_height(layout: Layout, room: Room) -> float:
    """Height of a room's ceiling, m: its own, else the layout's."""
    return layout.extrusion_height if room.ceiling_height is None else room.ceiling_height


def _polygons(shape: Any) -> Iterable[Polygon]:
    """The polygons of a shapely geometry of any type."""
    if shape.geom_type == "Polygon":
        return [shape]
    return [part for part in getattr(shape, "geoms", ()) if part.geom_type == "Polygon"]


def _wall_face(layout: Layout, wall: Wall) -> Face:
    from shapely.geometry import Polygon, box

    height = _wall_height(layout, wall)
    holes = [_hole(wall, o) for o in layout.openings if o.wall == wall.id and o.is_hole]
    if holes:
        shape: Any = Polygon([(0, 0), (wall.length, 0), (wall.length, height), (0, height)])
        for hole in holes:
            shape = shape.difference(box(*hole))
        flat, triangles = triangulate(shape)
    else:
        flat = np.array([[0, 0], [wall.length, 0], [wall.length, height], [0, height]])
        triangles = np.array([[0, 1, 2], [0, 2, 3]])
    ground = wall.end - flat[:, :1] * wall.direction
    vertices = np.column_stack([ground, flat[:, 1]])
    uv = flat / np.array([wall.length, height])
    return Face(f"wall_{wall.id:03d}", "wall", wall.id, vertices, triangles, uv)


def _hole(wall: Wall, opening: Opening) -> tuple[float, float, float, float]:
    """(left, bottom, right, top) of an opening on the wall as seen from inside, m from its end and above the floor."""
    left, right = sorted(float((wall.end - p) @ wall.direction) for p in (opening.start, opening.end))
    return max(left, 0.0), max(opening.bottom, 0.0), min(right, wall.length), opening.top


def _wall_height(layout: Layout, wall: Wall) -> float:
    """Height of the room in front of the middle of the wall."""
    from shapely.geometry import Point, Polygon

    if all(room.ceiling_height is None for room in layout.rooms):
        return layout.extrusion_height
    front = Point(0.5 * (wall.start + wall.end) + 0.05 * wall.normal)
    for room in layout.rooms:
        if Polygon(room.polygon).contains(front):
            return room_height(layout, room)
    return layout.extrusion_height


def _flat_face(layout: Layout, room: Room, kind: str) -> Face:
    """Floor (normal up) or ceiling (normal down) of a room."""
    from shapely.geometry import Polygon

    flat, triangles = triangulate(Polygon(room.polygon))
    up = kind == "floor"
    z = 0.0 if up else room_height(layout, room)
    right = _principal_direction(room.polygon)
    back = np.array([-right[1], right[0]]) * (1.0 if up else -1.0)
    along = flat @ np.stack([right, back], axis=1)
    low, high = (along.min(axis=0), along.max(axis=0)) if len(flat) else (np.zeros(2), np.ones(2))
    uv = (along - low) / np.maximum(high - low, SMALLEST)
    vertices = np.column_stack([flat, np.full(len(flat), z)])
    if not up:
        triangles = triangles[:, ::-1]
    name = f"{kind}_{room.id:03d}"
    return Face(name, "floor" if up else "ceiling", room.id, vertices, np.ascontiguousarray(triangles), uv)


def _principal_direction(polygon: Array) -> Array:
    """Unit vector (2,) along a side of the narrowest enclosing rectangle, within 45 degrees of the map's x axis."""
    from shapely.geometry import MultiPoint

    rectangle = MultiPoint(polygon).minimum_rotated_rectangle
    if rectangle.geom_type != "Polygon":
        return np.array([1.0, 0.0])
    corners = np.asarray(rectangle.exterior.coords)
    side = corners[1] - corners[0]
    angle = float(np.arctan2(side[1], side[0]))
    angle -= np.pi / 2 * np.round(angle / (np.pi / 2))
    return np.array([np.cos(angle), np.sin(angle)])
