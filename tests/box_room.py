"""A box room with a known solid texture, photographed by plain ray-plane intersection: independent of the library."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array, Pose3
from recon.model import Face, Layout, Room, Wall
from recon.sequence.camera import Camera

SIZE = np.array([5.0, 3.6, 2.4])
"""m: x, y and height; a corner is the origin."""
OPTICAL = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""Platform from camera axes: z forward is x, x right is -y, y down is -z."""


def box_layout() -> Layout:
    """Four walls, one room."""
    x, y, z = SIZE
    polygon = np.array([[0, 0], [x, 0], [x, y], [0, y]], dtype=np.float64)
    ends = np.roll(polygon, -1, axis=0)
    walls = tuple(Wall(i, a, b, 0.01, 0.001, "lidar", 9) for i, (a, b) in enumerate(zip(polygon, ends, strict=True)))
    return Layout(walls, (Room(0, "box", polygon),), ceiling_height=float(z))


def solid(points: Array) -> Array:
    """BGR (..., 3), 0 to 255, at points (..., 3): waves of 10 cm and more, in no direction symmetric."""
    waves = np.array([[9.1, 3.3, 5.7], [-4.2, 11.3, 7.9], [15.1, -8.8, 17.3], [-37.7, -41.9, 35.0], [2.1, 1.3, -2.6]])
    mix = np.array([[30, 8, 12], [10, 32, 9], [14, 16, 18], [12, 12, 12], [25, 18, 12]], dtype=np.float64)
    return np.asarray(125 + np.sin(points @ waves.T + [0.3, 1.1, 2.0, 0.7, 1.9]) @ mix)


@dataclass(frozen=True)
class Block:
    """Something in the room: the box between two corners (3,), with a solid texture of its own."""

    low: Array
    high: Array

    def reach(self, origin: Array, rays: Array) -> Array:
        """Where rays (n, 3) from origin (3,) enter it, in units of the ray; inf where they do not."""
        with np.errstate(divide="ignore", invalid="ignore"):
            a, b = (self.low - origin) / rays, (self.high - origin) / rays
        near, far = np.minimum(a, b).max(axis=1), np.maximum(a, b).min(axis=1)
        return np.where((near < far) & (near > 0), near, np.inf)

    def footprint(self) -> Array:
        """Counter-clockwise corners (4, 2)."""
        (x0, y0), (x1, y1) = self.low[:2], self.high[:2]
        return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])


def photograph(
    camera: Camera, pose: Pose3, gain: Array | float = 1.0, blocks: tuple[Block, ...] = ()
) -> NDArray[np.uint8]:
    """What the raw camera sees: 2 x 2 rays a pixel, averaged; gain (3,) or one for all channels."""
    total = np.zeros((camera.height, camera.width, 3))
    x, y = np.meshgrid(np.arange(camera.width, dtype=np.float64), np.arange(camera.height, dtype=np.float64))
    for dx, dy in np.stack(np.meshgrid([-0.25, 0.25], [-0.25, 0.25]), axis=-1).reshape(-1, 2):
        pixels = np.stack([x.ravel() + dx, y.ravel() + dy], axis=1)
        rays = np.column_stack([camera.undistort(pixels), np.ones(len(pixels))]) @ pose.rotation.T
        with np.errstate(divide="ignore"):
            reach = np.where(rays > 0, SIZE - pose.translation, pose.translation) / np.abs(rays)
        nearest = reach.min(axis=1)
        colour = solid(pose.translation + nearest[:, None] * rays)
        for block in blocks:
            entry = block.reach(pose.translation, rays)
            hit = pose.translation + np.where(np.isfinite(entry), entry, 0)[:, None] * rays
            colour = np.where((entry < nearest)[:, None], 255 - solid(hit[:, [1, 2, 0]] + 0.4), colour)
            nearest = np.minimum(entry, nearest)
        total += colour.reshape(total.shape) / 4
    return np.clip(np.round(total * gain), 0, 255).astype(np.uint8)


def camera_at(x: float, y: float, yaw: float, pitch_down: float = 0.0, z: float = 1.2) -> Pose3:
    """map_from_camera: level but for the pitch, rad."""
    c, s = np.cos(yaw), np.sin(yaw)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    tilt = np.asarray(cv2.Rodrigues(np.array([-pitch_down, 0.0, 0.0]))[0])
    return Pose3(turn @ OPTICAL @ tilt, np.array([x, y, z]))


def face_colours(face: Face, points: Array) -> Array:
    """RGB (N, 3) that the picture of `face` shows at points (N, 3), found by its vertices' uv, as a renderer would."""
    if face.texture is None:
        raise ValueError(f"{face.name} has no texture")
    homogeneous = np.column_stack([face.vertices, np.ones(len(face.vertices))])
    uv_from_points = np.linalg.lstsq(homogeneous, face.uv, rcond=1e-9)[0]
    uv = np.column_stack([points, np.ones(len(points))]) @ uv_from_points
    height, width = face.texture.shape[:2]
    xy = np.stack([uv[:, 0] * width - 0.5, (1 - uv[:, 1]) * height - 0.5], axis=1).astype(np.float32)
    picture = face.texture.astype(np.float32)
    found = [cv2.remap(picture, part[:, None], None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)[:, 0]
             for part in np.array_split(xy, len(xy) // 20000 + 1)]  # fmt: skip
    return np.concatenate(found).astype(np.float64)


@dataclass(frozen=True)
class Shoot:
    """Images of the box room and how they were taken."""

    camera: Camera
    poses: tuple[Pose3, ...]
    gains: Array
    images: tuple[NDArray[np.uint8], ...]

    def load(self, index: int) -> NDArray[np.uint8]:
        """Image `index`, BGR."""
        return self.images[index]


def shoot(camera: Camera, poses: tuple[Pose3, ...], gains: Array | None = None) -> Shoot:
    """Every pose photographed; gains (N, 3)."""
    factors = np.ones((len(poses), 3)) if gains is None else gains
    images = tuple(photograph(camera, pose, gain) for pose, gain in zip(poses, factors, strict=True))
    return Shoot(camera, poses, factors, images)


def round_tour(count: int = 12) -> tuple[Pose3, ...]:
    """Poses on a small circle in the middle, looking outwards, every other one down or up."""
    out = []
    for i in range(count):
        angle = 2 * np.pi * i / count
        x, y = SIZE[:2] / 2 + 0.5 * np.array([np.cos(angle), np.sin(angle)])
        out.append(camera_at(float(x), float(y), angle + 0.05, 0.35 if i % 2 else -0.25))
    return tuple(out)


WIDE = Camera(256, 192, np.array([[152.0, 0, 129.0], [0, 151.0, 94.5], [0, 0, 1]]), "plumb_bob",
              np.array([-0.16, 0.05, 0.001, -0.0008, 0.0]))  # fmt: skip
FISHEYE = Camera(256, 192, np.array([[104.0, 0, 127.0], [0, 104.0, 96.5], [0, 0, 1]]), "equidistant",
                 np.array([0.02, -0.006, 0.001, 0.0]))  # fmt: skip
RATIONAL = Camera(256, 192, np.array([[148.0, 0, 126.0], [0, 149.0, 97.0], [0, 0, 1]]), "rational_polynomial",
                  np.array([0.2, -0.05, 0.0005, 0.0004, 0.004, 0.35, -0.03, 0.002]))  # fmt: skip
