"""Images and labels: rays through the pixels of the (distorted) camera, textures filtered over each pixel."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array, Pose3
from recon.model import Face
from recon.raycast import RayScene
from recon.sequence.camera import Camera
from recon.simulate.atlas import DECODE, Atlas, paint_building
from recon.simulate.building import Building
from recon.simulate.style import room_styles

GLOSS_BLUR = 2.0
"""Mip levels by which reflections in the floor are blurred."""
SUBPIXELS = 0.25 * np.array([[-1, -1], [1, -1], [-1, 1], [1, 1]])


@dataclass(frozen=True)
class Exposure:
    """How a picture is taken: gain, its faults' size and their seed."""

    gain: float
    noise: float
    seed: tuple[int, ...]


class Renderer:
    """Pictures of one building by one camera."""

    def __init__(self, building: Building, camera: Camera, seed: int) -> None:
        self.camera = camera
        self._gloss = building.plan.look.gloss
        surfaces = building.surfaces
        nothing = np.zeros((0, 2))
        faces = tuple(Face(str(i), "wall", i, s.points(), s.triangles, nothing) for i, s in enumerate(surfaces))
        self._scene = RayScene(faces)
        self._planes = np.array([np.concatenate([s.origin, s.axis_u, s.axis_v, s.normal]) for s in surfaces])
        self._labels = np.array([*(s.label for s in surfaces), 0], np.uint16)
        plan = building.plan
        styles = room_styles(plan.look, [len(room.polygon) for room in plan.rooms], seed)
        hard = [s.kind == "floor" and styles[s.room].floor != "carpet" for s in surfaces]
        self._glossy = np.array([*hard, False])
        ppm = float(np.clip(camera.matrix[0, 0] / 2.5, 50.0, 200.0))
        self._atlas: Atlas = paint_building(building, ppm, seed)
        rays = camera.rays()
        self._rays = rays
        self._step_x, self._step_y = np.gradient(rays, axis=1), np.gradient(rays, axis=0)

    def render(self, world_from_camera: Pose3, exposure: Exposure) -> tuple[NDArray[np.uint8], NDArray[np.uint16]]:
        """The picture (H, W, 3) uint8 BGR and the labels (H, W) at the pixels' centres."""
        rotation, origin = world_from_camera.rotation, world_from_camera.translation
        rays, step_x, step_y = (a @ rotation.T for a in (self._rays, self._step_x, self._step_y))
        hit = self._cast(origin, rays)
        image = self._shade(origin, rays, step_x, step_y, hit)
        edge = _edges(hit)
        total = np.zeros((int(edge.sum()), 3))
        for a, b in SUBPIXELS:
            moved = rays[edge] + a * step_x[edge] + b * step_y[edge]
            total += self._shade(origin, moved, step_x[edge] / 2, step_y[edge] / 2, self._cast(origin, moved))
        image[edge] = total / len(SUBPIXELS)
        return _develop(image, exposure), self._labels[hit]

    def _cast(self, origins: Array, rays: Array) -> NDArray[np.int64]:
        """Surface hit by each ray; a ray that slips between two surfaces is moved by a hair."""
        _, hit = self._scene.cast(origins, rays)
        missed = hit < 0
        if missed.any():
            some = origins if origins.ndim == 1 else origins[missed]
            hit[missed] = self._scene.cast(some, rays[missed] + [1e-4, 1.3e-4, 1e-4])[1]
        return hit

    def _shade(self, origin: Array, rays: Array, step_x: Array, step_y: Array, hit: NDArray[np.int64]) -> Array:
        """Radiance (..., 3), with a blurred reflection in the floor (Schlick's Fresnel term)."""
        colour = self._look_up(origin, rays, step_x, step_y, hit, 0.0)
        glossy = self._glossy[hit]
        if self._gloss > 0.0 and glossy.any():
            mirror = np.array([1.0, 1.0, -1.0])
            down = rays[glossy]
            touch = origin + down * (-origin[2] / down[:, 2])[:, None] + [0.0, 0.0, 1e-4]
            seen = self._cast(touch, down * mirror)
            steps = step_x[glossy] * mirror, step_y[glossy] * mirror
            reflection = self._look_up(origin * mirror, down * mirror, *steps, seen, GLOSS_BLUR)
            cosine = -down[:, 2] / np.linalg.norm(down, axis=1)
            share = self._gloss * (0.08 + 0.92 * (1.0 - cosine) ** 5)
            colour[glossy] += share[:, None] * (reflection - colour[glossy])
        return colour

    def _look_up(
        self, origin: Array, rays: Array, step_x: Array, step_y: Array, hit: NDArray[np.int64], blur: float
    ) -> Array:
        from recon.simulate.kernels import shade

        a = self._atlas
        flat = (np.ascontiguousarray(x.reshape(-1, 3)) for x in (rays, step_x, step_y))
        tables = (self._planes, a.scales, a.offsets, a.sizes, a.levels, a.texels, DECODE)
        return np.asarray(shade(origin, *flat, hit.ravel(), blur, *tables)).reshape(rays.shape)


def _edges(hit: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Pixels whose right, left, upper or lower neighbour shows another surface."""
    edge = np.zeros(hit.shape, bool)
    across, down = hit[:, 1:] != hit[:, :-1], hit[1:] != hit[:-1]
    edge[:, 1:] |= across
    edge[:, :-1] |= across
    edge[1:] |= down
    edge[:-1] |= down
    return edge


def _develop(radiance: Array, exposure: Exposure) -> NDArray[np.uint8]:
    """Lens and sensor: vignetting, slight blur, a film curve, noise that grows with the light; BGR."""
    height, width = radiance.shape[:2]
    y, x = np.mgrid[0:height, 0:width].astype(np.float32)
    away = ((x - width / 2) ** 2 + (y - height / 2) ** 2) / (width**2 + height**2) * 4
    light = (radiance * (exposure.gain * (1.0 - 0.18 * away))[..., None]).astype(np.float32)
    light = np.asarray(cv2.GaussianBlur(light, (0, 0), 0.55), np.float32)
    grey = (1.0 - np.exp(-1.3 * light)) ** np.float32(1 / 2.2) * 255
    rng = np.random.default_rng(exposure.seed)
    sigma = exposure.noise * np.sqrt(0.5 + grey / 255)
    grey += sigma * rng.standard_normal(grey.shape, dtype=np.float32)
    return np.clip(np.round(grey), 0, 255).astype(np.uint8)[..., ::-1]
