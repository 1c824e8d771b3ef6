"""The solid behind flat faces, in convex bodies that stand out in front of no other face."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.exporters.shape import face_normal
from recon.geometry import Array, plane_axes
from recon.model import Face

DEPTH = 0.05
"""m behind the face."""
THINNEST = 5e-4
"""m behind faces that touch back to back."""
FACING_AWAY = -0.99
OUT = 1e-3
"""m that a body may stand out in front of a face beside its own: right angles are never quite right."""
CONVEX = 1e-6
"""Share of its convex hull's area that a convex piece may lack."""


@dataclass(frozen=True)
class Body:
    """A closed convex body. vertices: (V, 3) m. triangles: (T, 3), turned outwards. edge: (3,) m, one on the face."""

    vertices: Array
    triangles: NDArray[np.int64]
    edge: Array


def bodies_behind(faces: Sequence[Face]) -> list[list[Body]]:
    """For every face the bodies that fill up to DEPTH m behind it.

    They end where another face looks out of the same wall: half of the way to one that is parallel, at one that meets
    it in an edge sharper than a right angle.
    """
    if not faces:
        return []
    planes = _Planes(faces)
    return [
        [planes.behind(body) for body in convex_bodies(face, depth)]
        for face, depth in zip(faces, planes.free_depths(), strict=True)
    ]


class _Planes:
    """All faces: their unit normals (F, 3), levels (F,) m along them, and boxes around them (F, 3), (F, 3) m."""

    def __init__(self, faces: Sequence[Face]) -> None:
        self.faces = faces
        self.normals = np.array([face_normal(face) for face in faces])
        self.levels = np.array([float(np.mean(f.vertices @ n)) for f, n in zip(faces, self.normals, strict=True)])
        self.low = np.array([face.vertices.min(axis=0) for face in faces])
        self.high = np.array([face.vertices.max(axis=0) for face in faces])

    def free_depths(self) -> list[float]:
        """DEPTH, less where another looks away behind it: half of the way to that, at least THINNEST."""
        depths: list[float] = []
        for normal, low, high in zip(self.normals, self.low - DEPTH, self.high + DEPTH, strict=True):
            near = (self.normals @ normal < FACING_AWAY) & self._near(low, high, DEPTH)
            level = float(np.mean(self.faces[len(depths)].vertices @ normal))
            behind = [level - float(np.mean(self.faces[k].vertices @ normal)) for k in np.flatnonzero(near).tolist()]
            between = [way for way in behind if way > -DEPTH / 10]
            depths.append(float(np.clip(min(between, default=2 * DEPTH) / 2, THINNEST, DEPTH)))
        return depths

    def behind(self, body: Body) -> Body:
        """The body without what is in front of a face that it comes through."""
        front = body.vertices[: len(body.vertices) // 2]
        high = (body.vertices @ self.normals.T - self.levels).max(axis=0)
        out: NDArray[np.bool_] = (high > OUT) & ((front @ self.normals.T - self.levels).max(axis=0) < OUT)
        out = out & self._near(body.vertices.min(axis=0), body.vertices.max(axis=0), OUT)
        through = [k for k in np.flatnonzero(out).tolist() if self._comes_through(body, k)]
        return _cut(body, self.normals[through], self.levels[through]) if through else body

    def _near(self, low: Array, high: Array, margin: float) -> NDArray[np.bool_]:
        near: NDArray[np.bool_] = np.asarray(((self.low - margin < high) & (self.high + margin > low)).all(axis=1))
        return near

    def _comes_through(self, body: Body, number: int) -> bool:
        """Whether the body and the face have more than an edge in common."""
        import shapely

        normal, face = self.normals[number], self.faces[number]
        height = body.vertices @ normal - self.levels[number]
        a, b = body.triangles.ravel(), np.roll(body.triangles, -1, axis=1).ravel()
        crossed = height[a] * height[b] <= 0
        a, b = a[crossed & (height[a] != height[b])], b[crossed & (height[a] != height[b])]
        share = (height[a] / (height[a] - height[b]))[:, None]
        axes = plane_axes(normal)[:2]
        section = shapely.MultiPoint((body.vertices[a] + share * (body.vertices[b] - body.vertices[a])) @ axes.T)
        outline = shapely.union_all(shapely.polygons((face.vertices @ axes.T)[face.triangles]))
        return bool(section.convex_hull.intersection(outline).area > OUT**2)


def _cut(body: Body, normals: Array, levels: Array) -> Body:
    """What is behind planes (n, 3), (n,)."""
    import manifold3d

    solid = manifold3d.Manifold.hull_points(body.vertices)
    for normal, level in zip(normals, levels, strict=True):
        left = solid.trim_by_plane(tuple(-normal), -float(level))
        solid = solid if left.is_empty() else left
    mesh = solid.hull().to_mesh64()
    vertices = np.asarray(mesh.vert_properties, np.float64)[:, :3]
    return Body(vertices, np.asarray(mesh.tri_verts, np.int64), body.edge)


def convex_bodies(face: Face, depth: float = DEPTH) -> list[Body]:
    """Prisms that fill `depth` m behind a face; the first half of their vertices is on it, counter-clockwise."""
    normal = face_normal(face)
    axes = plane_axes(normal)[:2]
    level = float(np.mean(face.vertices @ normal))
    bodies = []
    for outline in convex_pieces(face.vertices @ axes.T, face.triangles):
        n = len(outline)
        front = outline @ axes + level * normal
        k = np.arange(1, n - 1)
        lid = np.stack([np.zeros_like(k), k, k + 1], axis=1)
        i, after = np.arange(n), (np.arange(n) + 1) % n
        sides = np.concatenate([np.stack([i, i + n, after], axis=1), np.stack([after, i + n, after + n], axis=1)])
        vertices = np.concatenate([front, front - depth * normal])
        bodies.append(Body(vertices, np.concatenate([lid, lid[:, ::-1] + n, sides]), front[1] - front[0]))
    return bodies


def convex_pieces(flat: Array, triangles: NDArray[np.int64]) -> list[Array]:
    """Convex polygons (n, 2), counter-clockwise: triangles of points (V, 2), neighbours joined greedily."""
    import shapely

    pieces = list(shapely.polygons(flat[triangles]))
    joined: list[shapely.Polygon] = []
    while pieces:
        piece, rest = pieces[0], pieces[1:]
        for k, other in enumerate(rest):
            both = piece.union(other)
            if both.geom_type == "Polygon" and both.area >= (1 - CONVEX) * both.convex_hull.area:
                rest[k] = both
                break
        else:
            joined.append(piece)
        pieces = rest
    hulls = [shapely.orient_polygons(piece.convex_hull) for piece in joined]
    return [np.asarray(hull.exterior.coords)[:-1] for hull in hulls if hull.geom_type == "Polygon"]
