"""What one image can show of a face: where, how sharply."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array, Pose3
from recon.sequence.camera import Camera

NEAR = 0.05
"""m: nothing closer to the camera plane is used."""
MIN_SINE = 0.04
"""Sine of the angle between ray and surface: below it a view is too grazing to be of use."""
LEVELS = 5
"""Of the image pyramid: the image, then half the size each."""

Image = NDArray[np.uint8]


@dataclass(frozen=True)
class Lens:
    """A camera and what it can see: (x, y) / z between low (2,) and high (2,), and not longer than `radius`.

    Beyond, a polynomial distortion may fold points back into the image: they are never projected.
    """

    camera: Camera
    radius: float
    low: Array
    high: Array

    @staticmethod
    def of(camera: Camera) -> Lens:
        """Looks along the border of the image."""
        w, h = camera.width - 1, camera.height - 1
        t = np.linspace(0, 1, 65)[:, None]
        corners = np.array([[0, 0], [w, 0], [w, h], [0, h], [0, 0]], dtype=np.float64)
        border = camera.undistort(np.concatenate([a + t * (b - a) for a, b in pairwise(corners)]))
        low, high = border.min(axis=0), border.max(axis=0)
        radius = float(np.linalg.norm(border, axis=1).max())
        return Lens(camera, 1.02 * radius, low - 0.02 * (high - low), high + 0.02 * (high - low))

    def radius_of(self, pixels: Array) -> Array:
        """Distance (...) of pixels (..., 2) from the middle of the image, 1 at its corners."""
        middle = np.array([self.camera.width - 1, self.camera.height - 1]) / 2
        return np.asarray(np.linalg.norm(pixels - middle, axis=-1) / np.linalg.norm(middle))

    def may_see(self, map_from_camera: Pose3, corners: Array) -> bool:
        """Whether the convex hull of points (N, 3), map frame, may reach into the image's cone: no is sure."""
        x, y, z = map_from_camera.inverse().apply(corners).T
        outside = (z <= NEAR, x <= self.low[0] * z, x >= self.high[0] * z, y <= self.low[1] * z, y >= self.high[1] * z)
        return not any(side.all() for side in outside)

    def project(self, points: Array) -> Array:
        """Points (N, 3), camera frame, as pixels (N, 2) of the raw image; nan outside the cone that it covers."""
        from recon.texture.kernels import in_cone

        use = in_cone(points, self.low, self.high, self.radius, NEAR, np.inf)
        pixels = np.full((len(points), 2), np.nan)
        pixels[use] = self.camera.project(points[use])
        return pixels


@dataclass(frozen=True)
class Sight:
    """Points of a face that an image may show. index: (n,) which points; pixels: (n, 2), raw image.

    fine, coarse: (n,) pixels per metre on the surface, along the best and the worst resolved direction there.
    """

    index: NDArray[np.int64]
    pixels: Array
    fine: Array
    coarse: Array


def look(lens: Lens, map_from_camera: Pose3, points: Array, axes: Array, spacing: float) -> Sight:
    """Which of points (N, 3) of a plane, map frame, lie in the image; how well it resolves patches of `spacing` m.

    axes: (2, 3) unit vectors along the face. Occlusion is not looked at.
    """
    from recon.texture.kernels import in_cone, resolution

    camera_from_map = map_from_camera.inverse()
    local = camera_from_map.apply(points)
    turned = axes @ camera_from_map.rotation.T
    towards = float(local[0] @ np.cross(turned[0], turned[1])) if len(points) else 0.0  # right x down: into the face
    index = in_cone(local, lens.low, lens.high, lens.radius, NEAR, towards / MIN_SINE)
    pixels = lens.camera.project(local[index])
    inside = _within(pixels, lens.camera, 1.0)
    index, pixels = index[inside], pixels[inside]
    step = 0.25 * spacing
    moved = lens.project((local[index] + step * turned[:, None]).reshape(-1, 3)).reshape(2, -1, 2)
    fine, coarse = resolution(pixels, moved, step)
    ok = coarse > 0
    return Sight(index[ok], pixels[ok], fine[ok], coarse[ok])


def _within(pixels: Array, camera: Camera, margin: float) -> NDArray[np.bool_]:
    x, y = pixels[:, 0], pixels[:, 1]
    with np.errstate(invalid="ignore"):
        inside_x = (x >= margin) & (x <= camera.width - 1 - margin)
        return np.asarray(inside_x & (y >= margin) & (y <= camera.height - 1 - margin))


def pyramid(image: Image, levels: int = LEVELS) -> list[Image]:
    """The image and averages of it, each half the size of the one before (never under 16 pixels a side)."""
    out = [image]
    while len(out) < levels and min(out[-1].shape[:2]) >= 32:
        height, width = out[-1].shape[:2]
        out.append(np.asarray(cv2.resize(out[-1], (width // 2, height // 2), interpolation=cv2.INTER_AREA)))
    return out


def level_of(footprint: Array | float, levels: int) -> NDArray[np.int64]:
    """The pyramid level whose pixels best match a footprint given in pixels of the image."""
    octave = np.round(np.log2(np.maximum(footprint, 1e-6)))
    return np.clip(octave, 0, levels - 1).astype(np.int64)


def at_level(pixels: NDArray[np.float32], image: Image, level: Image) -> NDArray[np.float32]:
    """Pixel coordinates (..., 2) of the image in its pyramid level."""
    if level.shape == image.shape:
        return pixels
    scale = np.array([level.shape[1] / image.shape[1], level.shape[0] / image.shape[0]], np.float32)
    return np.asarray((pixels + np.float32(0.5)) * scale - np.float32(0.5))


def sample(levels: list[Image], pixels: Array, footprint: Array) -> Image:
    """Colours (n, 3) at pixels (n, 2) of the image, each averaged over about its footprint (n,), pixels."""
    out = np.zeros((len(pixels), 3), np.uint8)
    wanted = level_of(footprint, len(levels))
    for k, level in enumerate(levels):
        chosen = np.flatnonzero(wanted == k)
        if len(chosen):
            xy = at_level(pixels[chosen].astype(np.float32), levels[0], level)
            out[chosen] = _remap(level, xy)
    return out


def _remap(image: Image, xy: NDArray[np.float32]) -> Image:
    """cv2.remap of a list of points: folded into rows, since its sides are limited to 32767."""
    columns = 512
    rows = -(-len(xy) // columns)
    padded = np.zeros((rows * columns, 2), np.float32)
    padded[: len(xy)] = xy
    found = cv2.remap(image, padded.reshape(rows, columns, 2), None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(found.reshape(-1, 3)[: len(xy)])
