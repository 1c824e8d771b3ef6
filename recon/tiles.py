"""Faces cut into tiles, where their picture has more texels a side than a program takes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array
from recon.model import Face
from recon.sampling import uv_from_points

MOST_TEXELS = 4096
"""A side, of any picture: every engine, phone and browser takes that."""
OVERLAP = 16
"""Texels that a tile's picture reaches beyond it: filtered, also at a sixteenth of the size, no seam shows."""
THROUGH = 1e-3
"""m: a cut goes through corners this near instead of beside them, so that no splinters come off."""
TOLERANCE = 3e-6
"""m: corners this near to an edge are on it (as `recon.corners`)."""


def tiled(faces: tuple[Face, ...], most: int) -> tuple[Face, ...]:
    """The faces; those whose picture has more than `most` texels a side in tiles, `wall_003_tile_00` and so on.

    A tile's picture is a part of the whole, so nothing shows where tiles meet. The corners that cuts make, faces beside
    take on, so that what was watertight stays so; no face has an edge with a corner of another amid it. Raises
    ValueError where `most` leaves no room for OVERLAP.
    """
    if most < 8 * OVERLAP:
        raise ValueError(f"tiles of {most} texels, expected at least {8 * OVERLAP}")
    large = [k for k, face in enumerate(faces) if face.texture is not None and max(face.texture.shape[:2]) > most]
    if not large:
        return faces
    shapes = [_Mesh(face.vertices, face.uv, face.triangles) for face in faces]
    low = np.array([face.vertices.min(axis=0) for face in faces]) - TOLERANCE
    high = np.array([face.vertices.max(axis=0) for face in faces]) + TOLERANCE
    for k in large:
        old = len(shapes[k].vertices)
        shapes[k] = _cut(shapes[k], faces[k], most)
        for point in shapes[k].vertices[old:]:
            for n in np.flatnonzero(((low <= point) & (point <= high)).all(axis=1)):
                shapes[n] = shapes[n] if n == k else _with_corner(shapes[n], point)
    out: list[Face] = []
    for k, (face, shape) in enumerate(zip(faces, shapes, strict=True)):
        if k in large:
            out += _tiles(face, shape, most)
        else:
            out.append(face if len(shape.vertices) == len(face.vertices) else _reshaped(face, shape))
    return tuple(out)


@dataclass(frozen=True)
class _Mesh:
    """As the fields of `Face` of these names."""

    vertices: Array
    uv: Array
    triangles: NDArray[np.int64]


def _bounds(texels: int, most: int) -> list[int]:
    """Texels at which tiles along a side begin and end: multiples of OVERLAP, so that halves line up."""
    count = 1 if texels <= most else -(-texels // (most - 3 * OVERLAP))
    return [OVERLAP * round(texels * k / count / OVERLAP) for k in range(count)] + [texels]


def _sides(face: Face, most: int) -> tuple[list[int], list[int]]:
    """Bounds of tiles along the columns, from the left, and along the rows, from the bottom."""
    assert face.texture is not None
    height, width = face.texture.shape[:2]
    return _bounds(width, most), _bounds(height, most)


def _cut(shape: _Mesh, face: Face, most: int) -> _Mesh:
    """With corners and edges where tiles meet."""
    per_metre = np.linalg.norm(uv_from_points(face)[:3], axis=0)
    for axis, bounds in enumerate(_sides(face, most)):
        for bound in bounds[1:-1]:
            shape = _split(shape, axis, bound / bounds[-1], THROUGH * float(per_metre[axis]))
    return shape


def _split(shape: _Mesh, axis: int, value: float, near: float) -> _Mesh:
    """Triangles parted by the line where coordinate `axis` of uv is `value`; new corners come last.

    near: of uv; corners this near to the line are on it.
    """
    away = shape.uv[:, axis] - value
    side = np.where(np.abs(away) < near, 0, np.sign(away)).astype(np.int64)
    grown = _Growing(shape)
    triangles: list[tuple[int, int, int]] = []
    for triangle in shape.triangles.tolist():
        sides = side[triangle]
        if sides.min() >= 0 or sides.max() <= 0:
            triangles.append(tuple(triangle))
            continue
        # First the corner on the line, else the one that is alone on its side.
        first = int(np.flatnonzero(sides == (0 if 0 in sides else -sides.sum()))[0])
        a, b, c = triangle[first:] + triangle[:first]
        if side[a] == 0:
            p = grown.between(b, c, value, axis)
            triangles += [(a, b, p), (a, p, c)]
            continue
        p, q = grown.between(a, b, value, axis), grown.between(a, c, value, axis)
        triangles += [(a, p, q), (p, b, c), (p, c, q)]
    return grown.mesh(triangles)


class _Growing:
    """Corners of a mesh, and new ones on its edges; an edge that two triangles share gets one."""

    def __init__(self, shape: _Mesh) -> None:
        self.shape = shape
        self._new: dict[tuple[int, int], int] = {}
        self._vertices: list[Array] = []
        self._uv: list[Array] = []

    def between(self, a: int, b: int, value: float, axis: int) -> int:
        """The corner on the edge between corners a and b where coordinate `axis` of uv is `value`."""
        a, b = min(a, b), max(a, b)
        if (a, b) not in self._new:
            uv, vertices = self.shape.uv, self.shape.vertices
            t = (value - uv[a, axis]) / (uv[b, axis] - uv[a, axis])
            self._new[a, b] = len(vertices) + len(self._new)
            self._vertices.append(vertices[a] + t * (vertices[b] - vertices[a]))
            self._uv.append(uv[a] + t * (uv[b] - uv[a]))
        return self._new[a, b]

    def mesh(self, triangles: list[tuple[int, int, int]]) -> _Mesh:
        """All corners, with these triangles."""
        vertices, uv = [self.shape.vertices, *self._vertices], [self.shape.uv, *self._uv]
        return _Mesh(np.vstack(vertices), np.vstack(uv), np.array(triangles, np.int64).reshape(-1, 3))


def _with_corner(shape: _Mesh, point: Array) -> _Mesh:
    """With a corner at `point` (3,) where that lies amid an edge; the triangles there are parted in two."""
    start = shape.vertices[shape.triangles]
    way = np.roll(start, -1, axis=1) - start
    length = np.linalg.norm(way, axis=2)
    unit = way / np.maximum(length, 1e-12)[..., None]
    along = np.einsum("tei,tei->te", point - start, unit)
    across = np.linalg.norm(point - start - along[..., None] * unit, axis=2)
    found = np.argwhere((along > TOLERANCE) & (along < length - TOLERANCE) & (across < TOLERANCE))
    if len(found) == 0:
        return shape
    new, triangles = len(shape.vertices), shape.triangles.tolist()
    triangle, edge = found[0]
    a, b = triangles[triangle][edge], triangles[triangle][(edge + 1) % 3]
    share = along[triangle, edge] / length[triangle, edge]
    for n in np.unique(found[:, 0]):
        e = found[found[:, 0] == n][0, 1]
        i, j, k = (triangles[n][(e + step) % 3] for step in range(3))
        triangles[n] = [i, new, k]
        triangles.append([new, j, k])
    uv = shape.uv[a] + share * (shape.uv[b] - shape.uv[a])
    return _Mesh(np.vstack([shape.vertices, point]), np.vstack([shape.uv, uv]), np.array(triangles, np.int64))


def _reshaped(face: Face, shape: _Mesh) -> Face:
    """The face with this mesh, its largest triangle first: `Face.normal` is that triangle's."""
    a, b, c = np.moveaxis(shape.vertices[shape.triangles], 1, 0)
    largest = int(np.argmax(np.linalg.norm(np.cross(b - a, c - a), axis=1)))
    return replace(face, vertices=shape.vertices, uv=shape.uv, triangles=np.roll(shape.triangles, -largest, axis=0))


def _tiles(face: Face, shape: _Mesh, most: int) -> list[Face]:
    """The parts of a face that was cut, row by row from the top."""
    columns, rows = _sides(face, most)
    middle = shape.uv[shape.triangles].mean(axis=1)
    column, row = (
        np.searchsorted(np.array(bounds[1:-1]) / bounds[-1], middle[:, axis])
        for axis, bounds in enumerate((columns, rows))
    )
    out: list[Face] = []
    for r, (bottom, top) in reversed(list(enumerate(pairwise(rows)))):
        for c, (left, right) in enumerate(pairwise(columns)):
            triangles = shape.triangles[(column == c) & (row == r)]
            if len(triangles):
                name = f"{face.name}_tile_{len(out):02d}"
                part = _part(shape, triangles, face)
                out.append(_cropped(part, name, (left, right), (rows[-1] - top, rows[-1] - bottom)))
    return out


def _part(shape: _Mesh, triangles: NDArray[np.int64], face: Face) -> Face:
    used, index = np.unique(triangles, return_inverse=True)
    part = _Mesh(shape.vertices[used], shape.uv[used], index.reshape(-1, 3).astype(np.int64))
    return _reshaped(face, part)


def _cropped(part: Face, name: str, columns: tuple[int, int], rows: tuple[int, int]) -> Face:
    """With the picture's texels of these columns and rows (from the top) and OVERLAP beyond."""
    assert part.texture is not None
    height, width = part.texture.shape[:2]
    left, right = max(columns[0] - OVERLAP, 0), min(columns[1] + OVERLAP, width)
    top, bottom = max(rows[0] - OVERLAP, 0), min(rows[1] + OVERLAP, height)
    u = (part.uv[:, 0] * width - left) / (right - left)
    v = 1 - ((1 - part.uv[:, 1]) * height - top) / (bottom - top)
    texture = np.ascontiguousarray(part.texture[top:bottom, left:right])
    sources = None if part.sources is None else np.ascontiguousarray(part.sources[top:bottom, left:right])
    return replace(part, name=name, uv=np.column_stack([u, v]), texture=texture, sources=sources, tile_of=part.name)
