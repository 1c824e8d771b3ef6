"""Convex bodies behind flat faces, for engines that want collision shapes as meshes of their own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from recon.exporters.bodies import Body, bodies_behind
from recon.exporters.shape import face_normal
from recon.geometry import Array
from recon.model import Face

SQUARE = 1e-5
"""m that corners of a box may be off."""


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


def collision_shapes(faces: Sequence[Face]) -> list[CollisionShape]:
    """Convex bodies that fill up to DEPTH m behind the faces; rectangles give boxes."""
    behind = zip(faces, bodies_behind(faces), strict=True)
    return [_shape(f"{face.name}_{k:02d}", face, body) for face, bodies in behind for k, body in enumerate(bodies)]


def _shape(name: str, face: Face, body: Body) -> CollisionShape:
    from scipy.spatial.transform import Rotation

    map_from_own = _own_axes(face_normal(face), body.edge)
    own = body.vertices @ map_from_own
    low, high = own.min(axis=0), own.max(axis=0)
    middle = (low + high) / 2
    square = len(own) == 8 and bool((np.minimum(own - low, high - own).max(axis=0) < SQUARE).all())
    angles = Rotation.from_matrix(map_from_own).as_euler("xyz")
    corners = (own - middle)[body.triangles]
    return CollisionShape(name, map_from_own @ middle, angles, high - low, corners, square)


def _own_axes(normal: Array, edge: Array) -> Array:
    """Axes of a shape as columns (3, 3): z up and y out of a wall, or z out of a floor and x along an edge."""
    if abs(normal[2]) < 0.7:
        x = np.cross(normal, [0.0, 0.0, 1.0])
        x /= np.linalg.norm(x)
        return np.stack([x, normal, np.cross(x, normal)], axis=1)
    x = edge / np.linalg.norm(edge)
    return np.stack([x, np.cross(normal, x), normal], axis=1)
