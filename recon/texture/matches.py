"""Where one image sees what another one sees, found by way of the model."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array, Pose3
from recon.raycast import RayScene
from recon.texture.view import Image, Lens

WORKING_WIDTH = 360
"""Pixels: images are matched at about this width."""
NODE = 8
"""Pixels of the small image between points whose place in the other image is computed; linear in between."""
CORNERS, CORNER_DISTANCE, CORNER_QUALITY = 250, 7, 0.01
WINDOW, PYRAMID = (17, 17), 2
MAX_RETURN = 0.5
"""Pixels: tracked there and back, a point must come back this near."""


@dataclass(frozen=True)
class Matches:
    """Points seen by images `first` and `second`: pixels (m, 2) of the raw images, on faces (m,)."""

    first: int
    second: int
    first_pixels: Array
    second_pixels: Array
    face: NDArray[np.int64]


@dataclass(frozen=True)
class Matcher:
    """Finds matches. scene: surfaces; poses: of all images; small(i): image i as `contrast` gives it, or None."""

    lens: Lens
    scene: RayScene
    poses: list[Pose3 | None]
    small: Callable[[int], Image | None]

    def match(self, first: int, others: Sequence[int]) -> list[Matches]:
        """Every other image is drawn as the first one should see it, and corners are tracked from one to the other.

        So matches differ by pose errors only, not by perspective (Lucas-Kanade needs that). Others that cannot be
        read are left out; none where the first image shows no corner.
        """
        a, pose = self.small(first), self.poses[first]
        corners = None if a is None else cv2.goodFeaturesToTrack(a, CORNERS, CORNER_QUALITY, CORNER_DISTANCE)
        if a is None or pose is None or corners is None:
            return []
        scale = self.lens.camera.width / a.shape[1]
        points, face = self._surface(pose, a.shape, scale)
        found = []
        for second in others:
            b, other = self.small(second), self.poses[second]
            if b is not None and other is not None:
                place = self._place(points, other, a.shape)
                start, end, on = _follow(a, b, corners, place, face, scale)
                found.append(Matches(first, second, start, end, on))
        return found

    def _surface(self, pose: Pose3, shape: tuple[int, ...], scale: float) -> tuple[Array, NDArray[np.int64]]:
        """Points (r, c, 3) that a small image shows at its nodes, and their faces (r, c), -1 for none."""
        rows, columns = -(-shape[0] // NODE) + 1, -(-shape[1] // NODE) + 1
        x, y = np.meshgrid(np.arange(columns) * NODE, np.arange(rows) * NODE)
        pixels = (np.stack([x.ravel(), y.ravel()], axis=1) + 0.5) * scale - 0.5
        rays = np.column_stack([self.lens.camera.undistort(pixels), np.ones(len(pixels))])
        directions = rays @ pose.rotation.T
        reach, face = self.scene.cast(pose.translation, directions)
        reach = np.where(np.isfinite(reach), reach, 1.0)
        points = pose.translation + directions * reach[:, None]
        return points.reshape(rows, columns, 3), face.reshape(rows, columns)

    def _place(self, points: Array, pose: Pose3, shape: tuple[int, ...]) -> NDArray[np.float32]:
        """Pixels (h, w, 2) of a raw image from `pose` for every pixel of a small image with `points` at its nodes."""
        seen = self.lens.project(pose.inverse().apply(points.reshape(-1, 3))).astype(np.float32)
        maps = np.stack(np.meshgrid(np.arange(shape[1]), np.arange(shape[0])), axis=2).astype(np.float32) / NODE
        return np.asarray(cv2.remap(seen.reshape(*points.shape[:2], 2), maps, None, cv2.INTER_LINEAR))


def _follow(
    a: Image,
    b: Image,
    corners: NDArray[np.float32],
    place: NDArray[np.float32],
    face: NDArray[np.int64],
    scale: float,
) -> tuple[Array, Array, NDArray[np.int64]]:
    """Pixels (m, 2), (m, 2) of both raw images and faces (m,) of the corners of small image a that b shows, too."""
    drawn = cv2.remap(b, (place + 0.5) / scale - 0.5, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    found, ok = _track(a, drawn, corners)
    start, end = corners.reshape(-1, 2)[ok], found.reshape(-1, 2)[ok]
    on = _owner(face, start)
    second = _read(place, end)
    keep = (on >= 0) & (on == _owner(face, end)) & np.isfinite(second).all(axis=1)
    return (start[keep].astype(np.float64) + 0.5) * scale - 0.5, second[keep].astype(np.float64), on[keep]


def contrast(image: Image, working_width: int = WORKING_WIDTH) -> Image:
    """A small grey picture of an image without its exposure and shading: logarithm less its local mean."""
    factor = max(round(image.shape[1] / working_width), 1)
    size = (image.shape[1] // factor, image.shape[0] // factor)
    grey = cv2.cvtColor(cv2.resize(image, size, interpolation=cv2.INTER_AREA), cv2.COLOR_BGR2GRAY)
    log = np.log(grey.astype(np.float32) + 8)
    return np.clip(128 + 120 * (log - cv2.GaussianBlur(log, (0, 0), 12)), 0, 255).astype(np.uint8)


def _track(a: Image, b: Image, corners: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Where the corners are in b, and whether that is sure (tracked back they return)."""
    found, status, _ = cv2.calcOpticalFlowPyrLK(a, b, corners, None, winSize=WINDOW, maxLevel=PYRAMID)
    back, status_back, _ = cv2.calcOpticalFlowPyrLK(b, a, found, None, winSize=WINDOW, maxLevel=PYRAMID)
    distance = np.linalg.norm((back - corners).reshape(-1, 2), axis=1)
    return found, (status.ravel() == 1) & (status_back.ravel() == 1) & (distance < MAX_RETURN)


def _owner(face: NDArray[np.int64], pixels: NDArray[np.float32]) -> NDArray[np.int64]:
    """The face around pixels (m, 2) of the small image: that of all four nodes, -1 where they differ."""
    cell = np.floor(pixels / NODE).astype(np.int64)
    c, r = (np.clip(cell[:, k], 0, face.shape[1 - k] - 2) for k in (0, 1))
    own = face[r, c]
    same = (face[r + 1, c] == own) & (face[r, c + 1] == own) & (face[r + 1, c + 1] == own)
    return np.where(same, own, -1)


def _read(place: NDArray[np.float32], pixels: NDArray[np.float32]) -> NDArray[np.float32]:
    """Values (m, 2) of a map (h, w, 2) at pixels (m, 2)."""
    if len(pixels) == 0:
        return np.zeros((0, 2), np.float32)
    read = cv2.remap(place, pixels.reshape(-1, 1, 2), None, cv2.INTER_LINEAR, borderValue=(np.nan, np.nan))
    return np.asarray(read).reshape(-1, 2)
