"""The TUM trajectory format: `timestamp x y z qx qy qz qw`, one pose a line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from recon.errors import InputError
from recon.files import atomic_path
from recon.geometry import Array
from recon.sequence.table import check_increasing, read_table
from recon.sequence.trajectory import Trajectory

COLUMNS = "timestamp x y z qx qy qz qw"


def read_tum(path: Path) -> tuple[Array, Array, Array]:
    """Timestamps (N,) s, increasing; positions (N, 3) m; unit quaternions_xyzw (N, 4).

    Raises InputError for a missing or damaged file, no pose at all, time stamps that do not increase, numbers that are
    not finite, and quaternions whose norm is not within 5 % of 1.
    """
    rows = read_table(path, COLUMNS)
    if len(rows) == 0:
        raise InputError(f"{path}: holds no pose, expected lines of {COLUMNS}")
    check_increasing(path, rows[:, 0], "pose")
    bad = np.flatnonzero(~np.isfinite(rows).all(axis=1))
    if len(bad):
        raise InputError(f"{path}: pose {bad[0]} is not finite: {rows[bad[0], 1:].tolist()}")
    norms = np.linalg.norm(rows[:, 4:], axis=1)
    bad = np.flatnonzero(np.abs(norms - 1) > 0.05)
    if len(bad):
        raise InputError(f"{path}: quaternion of pose {bad[0]} has norm {norms[bad[0]]:.4g}, expected 1 (qx qy qz qw)")
    return rows[:, 0].copy(), rows[:, 1:4].copy(), rows[:, 4:] / norms[:, None]


def write_tum(
    path: Path, timestamps: ArrayLike, positions: ArrayLike, quaternions_xyzw: ArrayLike, comment: str = ""
) -> None:
    """Writes timestamps (N,) s, positions (N, 3) m and quaternions_xyzw (N, 4), with `comment` on the first line."""
    lines = tum_lines(timestamps, positions, quaternions_xyzw, comment)
    with atomic_path(path) as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")


def tum_lines(timestamps: ArrayLike, positions: ArrayLike, quaternions_xyzw: ArrayLike, comment: str = "") -> list[str]:
    """The lines of the file that `write_tum` writes."""
    t = np.asarray(timestamps, dtype=np.float64).reshape(-1, 1)
    rows = np.hstack([np.reshape(positions, (-1, 3)), np.reshape(quaternions_xyzw, (-1, 4))]) + 0.0  # no -0.0
    lines = [f"# {comment}: {COLUMNS}" if comment else f"# {COLUMNS}"]
    for stamp, row in zip(t[:, 0], rows, strict=True):
        position, quaternion = " ".join(f"{v:.6f}" for v in row[:3]), " ".join(f"{v:.9f}" for v in row[3:])
        lines.append(f"{stamp:.6f} {position} {quaternion}")
    return lines


def yaw_of_quaternions(quaternions_xyzw: ArrayLike) -> Array:
    """Yaw (N,) in rad of unit quaternions (N, 4): the heading of the x axis seen from above."""
    x, y, z, w = np.moveaxis(np.asarray(quaternions_xyzw, dtype=np.float64), -1, 0)
    return np.asarray(np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))


def read_planar(path: Path) -> Trajectory:
    """A TUM file as planar poses: x, y and the yaw; z, roll and pitch are dropped. Raises as `read_tum`."""
    timestamps, positions, quaternions = read_tum(path)
    return Trajectory(timestamps, np.column_stack([positions[:, :2], yaw_of_quaternions(quaternions)]))


def as_written(trajectory: Trajectory) -> Trajectory:
    """The trajectory as `read_planar` finds it in the file that `write_planar` makes: with the decimals of the text."""
    half = trajectory.poses[:, 2] / 2
    zero = np.zeros(len(trajectory))
    quaternions = np.round(np.column_stack([zero, zero, np.sin(half), np.cos(half)]), 9)
    quaternions /= np.linalg.norm(quaternions, axis=1)[:, None]
    positions = np.round(trajectory.poses[:, :2], 6) + 0.0
    poses = np.column_stack([positions, yaw_of_quaternions(quaternions)])
    return Trajectory(np.round(trajectory.timestamps, 6), poses)


def write_planar(path: Path, trajectory: Trajectory, comment: str = "") -> None:
    """Writes planar poses as a TUM file with z = 0."""
    with atomic_path(path) as temporary:
        temporary.write_text("\n".join(planar_lines(trajectory, comment)) + "\n", encoding="utf-8")


def planar_lines(trajectory: Trajectory, comment: str = "") -> list[str]:
    """The lines of the file that `write_planar` writes."""
    n, half = len(trajectory), trajectory.poses[:, 2] / 2
    zero = np.zeros(n)
    positions = np.column_stack([trajectory.poses[:, :2], zero])
    quaternions = np.column_stack([zero, zero, np.sin(half), np.cos(half)])
    return tum_lines(trajectory.timestamps, positions, quaternions, comment)
