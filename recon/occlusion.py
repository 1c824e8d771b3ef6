"""Ambient occlusion: how much of the light from all around reaches a point near corners and edges."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array
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
    scene = RayScene(occluders)
    grids = [_Grid(face) for face in faces]
    step = max(0.08, float(np.sqrt(sum(g.area for g in grids) / MOST_POINTS)))
    return [grid.shade(scene, step) for grid in grids]


class _Grid:
    """Points of a face on a square grid in its plane."""

    def __init__(self, face: Face) -> None:
        self._normal = face.normal
        helper = np.array([0.0, 0.0, 1.0]) if abs(self._normal[2]) < 0.7 else np.array([1.0, 0.0, 0.0])
        first = np.cross(helper, self._normal)
        first /= np.linalg.norm(first)
        self._axes = np.stack([first, np.cross(self._normal, first)])
        flat = face.vertices @ self._axes.T
        self._low, self._extent = flat.min(axis=0), np.ptp(flat, axis=0)
        self._height = float(face.vertices[0] @ self._normal)
        self.area = float(np.prod(self._extent))

    def shade(self, scene: RayScene, step: float) -> Shade:
        counts = np.maximum(np.ceil(self._extent / step).astype(int), 1) + 1
        spacing = np.maximum(self._extent, 1e-6) / (counts - 1)
        x, y = np.meshgrid(*(np.arange(n) * s for n, s in zip(counts, spacing, strict=True)))
        inset = np.clip(np.stack([x, y], axis=-1), 0.01, np.maximum(self._extent - 0.01, 0.01))  # off the neighbours
        points = (inset + self._low) @ self._axes + (self._height + 5e-3) * self._normal
        light = self._light(scene, points).astype(np.float32)[..., None]
        low, axes = self._low, self._axes

        def at(spots: Array) -> Array:
            place = (spots @ axes.T - low) / spacing
            return np.asarray(bilinear(light, place[:, 0], place[:, 1])[:, 0], dtype=np.float64)

        return at

    def _light(self, scene: RayScene, points: Array) -> Array:
        """Share of light (...) that reaches points (..., 3): hits count less the further they are."""
        local = _cosine_directions(_RAYS)
        directions = local[:, :2] @ self._axes + local[:, 2:] * self._normal
        total = np.zeros(points.shape[:-1])
        for direction in directions:  # the same ones everywhere: smooth, no grain
            distance, _ = scene.cast(points, np.broadcast_to(direction, points.shape))
            total += np.clip(1 - distance / REACH, 0, 1) ** 2
        return 1 - STRENGTH * total / len(directions)


def _cosine_directions(count: int) -> NDArray[np.float64]:
    """Unit vectors (count, 3) about z, as dense as the cosine of their angle to it (sunflower disc, projected up)."""
    index = np.arange(count) + 0.5
    radius, angle = np.sqrt(index / count), index * np.pi * (3 - np.sqrt(5))
    x, y = radius * np.cos(angle), radius * np.sin(angle)
    return np.stack([x, y, np.sqrt(np.maximum(1 - x * x - y * y, 0))], axis=1)
