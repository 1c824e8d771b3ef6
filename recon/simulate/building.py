"""The building as flat surfaces: what the camera sees and the LiDAR hits, with the true labels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array
from recon.simulate.check import footprint, standing_objects
from recon.simulate.openings import Niche, edge, first_wall_ids, niches
from recon.simulate.plan import Plan, PlanObject

Kind = Literal["wall", "floor", "ceiling", "threshold", "reveal", "leaf", "glass", "object"]
FLOOR, CEILING, OBJECT, FIRST_WALL = 1, 2, 3, 10
"""Label values (FORMAT.md); wall k is FIRST_WALL + k."""
UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Surface:
    """A flat piece with its own coordinates (u to the right, v up, m) as seen from the free side.

    origin, axis_u, axis_v: (3,), plan frame; their cross product points into the free space. vertices: (V, 2) in u, v,
    all >= 0; a vertical surface is made of rectangles of four vertices each. triangles: (T, 3). ref: the wall, opening
    or object it belongs to.
    """

    kind: Kind
    origin: Array
    axis_u: Array
    axis_v: Array
    vertices: Array
    triangles: NDArray[np.int64]
    label: int
    room: int
    ref: int

    @property
    def normal(self) -> Array:
        """Unit vector (3,) into the free space."""
        return np.cross(self.axis_u, self.axis_v)

    @property
    def size(self) -> tuple[float, float]:
        """Extent in u and v, m."""
        u, v = self.vertices.max(axis=0)
        return float(u), float(v)

    def points(self) -> Array:
        """Vertices (V, 3) in the plan frame."""
        return self.at(self.vertices)

    def at(self, uv: Array) -> Array:
        """Points (..., 3), plan frame, at (..., 2) u, v."""
        return np.asarray(self.origin + uv[..., :1] * self.axis_u + uv[..., 1:] * self.axis_v)


@dataclass(frozen=True)
class Building:
    """Everything there is. objects: the plan's and the open leaves."""

    plan: Plan
    surfaces: tuple[Surface, ...]
    niches: tuple[Niche, ...]
    objects: tuple[PlanObject, ...]


def build_building(plan: Plan) -> Building:
    """The surfaces of a checked plan: walls by room and edge first, so that wall k is surface k."""
    import shapely

    found = niches(plan)
    objects = standing_objects(plan, found)
    surfaces = _walls(plan, found)
    for room in range(len(plan.rooms)):
        surfaces += _floor_and_ceiling(plan, room)
    for index, niche in enumerate(found):
        surfaces += _niche(niche, index)
    rooms = shapely.polygons([shapely.linearrings(room.polygon) for room in plan.rooms])
    for index, item in enumerate(objects):
        surfaces += _object(rooms, item, index)
    return Building(plan, tuple(surfaces), tuple(found), objects)


def room_height(plan: Plan, room: int) -> float:
    """Ceiling height of a room, m."""
    own = plan.rooms[room].ceiling_height
    return plan.ceiling_height if own is None else own


def _walls(plan: Plan, found: list[Niche]) -> list[Surface]:
    out = []
    first = first_wall_ids(plan)
    for room, shape in enumerate(plan.rooms):
        height = room_height(plan, room)
        for wall in range(len(shape.polygon)):
            start, end = edge(plan, room, wall)
            wall_id = first[room] + wall
            rectangles = _wall_rectangles(start, end, height, [n for n in found if n.wall == wall_id])
            out.append(_vertical("wall", start, end, 0.0, rectangles, (FIRST_WALL + wall_id, room, wall_id)))
    return out


def _wall_rectangles(start: Array, end: Array, height: float, holes: list[Niche]) -> list[tuple[float, ...]]:
    """(u0, v0, u1, v1) around the holes; u runs from the wall's end to its start."""
    length = float(np.linalg.norm(end - start))
    along = (start - end) / length
    spans = sorted((*sorted((n.front - end) @ along), n.bottom, n.top) for n in holes)
    out, done = [], 0.0
    for u0, u1, bottom, top in spans:
        out += [(done, 0.0, u0, height), (u0, 0.0, u1, bottom), (u0, top, u1, height)]
        done = u1
    out.append((done, 0.0, length, height))
    return [r for r in out if r[2] - r[0] > 1e-9 and r[3] - r[1] > 1e-9]


def _vertical(
    kind: Kind, start: Array, end: Array, bottom: float, rectangles: list[tuple[float, ...]], tags: tuple[int, int, int]
) -> Surface:
    """A vertical surface with the free space on the left from start to end; tags: label, room, ref."""
    vertices = np.array([[[a, b], [c, b], [c, d], [a, d]] for a, b, c, d in rectangles]).reshape(-1, 2)
    quads = 4 * np.arange(len(rectangles))[:, None, None]
    triangles = (quads + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3)
    origin = np.array([end[0], end[1], bottom])
    axis_u = np.append(start - end, 0.0) / np.linalg.norm(start - end)
    return Surface(kind, origin, axis_u, UP, vertices, triangles, *tags)


def _upright(kind: Kind, start: Array, end: Array, z: tuple[float, float], tags: tuple[int, int, int]) -> Surface:
    size = (0.0, 0.0, float(np.linalg.norm(end - start)), z[1] - z[0])
    return _vertical(kind, start, end, z[0], [size], tags)


def _flat(kind: Kind, polygon: Array, z: float, up: bool, tags: tuple[int, int, int]) -> Surface:
    """A horizontal surface seen from above or below, its u axis along the polygon's longest edge."""
    from shapely import constrained_delaunay_triangles
    from shapely.geometry import Polygon

    steps = np.roll(polygon, -1, axis=0) - polygon
    longest = steps[np.linalg.norm(steps, axis=1).round(6).argmax()]
    u = longest / np.linalg.norm(longest)
    v = np.array([-u[1], u[0]]) * (1.0 if up else -1.0)
    corner = np.array([(polygon @ u).min(), (polygon @ v).min()])
    origin = np.append(corner[0] * u + corner[1] * v, z)
    parts = constrained_delaunay_triangles(Polygon(polygon)).geoms
    corners = np.concatenate([np.asarray(p.exterior.coords)[:3] for p in parts])
    vertices = corners @ np.stack([u, v], axis=1) - corner
    triangles = np.arange(len(vertices)).reshape(-1, 3)
    return Surface(kind, origin, np.append(u, 0.0), np.append(v, 0.0), vertices, triangles, *tags)


def _floor_and_ceiling(plan: Plan, room: int) -> list[Surface]:
    polygon = np.array(plan.rooms[room].polygon)
    floor = _flat("floor", polygon, 0.0, True, (FLOOR, room, room))
    return [floor, _flat("ceiling", polygon, room_height(plan, room), False, (CEILING, room, room))]


def _niche(niche: Niche, index: int) -> list[Surface]:
    """Reveals, threshold, lintel and leaf or glass; all but the threshold carry the wall's label (FORMAT.md)."""
    tags = (FIRST_WALL + niche.wall, niche.room, index)
    z = (niche.bottom, niche.top)
    quad = np.concatenate([niche.front, niche.back[::-1]])
    out = [
        _upright("reveal", niche.front[0], niche.back[0], z, tags),
        _upright("reveal", niche.back[1], niche.front[1], z, tags),
        _flat("reveal", quad[::-1], niche.top, False, tags),
    ]
    if niche.bottom == 0.0:
        out.append(_flat("threshold", quad[::-1], 0.0, True, (FLOOR, niche.room, index)))
    else:
        out.append(_flat("reveal", quad[::-1], niche.bottom, True, tags))
    if niche.closed != "nothing":
        out.append(_upright(niche.closed, niche.back[0], niche.back[1], z, tags))
    return out


def _object(rooms: NDArray[np.object_], item: PlanObject, index: int) -> list[Surface]:
    """An object's sides and top, in the nearest of the rooms' polygons."""
    import shapely

    outline = footprint(item)
    tags = (OBJECT, int(np.argmin(shapely.distance(rooms, shapely.Point(item.center)))), index)
    sides = zip(np.roll(outline, -1, axis=0), outline, strict=True)
    out = [_upright("object", a, b, (item.bottom, item.top), tags) for a, b in sides]
    out.append(_flat("object", outline, item.top, True, tags))
    if item.bottom > 0.0:
        out.append(_flat("object", outline, item.bottom, False, tags))
    return out
