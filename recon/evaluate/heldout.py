"""A result textured again without some of its images."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from recon.config_file import load_config
from recon.errors import InputError
from recon.files import read_text
from recon.geometry import Array, Pose3
from recon.graph.between import poses_between
from recon.model import Model
from recon.results.accuracy import read_sigmas
from recon.results.reader import load_model
from recon.segmentation.pixels import ObjectPixels
from recon.sequence.camera import Camera
from recon.sequence.extrinsics import read_extrinsics
from recon.sequence.images import load_image
from recon.sequence.open import open_sequence
from recon.sequence.sequence import ImageList
from recon.sequence.trajectory import Trajectory
from recon.sequence.tum import read_planar, read_tum
from recon.texture import camera_sigmas, refine_poses, texture_faces

EVERY, FIRST = 5, 4
"""Images FIRST, FIRST + EVERY, ... are left out."""


@dataclass(frozen=True)
class HeldOut:
    """A model whose textures know nothing of the images `held`.

    poses: map_from_camera of every image by trajectory, odometry and extrinsics alone, None where it has none: no
    image was used to place the images left out. images, camera: of the sequence.
    """

    model: Model
    images: ImageList
    camera: Camera
    poses: tuple[Pose3 | None, ...]
    held: tuple[int, ...]

    def load(self, index: int) -> NDArray[np.uint8] | None:
        """Image `index`, (H, W, 3) BGR, None when it is corrupt."""
        return load_image(self.images, index, self.camera)


def hold_out(sequence: Path, result: Path) -> HeldOut:
    """The model of a result folder, textured again without every fifth image of its sequence.

    Walls, heights and the calibration stay those of the result. Raises InputError where the sequence has no images, or
    the result no camera or is damaged.
    """
    drive, model = open_sequence(sequence), load_model(result)
    images, camera = drive.images, drive.camera
    if images is None or camera is None:
        raise InputError(f"{sequence}: holds no images, expected some to compare views with")
    if not (result / "camera_trajectory.txt").is_file():
        raise InputError(f"{result}: holds no camera_trajectory.txt, expected a result that was built with images")
    poses, sigmas = _poses(result, images, drive.odometry)
    held = tuple(i for i in range(FIRST, len(images), EVERY) if poses[i] is not None)
    bare = tuple(
        replace(face, texture=None, sources=None, metres_per_texel=0.0, seen_fraction=0.0) for face in model.faces
    )
    kept = [None if i in set(held) else pose for i, pose in enumerate(poses)]
    out = HeldOut(model, images, camera, poses, held)
    config = load_config(result / "config.toml")
    refined = refine_poses(bare, camera, kept, out.load, sigmas, config.workers)
    objects = ObjectPixels.find(model.layout, bare, camera, refined, out.load, config.workers)
    faces = texture_faces(bare, camera, refined, out.load, config.texture, config.workers, objects=objects.of)
    return replace(out, model=replace(model, faces=faces))


def _poses(result: Path, images: ImageList, odometry: Trajectory | None) -> tuple[tuple[Pose3 | None, ...], Array]:
    """Cameras by the trajectory of the platform, None where the result has none; sigmas (N, 2), m and rad."""
    trajectory, mounted = read_planar(result / "trajectory.txt"), read_extrinsics(result / "extrinsics.yaml")
    offset, lag = _clocks(result / "metrics.json")
    times = images.timestamps + offset
    if odometry is not None:
        odometry = Trajectory(odometry.timestamps - lag, odometry.poses)
    platform = poses_between(trajectory, times, odometry)
    known = np.isin(images.timestamps.round(5), read_tum(result / "camera_trajectory.txt")[0].round(5))
    poses = tuple(
        Pose3.from_planar(pose) @ mounted if ok else None for pose, ok in zip(platform.poses, known, strict=True)
    )
    table = read_sigmas(result)
    if len(table) != len(trajectory):
        return poses, platform.sigmas
    return poses, np.hypot(camera_sigmas(table[trajectory.nearest(times), 1:]), platform.sigmas)


def _clocks(path: Path) -> tuple[float, float]:
    """s to add to images' time stamps, and to take off those of the odometry."""
    try:
        metrics = json.loads(read_text(path))
        calibration, clock = metrics["calibration"], metrics.get("odometry_clock")
        return float(calibration["time_offset"]) if calibration else 0.0, float(clock["used"]) if clock else 0.0
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(f"{path}: is damaged ({error!r}), expected what recon build wrote") from None
