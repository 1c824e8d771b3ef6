"""Which pixels of a photograph the faces of a model explain: another one, moved by way of the faces, fits there."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array, Pose3
from recon.raycast import RayScene
from recon.sequence.camera import Camera
from recon.texture.matches import contrast
from recon.texture.view import Image, Lens

NODE = 8
"""Pixels between the rays that are cast; linear in between."""
MOST_SHIFT = 0.008
"""Share of the image's width: what lies further from where the faces put it stands before or behind them."""
RETURN = 1.5
"""Pixels within which the way there and back must close."""
TOLERANCE = 0.05
"""m: as textures, a point met this much before its place is seen."""
LEAST_BASE, MOST_BASE = 0.2, 1.5
"""m between the two photographs: nearer ones would agree whatever stands there, farther ones cannot be matched."""


def explained(
    scene: RayScene, camera: Camera, poses: tuple[Pose3, Pose3], photos: tuple[Image, Image]
) -> NDArray[np.bool_]:
    """Pixels (H, W) of the first of two photos (H, W, 3) BGR that the second shows where the faces put them.

    The second is drawn as the first should see it; then the optical flow between the two (DIS, Kroeger et al. 2016) is
    the parallax of what is not on the faces.
    """
    place, common = _transfer(scene, camera, *poses)
    first = contrast(photos[0], working_width=camera.width)
    second = contrast(photos[1], working_width=camera.width)
    drawn = cv2.remap(second, place, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    flow = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
    there = np.asarray(flow.calc(first, drawn, None))
    back = np.asarray(flow.calc(drawn, first, None))
    grid = np.stack(np.meshgrid(np.arange(camera.width), np.arange(camera.height)), axis=2).astype(np.float32)
    returned = there + cv2.remap(back, grid + there, None, cv2.INTER_LINEAR)
    fits = (np.linalg.norm(there, axis=2) < MOST_SHIFT * camera.width) & (np.linalg.norm(returned, axis=2) < RETURN)
    return np.asarray(fits & common)


def partner(index: int, poses: list[Pose3 | None], others: list[int], camera: Camera) -> int | None:
    """Of images `others` the one to compare image `index` with: most alike in direction at a useful distance."""
    own = poses[index]
    best: tuple[float, int] | None = None
    for k in others:
        pose = poses[k]
        if own is None or pose is None:
            continue
        base = float(np.linalg.norm(pose.translation - own.translation))
        turn = float(np.arccos(np.clip((np.trace(own.rotation.T @ pose.rotation) - 1) / 2, -1, 1)))
        if LEAST_BASE <= base <= MOST_BASE and (best is None or (turn, k) < best):
            best = turn, k
    width = np.arctan(camera.width / 2 / camera.matrix[0, 0])
    return best[1] if best is not None and best[0] < width else None


def _transfer(
    scene: RayScene, camera: Camera, pose: Pose3, other: Pose3
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Pixels (H, W, 2) of the other photo for every pixel, and where both see the same surface."""
    lens = Lens.of(camera)
    x = np.arange(0, camera.width + NODE, NODE, dtype=np.float64)
    y = np.arange(0, camera.height + NODE, NODE, dtype=np.float64)
    nodes = np.stack(np.meshgrid(x, y), axis=2)
    points = _points(scene, camera, pose, nodes.reshape(-1, 2))
    seen = lens.project(other.inverse().apply(points))
    reach, _ = scene.cast(other.translation, points - other.translation)
    hidden = (1 - reach) * np.linalg.norm(points - other.translation, axis=1) > TOLERANCE
    good = np.isfinite(seen).all(axis=1) & ~hidden
    seen[~good] = -1e4
    maps = np.stack(np.meshgrid(np.arange(camera.width), np.arange(camera.height)), axis=2).astype(np.float32) / NODE
    grid = np.concatenate([seen, good[:, None]], axis=1).astype(np.float32).reshape(len(y), len(x), 3)
    full = cv2.remap(grid, maps, None, cv2.INTER_LINEAR)
    place = np.ascontiguousarray(full[..., :2])
    inside = (place >= 0).all(axis=2) & (place <= [camera.width - 1, camera.height - 1]).all(axis=2)
    return place, np.asarray(inside & (full[..., 2] > 0.999))


def _points(scene: RayScene, camera: Camera, pose: Pose3, pixels: Array) -> Array:
    """Where the rays of pixels (N, 2) meet faces (N, 3); nan where they meet none."""
    rays = np.column_stack([camera.undistort(pixels), np.ones(len(pixels))]) @ pose.rotation.T
    reach, _ = scene.cast(pose.translation, rays)
    return np.asarray(pose.translation + np.where(np.isfinite(reach), reach, np.nan)[:, None] * rays)
