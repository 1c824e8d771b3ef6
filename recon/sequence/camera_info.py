"""CameraInfo messages as intrinsics."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from recon.geometry import Array
from recon.sequence.camera import Camera, DistortionModel

MODELS: dict[str, DistortionModel] = {
    "": "plumb_bob",
    "none": "plumb_bob",
    "plumb_bob": "plumb_bob",
    "radtan": "plumb_bob",
    "brown_conrady": "plumb_bob",
    "rational_polynomial": "rational_polynomial",
    "equidistant": "equidistant",
    "fisheye": "equidistant",
    "kannala_brandt4": "equidistant",
}
"""Names that drivers use, and ours."""
COUNTS: dict[DistortionModel, int] = {"plumb_bob": 5, "rational_polynomial": 8, "equidistant": 4}


def camera_of(message: Any, rectified: bool, warnings: list[str]) -> Camera | str:
    """Intrinsics, or why there are none. `rectified`: of images that the driver undistorted (matrix P)."""
    matrix = np.array(_either(message, "k"), dtype=np.float64).reshape(3, 3)
    if rectified:
        projection = np.array(_either(message, "p"), dtype=np.float64).reshape(3, 4)[:, :3]
        matrix = projection if projection[0, 0] > 0 else matrix
    if not np.isfinite(matrix).all() or matrix[0, 0] <= 0 or matrix[1, 1] <= 0:
        return "is not calibrated (focal length 0)"
    matrix = matrix / matrix[2, 2] if matrix[2, 2] else matrix + np.diag([0, 0, 1.0])
    width, height = int(message.width), int(message.height)
    if width < 1 or height < 1:
        return f"says an image of {width} x {height} pixels"
    model = MODELS.get(str(message.distortion_model).strip().lower())
    coefficients = np.array(_either(message, "d"), dtype=np.float64).ravel()
    if rectified or not np.any(coefficients):
        return Camera(width, height, matrix, "plumb_bob", np.zeros(5))
    if model is None:
        return f"has the distortion model {message.distortion_model!r}, expected one of {', '.join(COUNTS)}"
    if model == "plumb_bob" and len(coefficients) > 5 and np.any(coefficients[5:]):
        model = "rational_polynomial"
    if not np.isfinite(coefficients).all():
        return "has distortion coefficients that are not finite"
    if np.any(coefficients[COUNTS[model] :]):
        warnings.append(f"distortion coefficients beyond the first {COUNTS[model]} are left out")
    return Camera(width, height, matrix, model, _padded(coefficients, COUNTS[model]))


def scaled(camera: Camera, width: int, height: int) -> Camera | None:
    """The camera for images of another resolution but the same view; None where the aspect is another.

    Pixel centres are at integer coordinates: it is c + 1/2 that scales.
    """
    x, y = width / camera.width, height / camera.height
    if abs(x / y - 1) > 0.01:
        return None
    matrix: Array = camera.matrix.copy()
    matrix[:2] *= [[x], [y]]
    matrix[0, 2], matrix[1, 2] = (camera.matrix[0, 2] + 0.5) * x - 0.5, (camera.matrix[1, 2] + 0.5) * y - 0.5
    return replace(camera, width=width, height=height, matrix=matrix)


def _padded(coefficients: Array, count: int) -> Array:
    out = np.zeros(count)
    out[: len(coefficients)] = coefficients[:count]
    return out


def _either(message: Any, name: str) -> Any:
    """A field that ROS 2 writes in small letters and ROS 1 in capitals."""
    return getattr(message, name, None) if hasattr(message, name) else getattr(message, name.upper())
