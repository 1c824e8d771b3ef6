"""Top-down view: the homography H = K R K^-1 of the vertical vanishing point (paper 2.3.1)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from recon.geometry import Array
from recon.sequence.camera import Camera


def ground_from_camera(vertical: ArrayLike) -> Array:
    """Rotation (3, 3) from the camera optical frame to the ground frame: x right, y forward, z up.

    vertical: (3,) unit vector in the camera optical frame, pointing down to the floor. The paper's arbitrary frame
    (eq. 4) sets the y component of its x axis to zero, which is undefined for a level camera; here the x axis is the
    image's x axis made horizontal, defined for every camera that does not lie on its side.
    """
    down = np.asarray(vertical, dtype=np.float64) / np.linalg.norm(vertical)
    right = np.array([1.0, 0.0, 0.0]) - down[0] * down
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(right, down), -down])


def topdown_homography(camera: Camera, vertical: ArrayLike) -> Array:
    """H = K R K^-1 (3, 3), from pixels of the rectified image to the top-down view (paper eq. 6).

    R turns the camera to look straight down: x right, y backward, z down.
    """
    rotation = np.diag([1.0, -1.0, -1.0]) @ ground_from_camera(vertical)
    return np.asarray(camera.matrix @ rotation @ np.linalg.inv(camera.matrix))


def ground_map(pixels: ArrayLike, camera: Camera, vertical: ArrayLike) -> Array:
    """Rectified pixels (..., 2) as points of the ground map (..., 2): x right, y forward, camera height = 1.

    nan at and above the horizon.
    """
    px = np.asarray(pixels, dtype=np.float64)
    rays = np.concatenate([px, np.ones((*px.shape[:-1], 1))], axis=-1) @ np.linalg.inv(camera.matrix).T
    ground = rays @ ground_from_camera(vertical).T
    below = np.where(ground[..., 2:] < -1e-6, -ground[..., 2:], np.nan)
    return np.asarray(ground[..., :2] / below)
