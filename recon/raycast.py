"""Visibility: rays against the flat faces of a model."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array
from recon.model import Face
from recon.open3d import load_open3d


class RayScene:
    """Triangles of faces, asked by rays (Open3D's RaycastingScene, Embree)."""

    def __init__(self, faces: tuple[Face, ...]) -> None:
        o3d = load_open3d()
        self._o3d = o3d
        self._scene = o3d.t.geometry.RaycastingScene(nthreads=1)
        vertices, triangles, owner, offset = [], [], [], 0
        for i, face in enumerate(faces):
            vertices.append(face.vertices)
            triangles.append(face.triangles + offset)
            owner.append(np.full(len(face.triangles), i))
            offset += len(face.vertices)
        self._owner = np.concatenate(owner) if owner else np.zeros(0, np.int64)
        if owner:
            self._scene.add_triangles(
                o3d.core.Tensor(np.concatenate(vertices).astype(np.float32)),
                o3d.core.Tensor(np.concatenate(triangles).astype(np.uint32)),
            )

    def cast(self, origins: Array, directions: Array) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
        """Distance in units of |direction| (inf: none) and index of the face hit (-1: none).

        origins: (3,) or (..., 3); directions: (..., 3). Both results have the shape (...).
        """
        d = np.asarray(directions, dtype=np.float32)
        rays = np.concatenate([np.broadcast_to(np.asarray(origins, np.float32), d.shape), d], axis=-1)
        hit = self._scene.cast_rays(self._o3d.core.Tensor(np.ascontiguousarray(rays)))
        t, prim = hit["t_hit"].numpy(), hit["primitive_ids"].numpy()
        face = np.full(t.shape, -1, np.int64)
        ok = np.isfinite(t)
        face[ok] = self._owner[prim[ok]]
        return t, face
