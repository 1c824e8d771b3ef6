"""The sequence folder (FORMAT.md)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from recon.errors import InputError
from recon.geometry import Array, Pose3
from recon.sequence.camera import Camera
from recon.sequence.extrinsics import read_extrinsics
from recon.sequence.images import check_image_sizes, read_image_list
from recon.sequence.intrinsics import read_camera
from recon.sequence.scans import read_scans_npz, say_blind
from recon.sequence.scans_csv import read_scans_csv
from recon.sequence.sequence import ImageList, Scans, Sequence
from recon.sequence.trajectory import Trajectory
from recon.sequence.tum import read_planar, read_tum


def read_sequence(path: Path) -> Sequence:
    """Everything of a sequence folder but the pixels, which are read when asked for, and `groundtruth/`, which is not.

    Raises InputError, one line that names the file, the value and what was expected, for whatever cannot be used.
    """
    path = Path(path)
    if not path.is_dir():
        raise InputError(f"{path}: {'is a file' if path.exists() else 'no such folder'}, expected a sequence folder")
    warnings: list[str] = []
    scans = _read_scans(path, warnings)
    camera, images = _read_images(path)
    odometry = _read_odometry(path, warnings)
    extrinsics = _read_given_extrinsics(path)
    _check_clocks(path, scans, images, odometry, warnings)
    return Sequence(path.resolve().name, scans, camera, images, odometry, extrinsics, tuple(warnings))


def _read_scans(path: Path, warnings: list[str]) -> Scans:
    npz, csv = path / "scans.npz", path / "scans.csv"
    if npz.exists() and csv.exists():
        warnings.append("both scans.npz and scans.csv are there: scans.csv is not read")
    if not npz.exists() and not csv.exists():
        raise InputError(f"{path}: holds neither scans.npz nor scans.csv, expected a sequence folder")
    scans = read_scans_npz(npz) if npz.exists() else read_scans_csv(csv)
    say_blind(scans, warnings)
    return scans


def _read_images(path: Path) -> tuple[Camera | None, ImageList | None]:
    has_camera, has_list = (path / "camera.yaml").exists(), (path / "images.txt").exists()
    if not has_camera and not has_list:
        if (path / "images").is_dir():
            raise InputError(f"{path}: images/ is there but images.txt and camera.yaml are missing")
        return None, None
    if not has_list:
        raise InputError(f"{path / 'images.txt'}: is missing, though camera.yaml is there")
    if not has_camera:
        raise InputError(f"{path / 'camera.yaml'}: is missing, though images.txt is there")
    camera, images = read_camera(path / "camera.yaml"), read_image_list(path / "images.txt")
    check_image_sizes(images, camera)
    return camera, images


def _read_odometry(path: Path, warnings: list[str]) -> Trajectory | None:
    file = path / "odometry.txt"
    if not file.exists():
        return None
    _, positions, quaternions = read_tum(file)
    tilt = np.degrees(np.arccos(np.clip(1 - 2 * (quaternions[:, 0] ** 2 + quaternions[:, 1] ** 2), -1, 1)))
    climb = float(np.ptp(positions[:, 2]))
    if tilt.max() > 5 or climb > 0.5:
        warnings.append(
            f"odometry.txt is not planar (tilt up to {tilt.max():.0f} deg, "
            f"z changes by {climb:.1f} m): only x, y and yaw are used"
        )
    return read_planar(file)


def _read_given_extrinsics(path: Path) -> Pose3 | None:
    file = path / "extrinsics.yaml"
    if not file.exists():
        return None
    pose = read_extrinsics(file)
    if pose.translation[2] <= 0:
        raise InputError(f"{file}: camera height (z of the translation) is {pose.translation[2]:g} m, expected > 0")
    return pose


def _check_clocks(
    path: Path, scans: Scans, images: ImageList | None, odometry: Trajectory | None, warnings: list[str]
) -> None:
    """All stamps are on one clock: no overlap with the scans is an error, images outside them are counted."""
    first, last = scans.timestamps[0], scans.timestamps[-1]
    for name, other in (("images.txt", images), ("odometry.txt", odometry)):
        if other is None:
            continue
        t: Array = other.timestamps
        slack = 1.0 + float(last - first) * 0.05
        if t[-1] < first - slack or t[0] > last + slack:
            raise InputError(
                f"{path / name}: stamps {t[0]:.3f} to {t[-1]:.3f} s do not overlap the scans' "
                f"{first:.3f} to {last:.3f} s, expected one clock"
            )
        outside = int(((t < first - 1.0) | (t > last + 1.0)).sum()) if name == "images.txt" else 0
        if outside:
            warnings.append(f"{outside} of {len(t)} images were taken over 1 s before the first or after the last scan")
