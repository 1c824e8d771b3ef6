"""Visibility: rays against the flat faces of a model."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array
from recon.model import Face
from recon.open3d import load_open3d

SPREAD = 2e-4
"""m that faces move into the free space before them, so that of two back to back the one that faces a ray is first."""
MOST_BACKS = 16
"""Faces that a ray passes from behind."""


class RayScene:
    """Triangles of faces, asked by rays (Open3D's RaycastingScene, Embree)."""

    def __init__(self, faces: tuple[Face, ...]) -> None:
        self._o3d = load_open3d()
        self._faces = faces
        owner = np.repeat(np.arange(len(faces)), [len(face.triangles) for face in faces])
        self._owner = np.append(owner, -1)
        self._scene = self._triangles([face.vertices for face in faces])

    def cast(self, origins: Array, directions: Array) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
        """Distance in units of |direction| (inf: none) and index of the face hit (-1: none).

        origins: (3,) or (..., 3); directions: (..., 3). Both results have the shape (...).
        """
        t, triangle = self._cast(self._scene, origins, directions)
        return t, self._owner[triangle]

    def cast_front(self, origins: Array, directions: Array) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
        """As `cast`, but faces that are met from behind let rays pass: for a viewer they are not there."""
        t, triangle = self._cast(self._scene, origins, directions)
        starts = np.broadcast_to(origins, directions.shape)
        passed = np.zeros(t.shape)
        for _ in range(MOST_BACKS):
            behind = np.einsum("...i,...i->...", self._normals[triangle], directions) > 0
            if not behind.any():
                break
            rays, way = directions[behind], passed[behind]
            reach, triangle[behind] = self._cast(self._spread, starts[behind] + way[:, None] * rays, rays)
            t[behind] = way + reach
            passed[behind] = t[behind] + 0.5 * SPREAD / np.linalg.norm(rays, axis=1)
        return t, self._owner[triangle]

    @cached_property
    def _normals(self) -> Array:
        """Normal, of any length, of every triangle; zero for none (-1)."""
        corners = [face.vertices[face.triangles] for face in self._faces]
        return np.concatenate([*(np.cross(c[:, 1] - c[:, 0], c[:, 2] - c[:, 0]) for c in corners), np.zeros((1, 3))])

    @cached_property
    def _spread(self) -> Any:
        """The same scene with faces moved along their normals."""
        return self._triangles([face.vertices + SPREAD * face.normal for face in self._faces])

    def _triangles(self, vertices: list[Array]) -> Any:
        scene = self._o3d.t.geometry.RaycastingScene(nthreads=1)
        if vertices:
            offsets = np.cumsum([0] + [len(part) for part in vertices[:-1]])
            triangles = [face.triangles + offset for face, offset in zip(self._faces, offsets, strict=True)]
            scene.add_triangles(
                self._o3d.core.Tensor(np.concatenate(vertices).astype(np.float32)),
                self._o3d.core.Tensor(np.concatenate(triangles).astype(np.uint32)),
            )
        return scene

    def _cast(self, scene: Any, origins: Array, directions: Array) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
        """Distance and triangle (-1: none)."""
        d = np.asarray(directions, dtype=np.float32)
        rays = np.concatenate([np.broadcast_to(np.asarray(origins, np.float32), d.shape), d], axis=-1)
        hit = scene.cast_rays(self._o3d.core.Tensor(np.ascontiguousarray(rays)))
        t, triangle = hit["t_hit"].numpy(), hit["primitive_ids"].numpy().astype(np.int64)
        triangle[~np.isfinite(t)] = -1
        return t, triangle
