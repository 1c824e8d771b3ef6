"""extrinsics.yaml: the camera's pose on the platform."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from recon.errors import InputError
from recon.files import atomic_path
from recon.geometry import Pose3
from recon.sequence.yaml_file import numbers, read_mapping, require

KEY = "platform_from_camera"


def read_extrinsics(path: Path) -> Pose3:
    """platform_from_camera; its z is the camera's height above the floor, m.

    The key `lidar_from_camera` is taken too where `lidar_height` is given: z is then measured from the scan plane, and
    the scanner's height is added to it. Raises InputError for a missing or damaged file, missing keys, numbers that are
    not finite and a quaternion whose norm is not within 5 % of 1.
    """
    content = read_mapping(path)
    height = content.get("lidar_height")
    if height is not None:
        height = float(numbers(path, "lidar_height", [height], (1,))[0])
    from_lidar = KEY not in content and "lidar_from_camera" in content
    if from_lidar and height is None:
        raise InputError(f"{path}: lidar_from_camera needs lidar_height, the scanner's height above the floor in m")
    key = "lidar_from_camera" if from_lidar else KEY
    pose = require(path, content, key)
    if not isinstance(pose, dict):
        raise InputError(f"{path}: {key} is {pose!r}, expected translation and quaternion_xyzw")
    translation = numbers(path, f"{key} translation", pose.get("translation"), (3,))
    quaternion = numbers(path, f"{key} quaternion_xyzw", pose.get("quaternion_xyzw"), (4,))
    norm = float(np.linalg.norm(quaternion))
    if abs(norm - 1) > 0.05:
        raise InputError(f"{path}: {key} quaternion_xyzw has norm {norm:.4g}, expected 1")
    if from_lidar:
        translation[2] += height
    return Pose3.from_quaternion(translation, quaternion)


def write_extrinsics(path: Path, platform_from_camera: Pose3, comment: str = "") -> None:
    """Writes extrinsics.yaml with `comment` on the first line."""
    translation = ", ".join(f"{v:.6f}" for v in platform_from_camera.translation + 0.0)
    quaternion = ", ".join(f"{v:.9f}" for v in platform_from_camera.quaternion_xyzw() + 0.0)
    text = f"{KEY}:\n  translation: [{translation}]\n  quaternion_xyzw: [{quaternion}]\n"
    with atomic_path(path) as temporary:
        temporary.write_text((f"# {comment}\n" if comment else "") + text, encoding="utf-8")
