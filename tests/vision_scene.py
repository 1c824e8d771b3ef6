"""A panelled room seen by any camera: images with known vanishing points, and line segments with known noise."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array
from recon.sequence.camera import Camera
from recon.vision.frame import FrameLines

ROOM = np.array([2.6, 1.9, 1.4])  # half sizes, m


def pinhole(distorted: bool = False, width: int = 480, height: int = 360) -> Camera:
    k = np.array([[0.8 * width, 0, 0.51 * width], [0, 0.8 * width, 0.49 * height], [0, 0, 1.0]])
    d = np.array([-0.22, 0.06, 0.001, -0.0005, 0.0]) if distorted else np.zeros(5)
    return Camera(width, height, k, "plumb_bob", d)


def fisheye(width: int = 480, height: int = 360) -> Camera:
    """Its corners look 100 degrees off the axis."""
    f = np.hypot(width, height) / 2 / np.deg2rad(100)
    k = np.array([[f, 0, width / 2], [0, f, height / 2], [0, 0, 1.0]])
    return Camera(width, height, k, "equidistant", np.array([0.01, -0.003, 0.0, 0.0]))


def camera_from_world(tilt: float, roll: float, yaw: float) -> Array:
    """(3, 3): the world has z up; the camera looks along x at yaw 0, `tilt` down, rolled about its axis; rad."""
    axes = np.array([[0, -1, 0], [0, 0, -1], [1, 0, 0.0]])  # optical axes x right, y down, z ahead
    c, s = np.cos(yaw), np.sin(yaw)
    turn = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1.0]])
    c, s = np.cos(tilt), np.sin(tilt)
    nod = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    c, s = np.cos(roll), np.sin(roll)
    lean = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1.0]])
    return np.asarray(lean @ nod @ axes @ turn)


def render_room(camera: Camera, rotation: Array, exposure: float = 1.0, noise: float = 2.0) -> NDArray[np.uint8]:
    """(H, W) grey picture of a box room with panels on its walls, from its middle; rotation: camera from world."""
    offsets = np.array([-0.25, 0.25])
    total = np.zeros((camera.height, camera.width))
    u, v = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    for a in offsets:
        for b in offsets:
            xy = camera.undistort(np.stack([u.ravel() + a, v.ravel() + b], axis=1))
            rays = np.concatenate([xy, np.ones((len(xy), 1))], axis=1) @ rotation
            total += _brightness(rays).reshape(total.shape)
    rng = np.random.default_rng(0)
    image = total / 4 * exposure + rng.normal(0, noise, total.shape)
    return np.clip(np.round(image), 0, 255).astype(np.uint8)


def _brightness(rays: Array) -> Array:
    """(n,) grey level where rays (n, 3) from the middle of the room meet it."""
    with np.errstate(divide="ignore"):
        reach = ROOM / np.abs(rays)
    axis = np.argmin(reach, axis=1)
    point = rays * reach.min(axis=1)[:, None]
    side = np.take_along_axis(rays, axis[:, None], axis=1)[:, 0] > 0
    level = np.choose(axis, [110.0, 140.0, np.where(side, 190.0, 70.0)]) + np.where(side, 0.0, 25.0)
    along = np.where(axis == 0, point[:, 1], point[:, 0])
    panel = (np.abs((along % 1.1) - 0.55) < 0.3) & (np.abs(point[:, 2] - 0.1) < 0.75) & (axis < 2)
    return np.asarray(level + np.where(panel, -45.0, 0.0))


def segments_towards(
    directions: Array, count: int, camera: Camera, noise: float, rng: np.random.Generator
) -> tuple[Array, NDArray[np.int64]]:
    """Segments (L, 2, 2) in the rectified image, `count` for each of directions (D, 3), their ends moved by `noise` px
    across, and the direction (L,) each belongs to."""
    k = camera.matrix
    out: list[Array] = []
    owner: list[int] = []
    while len(out) < count * len(directions):
        d = len(out) // count
        middle = rng.uniform([20, 20], [camera.width - 20, camera.height - 20])
        ray = np.linalg.solve(k, np.append(middle, 1.0))
        ends = np.stack([ray - 1e-4 * directions[d], ray + 1e-4 * directions[d]]) @ k.T
        ends = ends[:, :2] / ends[:, 2:]
        unit = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
        half = rng.uniform(15, 60)
        ends = middle + np.array([[-half], [half]]) * unit
        out.append(ends + rng.normal(0, noise, (2, 1)) * np.array([-unit[1], unit[0]]))
        owner.append(d)
    return np.array(out), np.array(owner)


def frame_with(endpoints: Array, sigma: float) -> FrameLines:
    n = len(endpoints)
    labels = np.full(n, -1, np.int64)
    return FrameLines(endpoints, np.full(n, sigma), labels, np.full((3, 3), np.nan), np.zeros(0, np.int64))


def angle_deg(a: Array, b: Array) -> float:
    """Between two unit vectors."""
    return float(np.rad2deg(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b)))
