"""Convex bodies behind flat faces, for engines that want collision shapes as meshes of their own."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recon.exporters.shape import face_normal
from recon.geometry import Array
from recon.model import Face

DEPTH = 0.05
"""m behind the face."""
CONVEX = 1e-6
"""Share of its convex hull's area that a convex piece may lack."""


def convex_bodies(face: Face) -> list[tuple[Array, NDArray[np.int64]]]:
    """Vertices (V, 3) and triangles (T, 3), turned outwards, of closed convex bodies that fill DEPTH m behind it."""
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
        bodies.append((np.concatenate([front, front - DEPTH * normal]), np.concatenate([lid, lid[:, ::-1] + n, sides])))
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
