"""The layout of `two_rooms` with its openings cut out: a door, a way between the rooms, a window."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from two_rooms import picture, two_rooms

from recon.faces import extrude
from recon.geometry import Array
from recon.model import Face, Model


def open_house(textured: bool = True) -> Model:
    """Walls, floors and leaves have pictures, ceilings and sides of openings none."""
    model = two_rooms()
    faces = extrude(model.layout)
    return replace(model, faces=tuple(map(_textured, faces)) if textured else faces)


def _textured(face: Face) -> Face:
    if face.kind not in ("wall", "floor", "door", "window"):
        return face
    return replace(face, texture=picture(2.0, 1.0), metres_per_texel=0.02, seen_fraction=1.0)


def first_hit(triangles: Array, origin: Array, direction: Array) -> float:
    """Distance along a ray to the first of triangles (T, 3, 3), inf without one (Moeller and Trumbore 1997)."""
    a, b, c = np.moveaxis(triangles, 1, 0)
    across = np.cross(direction, c - a)
    scale = np.einsum("ij,ij->i", b - a, across)
    with np.errstate(divide="ignore", invalid="ignore"):
        u = np.einsum("ij,ij->i", origin - a, across) / scale
        along = np.cross(origin - a, b - a)
        v = along @ direction / scale
        t = np.einsum("ij,ij->i", c - a, along) / scale
        hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)
    return float(t[hit].min(initial=np.inf))
