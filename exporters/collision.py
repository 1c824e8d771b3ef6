"""Convex bodies behind flat faces, for engines that want collision shapes as meshes of their own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.exporters.shape import face_normal
from recon.geometry import Array
from recon.model import Face

DEPTH = 0.05
"""m behind the face."""
THINNEST = 5e-4
"""m behind faces that touch back to back."""
FACING_AWAY = -0.99
SQUARE = 1e-5
"""m that corners of a box may be off."""
CONVEX = 1e-6
"""Share of its convex hull's area that a convex piece may lack."""


@dataclass(frozen=True)
class CollisionShape:
    """A convex body behind a face: a box, or else a mesh around its middle.

    middle: (3,) m, map frame. angles: roll, pitch and yaw, rad, about fixed axes. size: (3,) m along its own axes.
    corners: (T, 3, 3) m of its triangles, turned outwards, in its own axes.
    """

    name: str
    middle: Array
    angles: Array
    size: Array
    corners: Array
    is_box: bool


def collision_shapes(face: Face, depth: float = DEPTH) -> list[CollisionShape]:
    """Convex bodies that fill `depth` m behind a face; rectangles give boxes."""
    from scipy.spatial.transform import Rotation

    shapes = []
    for k, (vertices, triangles) in enumerate(convex_bodies(face, depth)):
        front = vertices[: len(vertices) // 2]
        map_from_own = _own_axes(face_normal(face), front[1] - front[0])
        own = vertices @ map_from_own
        low, high = own.min(axis=0), own.max(axis=0)
        middle = (low + high) / 2
        square = len(front) == 4 and bool((np.minimum(own - low, high - own).max(axis=0) < SQUARE).all())
        angles = Rotation.from_matrix(map_from_own).as_euler("xyz")
        name = f"{face.name}_{k:02d}"
        shapes.append(
            CollisionShape(name, map_from_own @ middle, angles, high - low, (own - middle)[triangles], square)
        )
    return shapes


def _own_axes(normal: Array, edge: Array) -> Array:
    """Axes of a shape as columns (3, 3): z up and y out of a wall, or z out of a floor and x along an edge."""
    if abs(normal[2]) < 0.7:
        x = np.cross(normal, [0.0, 0.0, 1.0])
        x /= np.linalg.norm(x)
        return np.stack([x, normal, np.cross(x, normal)], axis=1)
    x = edge / np.linalg.norm(edge)
    return np.stack([x, np.cross(normal, x), normal], axis=1)


def free_depths(faces: Sequence[Face]) -> list[float]:
    """DEPTH for every face, less where another looks away behind it: half of the way to that, at least THINNEST."""
    if not faces:
        return []
    normals = np.array([face_normal(face) for face in faces])
    low = np.array([face.vertices.min(axis=0) for face in faces]) - DEPTH
    high = np.array([face.vertices.max(axis=0) for face in faces]) + DEPTH
    depths = []
    for face, normal, bottom, top in zip(faces, normals, low, high, strict=True):
        near = (normals @ normal < FACING_AWAY) & (low < top).all(axis=1) & (high > bottom).all(axis=1)
        level = float(np.mean(face.vertices @ normal))
        behind = [level - float(np.mean(faces[k].vertices @ normal)) for k in np.flatnonzero(near).tolist()]
        between = [way for way in behind if way > -DEPTH / 10]
        depths.append(float(np.clip(min(between, default=2 * DEPTH) / 2, THINNEST, DEPTH)))
    return depths


def convex_bodies(face: Face, depth: float = DEPTH) -> list[tuple[Array, NDArray[np.int64]]]:
    """Vertices (V, 3) and triangles (T, 3), turned outwards, of closed convex bodies that fill `depth` m behind it.

    The first half of the vertices is on the face, counter-clockwise.
    """
    normal = face_normal(face)
    axes = _axes(normal)
    level = float(np.mean(face.vertices @ normal))
    bodies = []
    for outline in convex_pieces(face.vertices @ axes.T, face.triangles):
        n = len(outline)
        front = outline @ axes + level * normal
        k = np.arange(1, n - 1)
        lid = np.stack([np.zeros_like(k), k, k + 1], axis=1)
        i, after = np.arange(n), (np.arange(n) + 1) % n
        sides = np.concatenate([np.stack([i, i + n, after], axis=1), np.stack([after, i + n, after + n], axis=1)])
        bodies.append((np.concatenate([front, front - depth * normal]), np.concatenate([lid, lid[:, ::-1] + n, sides])))
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


def _axes(normal: Array) -> Array:
    """Two unit vectors (2, 3) in the plane, right-handed with its normal."""
    first = np.cross([0.0, 0.0, 1.0] if abs(normal[2]) < 0.7 else [1.0, 0.0, 0.0], normal)
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(normal, first)])
