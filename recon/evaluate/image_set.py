"""Labelled images with known intrinsics, camera height and tilt: what the paper was tested on (docs/formats.md)."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from recon.errors import InputError
from recon.evaluate.labels import read_label_image
from recon.geometry import Array, Pose3, mounted_camera
from recon.layout_file import read_layout
from recon.model import Layout
from recon.sequence.camera import Camera
from recon.sequence.images import check_image_sizes, read_image_list
from recon.sequence.intrinsics import read_camera
from recon.sequence.sequence import ImageList
from recon.sequence.trajectory import Trajectory
from recon.sequence.tum import read_planar, read_tum
from recon.sequence.yaml_file import numbers, read_mapping, require

SUFFIXES = (".jpg", ".jpeg", ".png")
PERIOD = 0.5
"""s between images, whose times are not known."""


@dataclass(frozen=True)
class ImageSet:
    """Labelled images of one drive, in the order of the numbers in their names.

    images, labels: an image and its label image each. platform_from_camera: the platform lies under the camera.
    layout, poses: where given, the true layout and the true planar poses (N, 3) of the platform in it.
    """

    name: str
    camera: Camera
    platform_from_camera: Pose3
    images: ImageList
    labels: tuple[Path, ...]
    layout: Layout | None = None
    poses: Array | None = None
    odometry: Trajectory | None = None

    def __len__(self) -> int:
        return len(self.images)


def find_image_sets(folder: Path) -> list[ImageSet]:
    """`folder` itself where it holds camera.yaml, else every folder in it that does, by name.

    Raises InputError, one line, where there is none or one is damaged.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError(f"{folder}: {'is a file' if folder.exists() else 'no such folder'}, expected image sets")
    if (folder / "camera.yaml").exists():
        return [read_image_set(folder)]
    inside = sorted(path for path in folder.iterdir() if (path / "camera.yaml").exists())
    if not inside:
        raise InputError(f"{folder}: holds no camera.yaml, nor does a folder in it, expected image sets")
    return [read_image_set(path) for path in inside]


def read_image_set(folder: Path) -> ImageSet:
    """camera.yaml, mounting.yaml, images/ and labels/ of one set; images without labels are left out.

    Where images.txt gives times, odometry.txt is read, and layout.json with camera_trajectory.txt. Raises InputError
    where something is missing or damaged, or fewer than two images have labels.
    """
    camera, mounting = read_camera(folder / "camera.yaml"), read_mounting(folder / "mounting.yaml")
    for part in ("images", "labels"):
        if not (folder / part).is_dir():
            raise InputError(f"{folder / part}: no such folder, expected one {part[:-1]} a file")
    listed = (folder / "images.txt").is_file()
    everything = read_image_list(folder / "images.txt") if listed else _found(folder / "images")
    labels = [folder / "labels" / f"{path.stem}.png" for path in everything.paths]
    kept = [i for i, label in enumerate(labels) if label.is_file()]
    if len(kept) < 2:
        raise InputError(
            f"{folder}: {len(kept)} of {len(labels)} images have a label image labels/STEM.png, expected 2 at least"
        )
    paths, names = tuple(everything.paths[i] for i in kept), tuple(everything.names[i] for i in kept)
    images = ImageList(everything.timestamps[kept], paths, names)
    check_image_sizes(images, camera)
    given = tuple(labels[i] for i in kept)
    name = folder.resolve().name
    return ImageSet(name, camera, mounting, images, given, *_motion(folder, listed, images.timestamps))


def _motion(folder: Path, listed: bool, stamps: Array) -> tuple[Layout | None, Array | None, Trajectory | None]:
    """True layout and poses, and odometry; each None where the set has none."""
    odometry, layout, way = (folder / name for name in ("odometry.txt", "layout.json", "camera_trajectory.txt"))
    if not listed:
        for path in (odometry, layout):
            if path.is_file():
                raise InputError(f"{path}: needs images.txt beside it, the times of the images")
        return None, None, None
    measured = read_planar(odometry) if odometry.is_file() else None
    if not layout.is_file():
        return None, None, measured
    poses = camera_headings(way)
    if stamps[0] < poses.timestamps[0] - PERIOD or stamps[-1] > poses.timestamps[-1] + PERIOD:
        raise InputError(
            f"{way}: covers {poses.timestamps[0]:.3f} to {poses.timestamps[-1]:.3f} s, the images were taken from "
            f"{stamps[0]:.3f} to {stamps[-1]:.3f} s"
        )
    return read_layout(layout), poses.at(stamps), measured


def camera_headings(path: Path) -> Trajectory:
    """Where the camera of a TUM trajectory is in plan and where its optical axis points."""
    stamps, positions, quaternions = read_tum(path)
    axes = [Pose3.from_quaternion(p, q).rotation[:2, 2] for p, q in zip(positions, quaternions, strict=True)]
    yaw = np.arctan2([a[1] for a in axes], [a[0] for a in axes])
    return Trajectory(stamps, np.column_stack([positions[:, :2], yaw]))


def read_mounting(path: Path) -> Pose3:
    """mounting.yaml: `camera_height` (m) and, 0 where absent, `tilt_deg` (down) and `roll_deg` (clockwise from behind).

    Raises InputError where it is missing or damaged, or the height is not above 0.
    """
    content = read_mapping(path)
    values = {key: content.get(key, 0.0) for key in ("tilt_deg", "roll_deg")}
    values["camera_height"] = require(path, content, "camera_height")
    height, tilt, roll = (
        float(numbers(path, key, [values[key]], (1,))[0]) for key in ("camera_height", "tilt_deg", "roll_deg")
    )
    if height <= 0 or abs(tilt) >= 90 or abs(roll) >= 90:
        raise InputError(
            f"{path}: camera_height {height:g}, tilt_deg {tilt:g}, roll_deg {roll:g}, expected a height above 0 m and "
            "angles between -90 and 90"
        )
    return mounting_pose(height, tilt, roll)


def mounting_pose(height: float, tilt_deg: float, roll_deg: float) -> Pose3:
    """platform_from_camera of a camera above the platform's origin (m) that looks ahead, tilted down, then rolled."""
    tilt, roll = np.radians([tilt_deg, roll_deg])
    return mounted_camera([0.0, 0.0, height], 0.0, tilt, roll)


def read_labels(path: Path, camera: Camera) -> NDArray[np.uint16]:
    """A label image of the camera's size; raises InputError for another size or kind."""
    image = read_label_image(path)
    if image.shape != (camera.height, camera.width):
        raise InputError(
            f"{path}: is {image.shape[1]} x {image.shape[0]} pixels, camera.yaml says {camera.width} x {camera.height}"
        )
    return image


def _found(folder: Path) -> ImageList:
    """The pictures of a folder in the order of the numbers in their names, PERIOD apart."""
    paths = sorted((path for path in folder.iterdir() if path.suffix.lower() in SUFFIXES), key=_numbers)
    stamps: Array = PERIOD * np.arange(len(paths), dtype=np.float64)
    return ImageList(stamps, tuple(paths), tuple(f"{folder.name}/{path.name}" for path in paths))


def _numbers(path: Path) -> tuple[list[tuple[int, str]], str]:
    """Sort key: frame2 before frame10."""
    parts = re.findall(r"\d+|\D+", path.stem)
    return [(int(p), "") if p.isdigit() else (-1, p) for p in parts], path.name
