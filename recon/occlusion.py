"""Ambient occlusion: how much of the light from all around reaches a point near corners and edges."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array, plane_axes
from recon.model import Face
from recon.raycast import RayScene
from recon.sampling import bilinear

Shade = Callable[[Array], Array]

REACH = 1.3
"""m: what is further away takes no light."""
STRENGTH = 0.7
MOST_POINTS = 60_000
_RAYS = 48


def ambient_shades(faces: tuple[Face, ...], occluders: tuple[Face, ...]) -> list[Shade]:
    """For each face a function from points (N, 3) on it to factors (N,) in (0, 1]: 1 in the open, less in corners."""
    if not faces:
        return []
    area = sum(float(np.prod(np.ptp(_flat(face), axis=0))) for face in faces)
    step = max(0.08, float(np.sqrt(area / MOST_POINTS)))
    grids = [_Grid(face, step) for face in faces]
    counts = [len(grid.points) for grid in grids]
    frames = np.repeat(np.stack([_frame(face) for face in faces]), counts, axis=0)
    light = _light(RayScene(occluders), np.concatenate([g.points for g in grids]), frames)
    return [g.shade(part) for g, part in zip(grids, np.split(light, np.cumsum(counts)[:-1]), strict=True)]


def _light(scene: RayScene, points: Array, frames: Array) -> Array:
    """Share of light (N,) that reaches points (N, 3) with frames (N, 3, 3): hits count less the further they are."""
    total = np.zeros(len(points))
    for direction in _cosine_directions(_RAYS):  # the same ones everywhere: smooth, no grain
        distance, _ = scene.cast(points, direction @ frames)
        total += np.clip(1 - distance / REACH, 0, 1) ** 2
    return 1 - STRENGTH * total / _RAYS


def _frame(face: Face) -> Array:
    """Two unit vectors in the plane of the face and its normal, as rows (3, 3)."""
    return plane_axes(face.normal)


def _flat(face: Face) -> Array:
    """The vertices (V, 2) in the plane of the face, m."""
    return np.asarray(face.vertices @ _frame(face)[:2].T)


class _Grid:
    """Points of a face on a grid of about `step` m in its plane."""

    def __init__(self, face: Face, step: float) -> None:
        flat, frame = _flat(face), _frame(face)
        self._axes, self._low, extent = frame[:2], flat.min(axis=0), np.ptp(flat, axis=0)
        counts = np.maximum(np.ceil(extent / step).astype(int), 1) + 1
        self._shape = (int(counts[1]), int(counts[0]))
        self._spacing = np.maximum(extent, 1e-6) / (counts - 1)
        x, y = np.meshgrid(*(np.arange(n) * s for n, s in zip(counts, self._spacing, strict=True)))
        off_the_edge = np.clip(np.column_stack([x.ravel(), y.ravel()]), 0.01, np.maximum(extent - 0.01, 0.01))
        height = float(face.vertices[0] @ frame[2]) + 5e-3
        self.points = (off_the_edge + self._low) @ self._axes + height * frame[2]

    def shade(self, light: Array) -> Shade:
        """Looks up `light` (N,), that of `points`, anywhere on the face."""
        picture = light.reshape(*self._shape, 1).astype(np.float32)

        def at(spots: Array) -> Array:
            place = (spots @ self._axes.T - self._low) / self._spacing
            return np.asarray(bilinear(picture, place[:, 0], place[:, 1])[:, 0], dtype=np.float64)

        return at


def _cosine_directions(count: int) -> NDArray[np.float64]:
    """Unit vectors (count, 3) about z, as dense as the cosine of their angle to it (sunflower disc, projected up)."""
    index = np.arange(count) + 0.5
    radius, angle = np.sqrt(index / count), index * np.pi * (3 - np.sqrt(5))
    x, y = radius * np.cos(angle), radius * np.sin(angle)
    return np.stack([x, y, np.sqrt(np.maximum(1 - x * x - y * y, 0))], axis=1)
