"""The layout in 3D: walls extruded, openings cut out and lined, floors and ceilings cut into triangles."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from recon.corners import Corners, with_points
from recon.geometry import Array
from recon.holes import DECIMALS, Hole, holes_of, room_height, wall_heights
from recon.model import Face, FaceKind, Layout, Room, Wall
from recon.polygons import polygons
from recon.reveals import reveals

if TYPE_CHECKING:
    from shapely.geometry import Polygon

Triangles = NDArray[np.int64]
SMALLEST = 1e-6
"""m, m2: walls shorter and polygons smaller than this give no face."""
GRIDS = (0.0, 1e-6, 1e-4, 1e-3)
"""m: spacing of the grids on which triangles are sought, one after the other (0: none)."""


def extrude(layout: Layout) -> tuple[Face, ...]:
    """Faces without textures, map frame: walls (by order in the layout), floors and ceilings, the sides of openings.

    Triangles are counter-clockwise seen from the free space. A wall's picture is what a viewer who faces it sees: u
    runs from its end (on the left) to its start, v up. Openings are holes in their wall, lined and, where they are
    closed, filled by faces of their own (`recon.reveals`). In the picture of a floor or ceiling u runs along the
    narrowest enclosing rectangle. uv covers [0, 1] x [0, 1] and is proportional to metres. Walls are as high as the
    ceiling of the room that they face.

    Faces that meet share corners and edges, to the last bit: a room is watertight where its walls and doors are closed.
    """
    heights, holes = wall_heights(layout), holes_of(layout)
    by_wall: dict[int, list[Hole]] = {}
    for hole in holes:
        by_wall.setdefault(hole.wall.id, []).append(hole)
    walls = [wall for wall in layout.walls if wall.length > SMALLEST]
    ends = [np.array([wall.start, wall.end]) for wall in walls] + [room.polygon for room in layout.rooms]
    corners = Corners(ends)
    grounds = Corners(ends + _ends([hole for hole in holes if hole.bottom <= 0.0]))
    tops = Corners(ends + _ends([hole for hole in holes if hole.top >= heights[hole.wall.id]]))
    faces = [_wall_face(wall, heights[wall.id], by_wall.get(wall.id, []), corners) for wall in walls]
    for room in layout.rooms:
        height = room_height(layout, room)
        faces += [_flat_face(room, height, "floor", grounds), _flat_face(room, height, "ceiling", tops)]
    return tuple(face for face in (*faces, *reveals(holes)) if len(face.triangles))


def _ends(holes: list[Hole]) -> list[Array]:
    """The ground points below both sides of holes, in one array or none."""
    return [np.array([hole.ground(x) for hole in holes for x in (hole.left, hole.right)])] if holes else []


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
        parts = polygons(shape, SMALLEST**2)
        try:
            triangles = [t for p in parts for t in shapely.constrained_delaunay_triangles(p).geoms]
        except shapely.errors.GEOSException:
            if grid == GRIDS[-1]:
                raise
            continue
        return [np.asarray(t.exterior.coords)[:3] for t in triangles]
    return []


def _wall_face(wall: Wall, height: float, holes: list[Hole], corners: Corners) -> Face:
    from shapely.geometry import Polygon, box

    shape: Any = Polygon([(0, 0), (wall.length, 0), (wall.length, height), (0, height)])
    for hole in holes:
        shape = shape.difference(box(hole.left, hole.bottom, hole.right, hole.top))
    met = (wall.end - corners.on(wall.start, wall.end)) @ wall.direction
    met = np.concatenate([np.column_stack([met, np.full(len(met), z)]) for z in (0.0, height)])
    flat, triangles = triangulate(with_points(shape, met))
    ground = corners.snapped(wall.end - flat[:, :1] * wall.direction)
    vertices = np.column_stack([ground, flat[:, 1].round(DECIMALS)])
    uv = flat / np.array([wall.length, height])
    return Face(f"wall_{wall.id:03d}", "wall", wall.id, vertices, triangles, uv)


def _flat_face(room: Room, height: float, kind: FaceKind, corners: Corners) -> Face:
    """Floor (normal up) or ceiling (normal down) of a room."""
    from shapely.geometry import Polygon

    around = Polygon(room.polygon)
    flat, triangles = triangulate(with_points(around, corners.around(around)))
    up = kind == "floor"
    right = _principal_direction(room.polygon)
    back = np.array([-right[1], right[0]]) * (1.0 if up else -1.0)
    along = flat @ np.stack([right, back], axis=1)
    low, high = (along.min(axis=0), along.max(axis=0)) if len(flat) else (np.zeros(2), np.ones(2))
    uv = (along - low) / np.maximum(high - low, SMALLEST)
    vertices = np.column_stack([corners.snapped(flat), np.full(len(flat), 0.0 if up else height)])
    if not up:
        triangles = triangles[:, ::-1]
    return Face(f"{kind}_{room.id:03d}", kind, room.id, vertices, np.ascontiguousarray(triangles), uv)


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
