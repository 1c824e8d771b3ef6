"""Pinhole camera with lens distortion, as ROS camera_calibration describes it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np
from numpy.typing import ArrayLike

from recon.geometry import Array

DistortionModel = Literal["plumb_bob", "rational_polynomial", "equidistant"]


@dataclass(frozen=True)
class Camera:
    """Intrinsics of one camera. Pixel centres are at integer coordinates.

    matrix: (3, 3) K, pixels. distortion: (n,), in OpenCV's order (`equidistant` is OpenCV's fisheye, n = 4).
    """

    width: int
    height: int
    matrix: Array
    distortion_model: DistortionModel = "plumb_bob"
    distortion: Array = None  # type: ignore[assignment]
    name: str = "camera"

    def __post_init__(self) -> None:
        if self.distortion is None:
            object.__setattr__(self, "distortion", np.zeros(4 if self.distortion_model == "equidistant" else 5))

    def undistort(self, pixels: ArrayLike) -> Array:
        """Pixels (N, 2) as normalised image coordinates (N, 2): x/z and y/z in the camera optical frame."""
        points = np.asarray(pixels, dtype=np.float64).reshape(-1, 1, 2)
        if len(points) == 0:
            return np.zeros((0, 2))
        if self.distortion_model == "equidistant":
            out = cv2.fisheye.undistortPoints(points, self.matrix, self.distortion)
        else:
            criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 40, 1e-10)
            out = cv2.undistortPoints(points, self.matrix, self.distortion, criteria=criteria)
        return np.asarray(out, dtype=np.float64).reshape(-1, 2)

    def project(self, points: ArrayLike) -> Array:
        """Points (N, 3) of the camera optical frame as pixels (N, 2); nan where z <= 0."""
        from recon.sequence.lens import project_equidistant, project_rational

        p = np.ascontiguousarray(np.asarray(points, dtype=np.float64).reshape(-1, 3))
        pinhole = np.array([self.matrix[0, 0], self.matrix[1, 1], self.matrix[0, 2], self.matrix[1, 2]])
        bent = np.zeros(8)
        bent[: min(len(self.distortion), 8)] = self.distortion[:8]
        lens = project_equidistant if self.distortion_model == "equidistant" else project_rational
        return np.asarray(lens(p, pinhole, bent))

    def rays(self) -> Array:
        """Directions (height, width, 3), z = 1, of every pixel of the (distorted) image."""
        u, v = np.meshgrid(np.arange(self.width), np.arange(self.height))
        xy = self.undistort(np.stack([u.ravel(), v.ravel()], axis=1))
        return np.concatenate([xy, np.ones((len(xy), 1))], axis=1).reshape(self.height, self.width, 3)

    def rectified(self) -> Camera:
        """The same camera without distortion: same size and matrix, straight lines stay straight."""
        return Camera(self.width, self.height, self.matrix, "plumb_bob", np.zeros(5), self.name)

    @property
    def is_distorted(self) -> bool:
        """Whether straight lines come out bent."""
        return bool(np.any(self.distortion != 0)) or self.distortion_model == "equidistant"
