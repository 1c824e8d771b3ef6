"""Pictures of a model: what a camera in it sees.

Rays against the faces (Open3D's RaycastingScene) and a texture look-up at every hit: no GPU, no window.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array, Pose3
from recon.model import Face, Model
from recon.raycast import RayScene
from recon.sampling import FaceColours
from recon.sequence.camera import Camera

Image = NDArray[np.uint8]
Colour = tuple[int, int, int]
Rays = Callable[[Array], tuple[Array, Array]]
"""Pixels (N, 2) to origins and unit directions (N, 3) of their rays in the map frame."""

EDGE_SAMPLES = 3
"""Rays along each side of a pixel on an edge; inside faces one is enough, textures are averaged there."""


def render_model(
    model: Model, camera: Camera, map_from_camera: Pose3, background: Colour = (255, 255, 255)
) -> NDArray[np.uint8]:
    """What `camera` (with its distortion) sees of the model: (height, width, 3) uint8 RGB, not shaded.

    Walls seen from behind are shown too. `background` is where there is no face.
    """
    scene = TexturedScene(model.faces, pixel_angle=1 / float(camera.matrix[0, 0]))
    return np.clip(np.rint(render_scene(scene, camera, map_from_camera, background)), 0, 255).astype(np.uint8)


def render_scene(
    scene: TexturedScene, camera: Camera, map_from_camera: Pose3, background: tuple[float, float, float]
) -> NDArray[np.float32]:
    """As `render_model`, (height, width, 3) RGB, of a scene that serves many views of one camera."""

    def rays(pixels: Array) -> tuple[Array, Array]:
        directions = np.column_stack([camera.undistort(pixels), np.ones(len(pixels))])
        directions = directions / np.linalg.norm(directions, axis=1, keepdims=True) @ map_from_camera.rotation.T
        return np.broadcast_to(map_from_camera.translation, directions.shape), directions

    canvas = np.empty((camera.height, camera.width, 3), np.float32)
    canvas[:] = background
    return scene.render(rays, canvas)


@dataclass(frozen=True)
class Hits:
    """Where N rays meet faces.

    face: (N,) index, -1 for none. point: (N, 3), m. spacing: (N,), m on the face between
    neighbouring pixels."""

    face: NDArray[np.int64]
    point: Array
    spacing: Array


class TexturedScene:
    """Faces that can be drawn.

    pixel_angle: rad between the rays of neighbouring pixels; or pixel_size: m between them where rays are parallel.
    shades: for each face a factor on its colours at points, or None for no shading. edge_samples: as EDGE_SAMPLES; 1
    for jagged edges, soon drawn.
    """

    def __init__(
        self,
        faces: tuple[Face, ...],
        pixel_angle: float = 0.0,
        pixel_size: float = 0.0,
        shades: list[Callable[[Array], Array]] | None = None,
        edge_samples: int = EDGE_SAMPLES,
    ) -> None:
        self._faces, self._shades = faces, shades
        self._angle, self._size, self._samples = pixel_angle, pixel_size, edge_samples
        self._colours = [FaceColours(face) for face in faces]
        self._normals = np.array([face.normal for face in faces]).reshape(-1, 3)
        self._scene = RayScene(faces)

    def render(self, rays: Rays, canvas: NDArray[np.float32]) -> NDArray[np.float32]:
        """The scene over `canvas` (H, W, 3), with smooth edges. Pixel centres are at integer coordinates."""
        height, width = canvas.shape[:2]
        grid = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1).reshape(-1, 2).astype(np.float64)
        flat = canvas.reshape(-1, 3)
        hits = self.cast(rays, grid)
        out = self.colours(hits, flat)
        if self._samples == 1:
            return out.reshape(canvas.shape)
        edges = _edges(hits.face.reshape(height, width)).ravel()
        steps = (np.arange(self._samples) + 0.5) / self._samples - 0.5
        total = np.zeros((int(edges.sum()), 3), np.float32)
        for dx in steps:
            for dy in steps:
                total += self.colours(self.cast(rays, grid[edges] + [dx, dy]), flat[edges])
        out[edges] = total / self._samples**2
        return out.reshape(canvas.shape)

    def cast(self, rays: Rays, pixels: Array) -> Hits:
        """What the rays of pixels (N, 2) meet first."""
        if not self._faces:
            return Hits(np.full(len(pixels), -1), np.zeros((len(pixels), 3)), np.zeros(len(pixels)))
        origins, directions = rays(pixels)
        distance, face = self._scene.cast(origins, directions)
        reach = np.where(face >= 0, distance, 0.0).astype(np.float64)
        cosine = np.abs(np.einsum("ij,ij->i", directions, self._normals[face]))
        # Between the two spacings of a surface seen at an angle, across and along the view.
        spacing = (self._size + self._angle * reach) / np.sqrt(np.maximum(cosine, 0.02))
        return Hits(face, origins + reach[:, None] * directions, spacing)

    def colours(self, hits: Hits, background: NDArray[np.float32]) -> NDArray[np.float32]:
        """Colours (N, 3) at hits, `background` (N, 3) where there is none."""
        out = background.copy()
        order = np.argsort(hits.face, kind="stable")
        bounds = np.searchsorted(hits.face[order], np.arange(len(self._faces) + 1))
        for index in np.flatnonzero(np.diff(bounds)):
            mine = order[bounds[index] : bounds[index + 1]]
            points = hits.point[mine]
            colours = self._colours[index].at(points, hits.spacing[mine])
            if self._shades is not None:
                colours *= self._shades[index](points)[:, None].astype(np.float32)
            out[mine] = colours
        return out


def _edges(owner: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Pixels (H, W) with a neighbour, along rows or columns, that shows another face."""
    edge = np.zeros(owner.shape, np.bool_)
    for axis in (0, 1):
        differs = np.diff(owner, axis=axis) != 0
        first, second = [slice(None)] * 2, [slice(None)] * 2
        first[axis], second[axis] = slice(0, -1), slice(1, None)
        edge[tuple(first)] |= differs
        edge[tuple(second)] |= differs
    return edge
