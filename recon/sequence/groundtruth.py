"""groundtruth/ (FORMAT.md): read by evaluation and tests, never by a build."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from recon.errors import InputError
from recon.geometry import Array, Pose3
from recon.layout_file import read_layout
from recon.model import Layout
from recon.sequence.extrinsics import read_extrinsics
from recon.sequence.table import read_table
from recon.sequence.trajectory import Trajectory
from recon.sequence.tum import read_planar, read_tum
from recon.sequence.yaml_file import read_mapping


@dataclass(frozen=True)
class CameraTrajectory:
    """Poses of the camera over time: timestamps (N,) s; map_from_camera, N spatial poses, z above the floor."""

    timestamps: Array
    poses: tuple[Pose3, ...]

    def __len__(self) -> int:
        return len(self.poses)


@dataclass(frozen=True)
class Relations:
    """True relative poses (Kuemmerle et al. 2009): first, second (K,) s; first_from_second (K, 3) [x, y, yaw]."""

    first: Array
    second: Array
    first_from_second: Array


@dataclass(frozen=True)
class GroundTruth:
    """What is known of a sequence; None for what is not. `labels`: the folder of label images."""

    trajectory: Trajectory | None = None
    platform_from_camera: Pose3 | None = None
    camera_trajectory: CameraTrajectory | None = None
    layout: Layout | None = None
    labels: Path | None = None
    relations: Relations | None = None

    def label_path(self, image_name: str) -> Path | None:
        """The label image of an image of images.txt (same stem), None where there is none."""
        if self.labels is None:
            return None
        path = self.labels / f"{Path(image_name).stem}.png"
        return path if path.is_file() else None


def read_groundtruth(sequence: Path) -> GroundTruth:
    """The parts that `sequence/groundtruth/` holds. Raises InputError when it is missing or a part is damaged."""
    folder = Path(sequence) / "groundtruth"
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder, expected the ground truth of the sequence")
    extrinsics, layout, labels = folder / "extrinsics.yaml", folder / "layout.json", folder / "labels"
    trajectory, camera, relations = (folder / f"{n}.txt" for n in ("trajectory", "camera_trajectory", "relations"))
    return GroundTruth(
        trajectory=read_planar(trajectory) if trajectory.exists() else None,
        platform_from_camera=read_extrinsics(extrinsics) if extrinsics.exists() else None,
        camera_trajectory=_read_camera_trajectory(camera, extrinsics) if camera.exists() else None,
        layout=read_layout(layout) if layout.exists() else None,
        labels=labels if labels.is_dir() else None,
        relations=_read_relations(relations) if relations.exists() else None,
    )


def _read_camera_trajectory(path: Path, extrinsics: Path) -> CameraTrajectory:
    """Where the extrinsics are given from the LiDAR, so are these heights: the scanner's is added."""
    timestamps, positions, quaternions = read_tum(path)
    content = read_mapping(extrinsics) if extrinsics.exists() else {}
    if "platform_from_camera" not in content and "lidar_from_camera" in content:
        positions[:, 2] += float(content["lidar_height"])
    poses = (Pose3.from_quaternion(p, q) for p, q in zip(positions, quaternions, strict=True))
    return CameraTrajectory(timestamps, tuple(poses))


def _read_relations(path: Path) -> Relations:
    rows = read_table(path, "t1 t2 x y z roll pitch yaw")
    if len(rows) == 0 or not np.isfinite(rows).all():
        raise InputError(
            f"{path}: holds no relation or numbers that are not finite, expected t1 t2 x y z roll pitch yaw"
        )
    return Relations(rows[:, 0].copy(), rows[:, 1].copy(), rows[:, [2, 3, 7]])
