"""Faces of a model as the mesh formats want them."""

from __future__ import annotations

from typing import Any

import numpy as np

from recon.geometry import Array
from recon.model import Face, FaceKind, Model, Wall

GROUPS: dict[FaceKind, str] = {"wall": "walls", "floor": "floors", "ceiling": "ceilings"}
"""Name of the group that holds the faces of a kind, in the order in which they are written."""


def grouped(model: Model) -> dict[str, list[Face]]:
    """Faces by group name, in the order of the model; groups without a face are left out."""
    groups = {name: [f for f in model.faces if f.kind == kind] for kind, name in GROUPS.items()}
    return {name: faces for name, faces in groups.items() if faces}


def face_normal(face: Face) -> Array:
    """Unit normal (3,) into the free space, from all triangles by area: one thin triangle does no harm."""
    a, b, c = np.moveaxis(face.vertices[face.triangles], 1, 0)
    n = np.cross(b - a, c - a).sum(axis=0)
    return np.asarray(n / max(float(np.linalg.norm(n)), 1e-300))


def y_up(points: Array) -> Array:
    """Map coordinates (..., 3), z up, with y up: x, z, -y. A turn about x, so right-handed still."""
    return np.stack([points[..., 0], points[..., 2], -points[..., 1]], axis=-1)


def face_facts(model: Model, face: Face) -> dict[str, Any]:
    """What is known of a face beyond its shape, for formats that carry such values; numbers are finite."""
    facts: dict[str, Any] = {"kind": face.kind, "id": int(face.ref)}
    if face.texture is not None:
        facts |= {"metres_per_texel": float(face.metres_per_texel), "seen_fraction": float(face.seen_fraction)}
    wall = next((w for w in model.layout.walls if w.id == face.ref), None) if face.kind == "wall" else None
    return facts | (_wall_facts(wall) if wall else {})


def _wall_facts(wall: Wall) -> dict[str, Any]:
    facts = {"sigma_offset": wall.sigma_offset, "sigma_angle": wall.sigma_angle}
    known = {k: float(v) for k, v in facts.items() if np.isfinite(v)}
    return known | {"source": wall.source, "observations": int(wall.observations)}
