"""What lines openings: jambs, head, sill or threshold, and the leaf of a closed door or the glass of a window."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array
from recon.holes import DECIMALS, Hole
from recon.model import Face, FaceKind

THICKEST = 0.7
"""m: openings farther from one another are not two ends of one way through a wall ..."""
THINNEST = 0.02
"""... nor those that are nearer."""
BESIDE = 0.3
"""m along the wall between the middles of two such openings."""
FACING = -0.9
"""Product of the normals of their walls, at most."""
ASSUMED_DEPTH = 0.1
"""m that the sides of a hole go back where nothing says how thick the wall is."""
ASSUMED_LEAF = 0.05
"""m behind the wall's face where leaves and glass sit that nothing has measured."""
FLUSH = 1e-3
"""m: a leaf less deep has no sides."""
PLAIN = 4
"""Texels a side of a picture of one colour."""
QUAD = np.array([[0, 1, 2], [0, 2, 3]])


def reveals(holes: tuple[Hole, ...]) -> tuple[Face, ...]:
    """Faces, map frame, of every hole: its sides, and what closes it unless one looks through it (`is_hole`).

    The two ends of a way through a wall meet halfway, corner to corner. The sides of other holes go back half of the
    wall's thickness, or ASSUMED_DEPTH; leaves and glass sit `Opening.depth` behind the wall, or ASSUMED_LEAF, and no
    deeper than half of a wall whose other side has an opening there, too.
    """
    behind = _other_ends(holes)
    faces: list[Face] = []
    for hole, k in zip(holes, behind, strict=True):
        faces += _faces(hole, holes[k] if k >= 0 else None)
    return tuple(faces)


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


def _other_ends(holes: tuple[Hole, ...]) -> list[int]:
    """Index of the hole straight behind each, in a wall that faces away; -1 unless the two are each other's nearest."""
    from scipy.spatial import cKDTree

    if not holes:
        return []
    middles = np.array([hole.middle for hole in holes])
    near = cKDTree(middles).query_ball_point(middles, np.hypot(THICKEST, BESIDE))
    nearest = [
        min(((_depth_to(hole, holes[k]), k) for k in ks), default=(np.inf, -1))
        for hole, ks in zip(holes, near, strict=True)
    ]
    ends = [k if np.isfinite(depth) else -1 for depth, k in nearest]
    return [k if k >= 0 and ends[k] == i else -1 for i, k in enumerate(ends)]


def _depth_to(hole: Hole, other: Hole) -> float:
    """m straight back to another hole that may be the other end of this one, else inf."""
    offset = other.middle - hole.middle
    depth = float(-offset @ hole.wall.normal)
    facing = other.wall.normal @ hole.wall.normal < FACING and abs(offset @ hole.wall.direction) <= BESIDE
    alike = other.opening.is_hole == hole.opening.is_hole
    return depth if facing and alike and THINNEST < depth <= THICKEST else np.inf


def _faces(hole: Hole, behind: Hole | None) -> list[Face]:
    """A box without its front: front corners on the wall, back ones where this side of the wall ends."""
    front = [hole.ground(hole.left), hole.ground(hole.right)]
    low, high = (hole.bottom, hole.bottom), (hole.top, hole.top)
    if hole.opening.is_hole and behind is not None:
        beyond = [behind.ground(behind.right), behind.ground(behind.left)]
        back = [np.asarray(((a + b) / 2).round(DECIMALS)) for a, b in zip(front, beyond, strict=True)]
        low, high = (low[0], (low[0] + behind.bottom) / 2), (high[0], (high[0] + behind.top) / 2)
    else:
        depth = _depth(hole, behind)
        if depth < FLUSH and not hole.opening.is_hole:
            return [_closing(hole, front)]
        back = [np.asarray((point - depth * hole.wall.normal).round(DECIMALS)) for point in front]
    sides = _sides(hole, front, back, low, high)
    return sides if hole.opening.is_hole else [_closing(hole, back), *sides]


def _depth(hole: Hole, behind: Hole | None) -> float:
    thickness = hole.wall.thickness
    if hole.opening.is_hole:
        return ASSUMED_DEPTH if thickness is None else thickness / 2
    depth = ASSUMED_LEAF if hole.opening.depth is None else max(hole.opening.depth, 0.0)
    if behind is not None:
        depth = min(depth, 0.45 * float((hole.middle - behind.middle) @ hole.wall.normal))
    return depth


def _sides(
    hole: Hole, front: list[Array], back: list[Array], low: tuple[float, float], high: tuple[float, float]
) -> list[Face]:
    """Jambs, head and sill or threshold, turned to the inside of the opening; front, back: left and right point."""
    (left, right), (left_back, right_back) = front, back
    (b, b_back), (t, t_back) = low, high
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


def _closing(hole: Hole, points: list[Array]) -> Face:
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
