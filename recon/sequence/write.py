"""Writes a sequence as a sequence folder (FORMAT.md), whole or not at all."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from recon.errors import OutputError
from recon.files import atomic_path
from recon.progress import SILENT, Progress
from recon.sequence.camera import Camera
from recon.sequence.extrinsics import write_extrinsics
from recon.sequence.sequence import ImageList, Scans, Sequence
from recon.sequence.tum import write_planar

PNG_COMPRESSION = 3
"""Of pixels that were no file: quick, and little larger than at the best."""


def write_sequence(sequence: Sequence, folder: Path, progress: Progress = SILENT) -> None:
    """Write scans, images, intrinsics, odometry and extrinsics, those that there are, into a new or empty folder.

    JPEG and PNG images are copied as they are, pixels become PNG: nothing is lost. Raises OutputError when the folder
    is there and not empty, or cannot be written.
    """
    folder = Path(folder)
    try:
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise OutputError(f"{folder}: exists, expected a new or empty folder")
        with atomic_path(folder) as temporary:
            temporary.mkdir()
            _write(sequence, temporary, progress)
    except OSError as error:
        raise OutputError(f"{folder}: cannot be written: {error.strerror or error}") from error


def write_scans(path: Path, scans: Scans) -> None:
    """scans.npz of FORMAT.md."""
    arrays: dict[str, Any] = {
        "timestamps": scans.timestamps,
        "ranges": scans.ranges,
        "angle_min": np.float64(scans.angle_min),
        "angle_increment": np.float64(scans.angle_increment),
        "range_min": np.float64(scans.range_min),
        "range_max": np.float64(scans.range_max),
        "time_increment": np.float64(scans.time_increment),
    }
    if scans.intensities is not None:
        arrays["intensities"] = scans.intensities
    np.savez_compressed(path, **arrays)


def write_camera(path: Path, camera: Camera) -> None:
    """camera.yaml as ROS camera_calibration writes it."""
    matrix, distortion = camera.matrix.ravel().tolist(), camera.distortion.tolist()
    path.write_text(
        f"image_width: {camera.width}\nimage_height: {camera.height}\ncamera_name: {camera.name}\n"
        f"camera_matrix:\n  rows: 3\n  cols: 3\n  data: {matrix}\n"
        f"distortion_model: {camera.distortion_model}\n"
        f"distortion_coefficients:\n  rows: 1\n  cols: {len(distortion)}\n  data: {distortion}\n",
        encoding="utf-8",
    )


def _write(sequence: Sequence, folder: Path, progress: Progress) -> None:
    write_scans(folder / "scans.npz", sequence.scans)
    if sequence.odometry is not None:
        write_planar(folder / "odometry.txt", sequence.odometry, "platform odometry")
    if sequence.platform_from_camera is not None:
        write_extrinsics(folder / "extrinsics.yaml", sequence.platform_from_camera)
    if sequence.camera is not None and sequence.images is not None:
        write_camera(folder / "camera.yaml", sequence.camera)
        _write_images(sequence.images, folder, progress)


def _write_images(images: ImageList, folder: Path, progress: Progress) -> None:
    import cv2

    lines = ["# timestamp path"]
    with progress.stage("images", len(images), "images") as stage:
        for i, name in enumerate(images.names):
            data = images.read(i)
            if not isinstance(data, bytes):
                data = cv2.imencode(".png", data, [cv2.IMWRITE_PNG_COMPRESSION, PNG_COMPRESSION])[1].tobytes()
            path = folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)
            lines.append(f"{images.timestamps[i]:.6f} {name}")
            stage.advance()
    (folder / "images.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")
