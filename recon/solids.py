"""Physical walls: two faces of one wall made one body, with the ground it stands on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from recon.facing import rooms_before
from recon.geometry import Array
from recon.holes import wall_heights
from recon.model import Layout, Wall
from recon.plan import DRAWN_THICKNESS
from recon.polygons import areas, polygons
from recon.strips import FLATTEST, Strip, grouped_strips, strips_of, without_touching

if TYPE_CHECKING:
    from shapely.geometry import Polygon
    from shapely.geometry.base import BaseGeometry

CORNER = 0.01
"""m: ends of faces nearer than this meet."""
GRID = 1e-7
"""m: corners of bodies are rounded to this, which keeps the geometry sound whatever faces cross."""
CONVEX = float(np.sin(np.radians(1.0)))
SLIVER = 0.002
"""m: half the width of leftovers that are not kept."""
SMALLEST = 1e-3
"""m^2 of ground under a wall, at least."""
SHARED = 1e-5
"""m: bodies and rooms that reach into each other by less only touch."""
FLAT = 0.001
"""m, thickness given to walls between rooms that touch: what was seen of their faces stays where it was seen."""
SHORTEST_FLAT = 0.05
"""m: shorter gaps between the bodies of walls are left."""
BESIDE = 0.02
"""m between a face and the body that it belongs to, at most."""


@dataclass(frozen=True)
class WallSolid:
    """A wall that stands on the floor.

    start, end: (2,) m, map frame: its middle line. thickness: m, across; seen: m of its length along which both faces
    were seen; where that is 0, the thickness is assumed. footprint: the ground it takes, in no other wall and in no
    room but one that it stands in, as pillars do. front, back: its faces, those whose free space lies to the left of
    the middle line first. height: m. flat: the rooms on both sides touch, so that no ground is left for the wall: it
    stands FLAT / 2 in each.
    """

    start: Array
    end: Array
    thickness: float
    seen: float
    footprint: Polygon
    front: tuple[Wall, ...]
    back: tuple[Wall, ...]
    height: float
    flat: bool = False

    @property
    def faces(self) -> tuple[Wall, ...]:
        """All of them."""
        return self.front + self.back

    @cached_property
    def length(self) -> float:
        """m."""
        return float(np.linalg.norm(self.end - self.start))

    @cached_property
    def direction(self) -> Array:
        """Unit vector (2,) from start to end."""
        return np.asarray((self.end - self.start) / self.length)

    @property
    def normal(self) -> Array:
        """Unit vector (2,) to the left of `direction`, into the free space before its front."""
        return np.array([-self.direction[1], self.direction[0]])


def wall_solids(layout: Layout) -> tuple[WallSolid, ...]:
    """The physical walls of a layout, in the order of their first faces.

    Faces of no extent have none. Corners go to the longer wall. A wall of which only one face was seen is
    `recon.plan.DRAWN_THICKNESS` thick.
    """
    walls = [wall for wall in layout.walls if wall.length > CORNER]
    groups = [_Group(walls, strips) for strips in grouped_strips(without_touching(walls, strips_of(walls)))]
    ends = _corner_depths(walls, groups)
    bodies = _without(layout, groups, [group.body(ends) for group in groups])
    order = sorted(range(len(groups)), key=lambda n: (-groups[n].seen, -groups[n].length, n))
    heights = wall_heights(layout)
    out = _solids(groups, _parts(_apart(bodies, order)), heights)
    return (*out, *_flat(walls, out, heights))


def _solids(groups: Sequence[_Group], parts: Sequence[list[Polygon]], heights: dict[int, float]) -> list[WallSolid]:
    """Every part of a group's body with those of its faces that it lies beside; those with none are left out."""
    import shapely

    pairs = [(group, part, face) for group, mine in zip(groups, parts, strict=True) for part in mine
             for face in group.faces]  # fmt: skip
    if not pairs:
        return []
    lines = shapely.linestrings(np.array([[face.start, face.end] for _, _, face in pairs]))
    grounds = shapely.buffer([part for _, part, _ in pairs], BESIDE, join_style="mitre")
    beside = shapely.length(shapely.intersection(lines, grounds)) > CORNER
    touching: dict[int, tuple[_Group, Polygon, list[Wall]]] = {}
    for (group, part, face), yes in zip(pairs, beside.tolist(), strict=True):
        if yes:
            touching.setdefault(id(part), (group, part, []))[2].append(face)
    return [group.solid(part, faces, heights) for group, part, faces in touching.values()]


def _flat(walls: Sequence[Wall], solids: Sequence[WallSolid], heights: dict[int, float]) -> list[WallSolid]:
    """Thin walls along the stretches of faces that no body is behind; the second of two such faces joins the first."""
    import shapely

    out: list[WallSolid] = []
    for wall, bare in zip(walls, _bare(walls, solids), strict=True):
        for k, thin in enumerate(out) if bare.length > SHORTEST_FLAT else ():
            if bare.intersection(thin.footprint).length > SHORTEST_FLAT:
                bare = bare.difference(thin.footprint.buffer(BESIDE))
                out[k] = replace(thin, back=(*thin.back, wall), height=max(thin.height, heights[wall.id]))
        for piece in shapely.get_parts(bare):
            if piece.length > SHORTEST_FLAT:
                a, b = sorted(np.asarray(piece.coords), key=lambda p: float((p - wall.start) @ wall.direction))
                half = FLAT / 2 * wall.normal
                ground = shapely.Polygon([a - half, b - half, b + half, a + half])
                out.append(WallSolid(a, b, FLAT, 0.0, ground, (wall,), (), heights[wall.id], flat=True))
    return out


def _bare(walls: Sequence[Wall], solids: Sequence[WallSolid]) -> list[BaseGeometry]:
    """The part of every face that lies beside no body."""
    import shapely

    if not walls:
        return []
    lines = shapely.linestrings(np.array([[wall.start, wall.end] for wall in walls]))
    grounds = shapely.buffer(np.array([solid.footprint for solid in solids], dtype=object), BESIDE, join_style="mitre")
    face, ground = shapely.STRtree(grounds).query(lines, predicate="intersects")
    bare = ~np.isin(np.arange(len(walls)), face[shapely.covers(grounds[ground], lines[face])])
    order = np.lexsort((ground, face))
    for i, k in zip(face[order].tolist(), ground[order].tolist(), strict=True):
        if bare[i]:
            lines[i] = shapely.difference(lines[i], grounds[k])
    return [line if yes else shapely.LineString() for line, yes in zip(lines, bare, strict=True)]


class _Group:
    """The strips of one physical wall."""

    def __init__(self, walls: Sequence[Wall], strips: list[Strip]) -> None:
        self.walls, self.strips = walls, strips
        deep = [s for s in strips if s.depth is not None]
        self.seen = sum(s.length for s in deep) / 2  # each from both sides
        weights = np.array([s.length for s in deep])
        depths = np.array([s.depth for s in deep], dtype=np.float64)
        self.thickness = float(weights @ depths / weights.sum()) if deep else DRAWN_THICKNESS
        self.leader = walls[max(strips, key=lambda s: (s.length, -s.face)).face]
        self.length = max(s.length for s in strips)

    @property
    def faces(self) -> list[Wall]:
        """By their place in the layout."""
        return [self.walls[f] for f in sorted({strip.face for strip in self.strips})]

    def body(self, corners: dict[tuple[int, bool], float]) -> BaseGeometry:
        """Ground behind all strips, carried on past the corners of rooms by the depth of the walls there."""
        import shapely

        parts = []
        for strip in self.strips:
            wall = self.walls[strip.face]
            depth = self.thickness if strip.depth is None else strip.depth
            before = corners.get((strip.face, False), 0.0) if strip.low <= 0.0 else 0.0
            after = corners.get((strip.face, True), 0.0) if strip.high >= wall.length else 0.0
            a, b = (wall.start + s * wall.direction for s in (strip.low - before, strip.high + after))
            behind = None if strip.behind is None else self.walls[strip.behind]
            p, q = (_behind(wall, behind, point, depth) for point in (a, b))
            parts.append(shapely.Polygon([a, b, q, p]))
        return shapely.unary_union(parts)

    def solid(self, footprint: Polygon, touching: Sequence[Wall], heights: dict[int, float]) -> WallSolid:
        """One part of the body, beside which some of the faces lie."""
        import shapely

        along, left = self.leader.direction, self.leader.normal
        points = shapely.get_coordinates(footprint) - self.leader.start
        low, high = (points @ along).min(), (points @ along).max()
        front = tuple(w for w in touching if w.normal @ left > 0)
        middle = self._middle(front) if front else float((points @ left).mean())
        start, end = (self.leader.start + s * along + middle * left for s in (low, high))
        back = tuple(w for w in touching if w.normal @ left <= 0)
        height = max(heights[wall.id] for wall in touching)
        return WallSolid(start, end, self.thickness, self.seen, footprint, front, back, height)

    def _middle(self, front: Sequence[Wall]) -> float:
        """m from the leader's face to the middle line, along its normal."""
        offsets = [0.5 * float((w.start + w.end - 2 * self.leader.start) @ self.leader.normal) for w in front]
        lengths = [w.length for w in front]
        return float(np.average(offsets, weights=lengths)) - self.thickness / 2


def _behind(wall: Wall, back: Wall | None, point: Array, depth: float) -> Array:
    """The point (2,) behind one of a wall's face: on the face at its back, which may lie askew, else at `depth` m."""
    if back is not None:
        depth = max(float((back.start - point) @ back.normal) / float(-wall.normal @ back.normal), FLATTEST)
    return np.asarray(point - depth * wall.normal)


def _corner_depths(walls: Sequence[Wall], groups: Sequence[_Group]) -> dict[tuple[int, bool], float]:
    """By face and end (True: its end), m: thickness of the wall that it meets in a corner with the room inside."""
    from scipy.spatial import cKDTree

    if not walls:
        return {}
    starts = cKDTree(np.array([w.start for w in walls]))
    first, last = [DRAWN_THICKNESS] * len(walls), [DRAWN_THICKNESS] * len(walls)
    for group in groups:
        for strip in group.strips:
            if strip.low <= 0.0:
                first[strip.face] = group.thickness if strip.depth is None else strip.depth
            if strip.high >= walls[strip.face].length:
                last[strip.face] = group.thickness if strip.depth is None else strip.depth
    out: dict[tuple[int, bool], float] = {}
    for i, wall in enumerate(walls):
        for k in sorted(starts.query_ball_point(wall.end, CORNER)):
            other = walls[k].direction
            if wall.direction[0] * other[1] - wall.direction[1] * other[0] > CONVEX:
                out[i, True] = max(out.get((i, True), 0.0), first[k])
                out[k, False] = max(out.get((k, False), 0.0), last[i])
    return out


def _without(layout: Layout, groups: Sequence[_Group], bodies: list[BaseGeometry]) -> list[BaseGeometry]:
    """Bodies less the rooms that they reach into, but for one that they stand in: rooms have no holes for pillars."""
    import shapely

    if not layout.rooms:
        return bodies
    rooms = [areas(shapely.make_valid(shapely.Polygon(room.polygon))) for room in layout.rooms]
    before, index = rooms_before(layout), {room.id: k for k, room in enumerate(layout.rooms)}
    out = list(bodies)
    for n, k in _shared(bodies, rooms):
        fronts = {index[room.id] for face in groups[n].faces if (room := before[face.id]) is not None}
        if k in fronts and shapely.intersection(out[n], rooms[k], grid_size=GRID).area > 0.5 * bodies[n].area:
            continue
        out[n] = areas(shapely.difference(out[n], rooms[k], grid_size=GRID))
    return out


def _apart(bodies: list[BaseGeometry], order: Sequence[int]) -> list[BaseGeometry]:
    """Bodies less those that come before them in `order`."""
    import shapely

    rank = {n: place for place, n in enumerate(order)}
    out = list(bodies)
    for n, k in _shared(bodies, bodies):
        if rank[k] < rank[n]:
            out[n] = areas(shapely.difference(out[n], bodies[k], grid_size=GRID))
    return out


def _shared(bodies: Sequence[BaseGeometry], others: Sequence[BaseGeometry]) -> list[tuple[int, int]]:
    """Pairs of a body and another ground that reach into each other, in order."""
    import shapely

    within = shapely.buffer(np.array(others, dtype=object), -SHARED, join_style="mitre")
    body, other = shapely.STRtree(within).query(np.array(bodies, dtype=object), predicate="intersects")
    return sorted(zip(body.tolist(), other.tolist(), strict=True))


def _parts(bodies: Sequence[BaseGeometry]) -> list[list[Polygon]]:
    """Of every body its polygons, without slivers; from the largest down."""
    import shapely

    inner = shapely.buffer(np.array(bodies, dtype=object), -SLIVER, join_style="mitre")
    solid = [areas(shape) for shape in shapely.buffer(inner, SLIVER, join_style="mitre")]
    kept = shapely.intersection(np.array(solid, dtype=object), np.array(bodies, dtype=object), grid_size=GRID)
    return [
        sorted(map(shapely.orient_polygons, polygons(shape, SMALLEST)), key=lambda p: (-round(p.area, 6), p.bounds))
        for shape in kept
    ]
