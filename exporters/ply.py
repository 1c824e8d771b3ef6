"""PLY, binary: one mesh with a colour at every vertex, fine enough to recognise the texture; metres, Z up."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from recon.exporters.enclosure import fewest
from recon.exporters.options import DEFAULTS, ExportOptions
from recon.exporters.output import Output
from recon.exporters.shape import face_normal
from recon.geometry import Array
from recon.model import Face, Model
from recon.sampling import FaceColours

FINEST_STEP = 0.03
"""m between the vertices of a textured face, in a building of up to MOST_VERTICES; coarser in a larger one."""
MOST_VERTICES = 1_000_000
COARSEST_STEP = 10.0
"""m: a coarser grid cuts nothing."""
SLIVER = 1e-6
"""m: thinner pieces have no triangles."""

_VERTEX = np.dtype([("position", "<f4", 3), ("normal", "<f4", 3), ("colour", "u1", 3)])
_TRIANGLE = np.dtype([("count", "u1"), ("vertices", "<i4", 3)])


def write_ply(model: Model, stem: str, options: ExportOptions = DEFAULTS) -> Output:
    """All faces; those with a texture are cut by a square grid and coloured from it, the others stay as they are."""
    step = grid_step(model, options.max_triangles)
    vertices, triangles = _mesh(model, step)
    most = options.max_triangles
    while most is not None and len(triangles) > most and step < COARSEST_STEP:
        step *= 1.3
        vertices, triangles = _mesh(model, step)
    over = most is not None and len(triangles) > most
    notes = (fewest(len(triangles)),) if over else ()
    body = vertices.tobytes() + triangles.tobytes()
    return Output(_header(len(vertices), len(triangles)).encode("ascii") + body, notes=notes)


def _mesh(model: Model, step: float) -> tuple[NDArray[Any], NDArray[Any]]:
    """Records of vertices and triangles, cut by a grid of `step` m; from COARSEST_STEP on uncut."""
    vertices, triangles, first = [np.zeros(0, _VERTEX)], [np.zeros(0, _TRIANGLE)], 0
    for face in model.faces:
        plain = face.texture is None or step >= COARSEST_STEP
        points, corners = (face.vertices, face.triangles) if plain else cut_by_grid(face, step)
        vertex, triangle = np.zeros(len(points), _VERTEX), np.zeros(len(corners), _TRIANGLE)
        vertex["position"], vertex["normal"] = points, face_normal(face)
        vertex["colour"] = np.rint(FaceColours(face).at(points, step))
        triangle["count"], triangle["vertices"] = 3, corners + first
        vertices.append(vertex)
        triangles.append(triangle)
        first += len(points)
    return np.concatenate(vertices), np.concatenate(triangles)


def grid_step(model: Model, max_triangles: int | None = None) -> float:
    """Distance in m between the vertices of textured faces: FINEST_STEP, coarser above MOST_VERTICES.

    Also coarser where there would be about more than `max_triangles`, of which every grid cell has two.
    """
    most = MOST_VERTICES if max_triangles is None else min(MOST_VERTICES, max(max_triangles // 2, 1))
    area = 0.0
    for face in model.faces:
        if face.texture is not None:
            a, b, c = np.moveaxis(face.vertices[face.triangles], 1, 0)
            area += float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()) / 2
    return max(FINEST_STEP, float(np.sqrt(area / most)))


def cut_by_grid(face: Face, step: float) -> tuple[Array, NDArray[np.int64]]:
    """Vertices (V, 3) and triangles (T, 3) of `face`, cut along a square grid of `step` m in its plane."""
    import shapely

    normal = face_normal(face)
    axes = _plane_axes(normal)
    flat = face.vertices @ axes.T
    outline = shapely.unary_union(shapely.polygons(flat[face.triangles]))
    low, high = np.floor(flat.min(axis=0) / step), np.ceil(flat.max(axis=0) / step)
    x, y = (g.ravel() * step for g in np.meshgrid(*(np.arange(a, b) for a, b in zip(low, high, strict=True))))
    cells = shapely.box(x, y, x + step, y + step)
    shapely.prepare(outline)
    whole = shapely.contains(outline, cells)
    edge = ~whole & shapely.intersects(outline, cells)
    cut = shapely.set_precision(shapely.intersection(outline, cells[edge]), SLIVER)
    pieces = shapely.get_parts(shapely.constrained_delaunay_triangles(cut))
    corners = np.stack([x, y, x + step, y + step], axis=1)[whole]
    lower, upper = corners[:, [0, 1, 2, 1, 2, 3]], corners[:, [0, 1, 2, 3, 0, 3]]
    flat_triangles = np.concatenate([lower.reshape(-1, 3, 2), upper.reshape(-1, 3, 2), _corners(pieces)])
    points, triangles = _merged(flat_triangles)
    return points @ axes + float(np.mean(face.vertices @ normal)) * normal, triangles


def _merged(triangles: Array) -> tuple[Array, NDArray[np.int64]]:
    """Points (V, 2), each once, and indices (T, 3) of triangles (T, 3, 2) whose corners agree to a micrometre."""
    corners = triangles.reshape(-1, 2)
    micrometres = np.rint((corners - corners.min(axis=0)) * 1e6).astype(np.int64)
    _, first, index = np.unique((micrometres[:, 0] << 32) + micrometres[:, 1], return_index=True, return_inverse=True)
    return corners[first], index.reshape(-1, 3)


def _corners(triangles: NDArray[np.object_]) -> Array:
    """Corners (T, 3, 2), counter-clockwise, of shapely triangles; slivers without area are left out."""
    import shapely

    polygons = triangles[shapely.get_type_id(triangles) == shapely.GeometryType.POLYGON]
    if len(polygons) == 0:
        return np.zeros((0, 3, 2))
    corners = shapely.get_coordinates(polygons).reshape(-1, 4, 2)[:, :3]
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    corners[area < 0] = corners[area < 0][:, ::-1]
    return np.asarray(corners[np.abs(area) > 1e-9])


def _plane_axes(normal: Array) -> Array:
    """Two unit vectors (2, 3) that span the plane, right-handed with `normal`; the second is up where it can be."""
    first = np.array([1.0, 0.0, 0.0]) if abs(normal[2]) > 0.7 else np.cross([0.0, 0.0, 1.0], normal)
    first = first - (first @ normal) * normal
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(normal, first)])


def _header(vertices: int, triangles: int) -> str:
    lines = ["ply", "format binary_little_endian 1.0", "comment recon, metres, Z up", f"element vertex {vertices}"]
    lines += [f"property float {name}" for name in ("x", "y", "z", "nx", "ny", "nz")]
    lines += [f"property uchar {name}" for name in ("red", "green", "blue")]
    lines += [f"element face {triangles}", "property list uchar int vertex_indices", "end_header"]
    return "\n".join(lines) + "\n"
