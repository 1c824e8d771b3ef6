"""Places for texts: what is taken, and what is still free. Rectangles at any angle, in metres."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator

import numpy as np

from recon.geometry import Array

CELL = 2.0
"""m; size of the cells by which neighbours are found."""
_ALONG = 1e-9  # m

Bounds = tuple[float, float, float, float]


class Taken:
    """Rectangles and lines that texts keep clear of."""

    def __init__(self) -> None:
        self._cells: defaultdict[tuple[int, int], list[tuple[Bounds, bool, Array]]] = defaultdict(list)

    def add(self, box: Array) -> None:
        """A rectangle (4, 2), or a line (2, 2)."""
        bounds, along = _bounds(box)
        for cell in _cells(bounds):
            self._cells[cell].append((bounds, along, box))

    def free(self, box: Array) -> bool:
        """Whether a rectangle or line touches none of those added."""
        (x0, y0, x1, y1), along = bounds, _ = _bounds(box)
        for cell in _cells(bounds):
            for (a0, b0, a1, b1), also_along, other in self._cells.get(cell, ()):
                near = a0 <= x1 and x0 <= a1 and b0 <= y1 and y0 <= b1
                if near and ((along and also_along) or overlap(box, other)):
                    return False
        return True


def overlap(a: Array, b: Array) -> bool:
    """Whether two convex shapes (n, 2) touch, by the separating axis theorem (Gottschalk et al., SIGGRAPH 1996)."""
    for shape in (a, b):
        edges = np.roll(shape, -1, axis=0) - shape
        normals = np.column_stack([-edges[:, 1], edges[:, 0]])
        if len(shape) == 2:
            normals = np.concatenate([normals[:1], edges[:1]])
        on_a, on_b = a @ normals.T, b @ normals.T
        if np.any((on_a.max(axis=0) < on_b.min(axis=0)) | (on_b.max(axis=0) < on_a.min(axis=0))):
            return False
    return True


def grown(box: Array, margin: float) -> Array:
    """A rectangle (4, 2) with a margin all round."""
    along, up = box[1] - box[0], box[3] - box[0]
    u = margin * along / max(float(np.linalg.norm(along)), 1e-9)
    v = margin * up / max(float(np.linalg.norm(up)), 1e-9)
    return np.asarray(box + np.stack([-u - v, u - v, u + v, v - u]))


def _bounds(box: Array) -> tuple[Bounds, bool]:
    """Bounds, and whether the shape fills them: it is along the axes."""
    xs, ys = box.T.tolist()
    x0, y0, x1, y1 = min(xs), min(ys), max(xs), max(ys)
    if len(xs) == 2:
        return (x0, y0, x1, y1), x1 - x0 < _ALONG or y1 - y0 < _ALONG
    corners = (min(x - x0, x1 - x) < _ALONG and min(y - y0, y1 - y) < _ALONG for x, y in zip(xs, ys, strict=True))
    return (x0, y0, x1, y1), all(corners)


def _cells(bounds: Bounds) -> Iterator[tuple[int, int]]:
    x0, y0, x1, y1 = (math.floor(bound / CELL) for bound in bounds)
    for x in range(x0, x1 + 1):
        for y in range(y0, y1 + 1):
            yield x, y
