"""Second texture coordinates, for light baked into a picture: every face in a place of its own on one square."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from recon.exporters.shape import face_normal
from recon.geometry import Array
from recon.model import Face
from recon.sampling import uv_from_points

GUTTER = 1 / 512
"""Of the square's side, free around every face: two texels of a light map of 1024."""
SEARCHES = 24


def light_map(faces: Sequence[Face]) -> list[Array]:
    """For every face its coordinates (V, 2) in [0, 1], v up: in metres to one scale, no two faces overlap.

    Flat faces need no unwrapping: the rectangle around each, lying on its longer side, is put on shelves, the highest
    first, at the largest scale that fits.
    """
    charts = [_chart(face) for face in faces]
    if not charts:
        return []
    sizes = np.array([chart.max(axis=0) for chart in charts])
    order = np.argsort(-sizes[:, 1], kind="stable")
    low, high = float(sizes.max()), 2 * float(np.sqrt(sizes.prod(axis=1).sum()) + sizes.max())
    for _ in range(SEARCHES):
        middle = (low + high) / 2
        low, high = (middle, high) if _places(sizes, order, middle) is None else (low, middle)
    while (places := _places(sizes, order, high)) is None:  # many faces: their gutters need room, too
        high *= 1.25
    free = 1 - 2 * GUTTER
    return [(place + chart) / high * free + GUTTER for place, chart in zip(places, charts, strict=True)]


def own_light_map(face: Face) -> Array:
    """Coordinates (V, 2) of a face that has the square for itself, a gutter left free, the sides in proportion."""
    chart = _chart(face)
    return np.asarray(GUTTER + chart / max(float(chart.max()), 1e-9) * (1 - 2 * GUTTER))


def _chart(face: Face) -> Array:
    """The vertices (V, 2) in the plane of the face, m, from (0, 0), lying on the longer side; not mirrored."""
    gradients = uv_from_points(face)[:3]
    right = gradients[:, 0] / max(float(np.linalg.norm(gradients[:, 0])), 1e-12)
    flat = face.vertices @ np.stack([right, np.cross(face_normal(face), right)], axis=1)
    flat = flat - flat.min(axis=0)
    width, height = flat.max(axis=0)
    return np.column_stack([flat[:, 1], width - flat[:, 0]]) if height > width else np.asarray(flat)


def _places(sizes: Array, order: NDArray[np.int64], side: float) -> Array | None:
    """Lower left corners (n, 2) on a square of `side` m, None where it is too small."""
    gap = 2 * GUTTER * side
    places = np.zeros(sizes.shape)
    x = y = shelf = 0.0
    for k in order:
        width, height = sizes[k]
        if x > 0 and x + width > side:
            x, y, shelf = 0.0, y + shelf + gap, 0.0
        if x + width > side or y + height > side:
            return None
        places[k] = x, y
        x, shelf = x + width + gap, max(shelf, float(height))
    return places
