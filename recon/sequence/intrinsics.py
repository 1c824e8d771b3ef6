"""camera.yaml, as ROS camera_calibration writes it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from recon.errors import InputError
from recon.geometry import Array
from recon.sequence.camera import Camera, DistortionModel
from recon.sequence.yaml_file import numbers, read_mapping, require

COEFFICIENTS: dict[DistortionModel, tuple[int, ...]] = {
    "plumb_bob": (0, 4, 5),
    "rational_polynomial": (8,),
    "equidistant": (4,),
}
"""How many distortion coefficients each model has; plumb_bob with 4 has k3 = 0, with none has no distortion."""

MAX_SIDE = 32768


def read_camera(path: Path) -> Camera:
    """Intrinsics from camera.yaml.

    Raises InputError for a missing or damaged file, missing keys, a size outside 1 to 32768 pixels, a matrix that is
    not [fx s cx; 0 fy cy; 0 0 1] with positive focal lengths, and a distortion model or coefficient count not known.
    """
    content = read_mapping(path)
    width, height = (_side(path, content, key) for key in ("image_width", "image_height"))
    matrix = _data(path, content, "camera_matrix", (9,)).reshape(3, 3)
    shape = matrix[0, 0] > 0 and matrix[1, 1] > 0 and matrix[1, 0] == 0 and (matrix[2] == [0, 0, 1]).all()
    if not shape:
        raise InputError(
            f"{path}: camera_matrix is {matrix.ravel().tolist()}, expected fx 0 cx 0 fy cy 0 0 1, fx, fy > 0"
        )
    model = content.get("distortion_model", "plumb_bob")
    if model not in COEFFICIENTS:
        raise InputError(f"{path}: distortion_model is {model!r}, expected one of {', '.join(COEFFICIENTS)}")
    distortion = _data(path, content, "distortion_coefficients", COEFFICIENTS[model])
    if model == "plumb_bob":
        distortion = np.concatenate([distortion, np.zeros(5 - len(distortion))])
    return Camera(width, height, matrix, model, distortion, str(content.get("camera_name", "camera")))


def _side(path: Path, content: dict[str, Any], key: str) -> int:
    value = require(path, content, key)
    if isinstance(value, bool) or not isinstance(value, int) or not 1 <= value <= MAX_SIDE:
        raise InputError(f"{path}: {key} is {value!r}, expected 1 to {MAX_SIDE} pixels")
    return value


def _data(path: Path, content: dict[str, Any], key: str, sizes: tuple[int, ...]) -> Array:
    value = require(path, content, key)
    return numbers(path, key, value.get("data") if isinstance(value, dict) else value, sizes)
