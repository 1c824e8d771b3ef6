"""What lines openings: jambs, head, sill or threshold, and the leaf of a closed door or the glass of a window."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array
from recon.holes import Hole
from recon.model import Face, FaceKind
from recon.niches import Niche, niches

FLUSH = 1e-3
"""m: a leaf less deep has no sides."""
PLAIN = 4
"""Texels a side of a picture of one colour."""
QUAD = np.array([[0, 1, 2], [0, 2, 3]])


def reveals(holes: tuple[Hole, ...]) -> tuple[Face, ...]:
    """Faces, map frame, of every hole: its sides, and what closes it unless one looks through it (`is_hole`)."""
    return tuple(face for niche in niches(holes) for face in _faces(niche))


def with_side_colours(faces: tuple[Face, ...]) -> tuple[Face, ...]:
    """The faces; jambs, heads and sills that no image shows have the usual colour of the others of the opening.

    The sides of an opening are painted alike, more often than not. Their pictures count as filled.
    """
    seen: dict[int | None, list[NDArray[np.uint8]]] = {}
    for face in faces:
        if face.kind == "reveal" and face.texture is not None:
            seen.setdefault(face.opening, []).append(face.texture.reshape(-1, 3))
    return tuple(
        _painted(face, np.median(np.concatenate(seen[face.opening]), axis=0))
        if face.kind == "reveal" and face.texture is None and face.opening in seen
        else face
        for face in faces
    )


def _painted(face: Face, colour: Array) -> Face:
    texture = np.tile(np.rint(colour).astype(np.uint8), (PLAIN, PLAIN, 1))
    size = float(np.linalg.norm(np.ptp(face.vertices, axis=0)))
    sources = np.full((PLAIN, PLAIN), -1, np.int32)
    return replace(face, texture=texture, metres_per_texel=size / PLAIN, seen_fraction=0.0, sources=sources)


def _faces(niche: Niche) -> list[Face]:
    """A box without its front: front corners on the wall, back ones where this side of the wall ends."""
    if niche.hole.opening.is_hole:
        return _sides(niche)
    if niche.depth < FLUSH:
        return [_closing(niche.hole, niche.front)]
    return [_closing(niche.hole, niche.back), *_sides(niche)]


def _sides(niche: Niche) -> list[Face]:
    """Jambs, head and sill or threshold, turned to the inside of the opening."""
    hole, (left, right), (left_back, right_back) = niche.hole, niche.front, niche.back
    (b, b_back), (t, t_back) = niche.low, niche.high
    name = f"reveal_{hole.opening.id:03d}"
    faces = [
        _quad(hole, f"{name}_left", "reveal", [(left, b), (left_back, b_back), (left_back, t_back), (left, t)]),
        _quad(hole, f"{name}_right", "reveal", [(right_back, b_back), (right, b), (right, t), (right_back, t_back)]),
        _quad(hole, f"{name}_head", "reveal", [(left_back, t_back), (right_back, t_back), (right, t), (left, t)]),
    ]
    ground = [(left, b), (right, b), (right_back, b_back), (left_back, b_back)]
    if b <= 0.0:
        return [*faces, _quad(hole, f"threshold_{hole.opening.id:03d}", "threshold", ground)]
    return [*faces, _quad(hole, f"{name}_sill", "reveal", ground)]


def _closing(hole: Hole, points: tuple[Array, Array]) -> Face:
    """The leaf or glass between the left and right point."""
    (left, right), low, high = points, hole.bottom, hole.top
    kind: FaceKind = "window" if hole.opening.type == "window" else "door"
    corners = [(left, low), (right, low), (right, high), (left, high)]
    return _quad(hole, f"{kind}_{hole.opening.id:03d}", kind, corners)


def _quad(hole: Hole, name: str, kind: FaceKind, corners: list[tuple[Array, float]]) -> Face:
    """From the lower left corner of its picture, counter-clockwise."""
    vertices = np.array([[x, y, z] for (x, y), z in corners])
    right = vertices[1] - vertices[0]
    right = right / np.linalg.norm(right)
    up = vertices[3] - vertices[0]
    up = up - (up @ right) * right
    flat = (vertices - vertices[0]) @ np.stack([right, up / np.linalg.norm(up)], axis=1)
    uv = (flat - flat.min(axis=0)) / np.ptp(flat, axis=0)
    return Face(name, kind, hole.wall.id, vertices, QUAD, uv, opening=hole.opening.id)
