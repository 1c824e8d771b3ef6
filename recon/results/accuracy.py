"""What a build knows of its own trajectory: pose_sigmas.txt, residuals.txt, loop_closures.txt of the result folder."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from recon.errors import InputError
from recon.geometry import Array
from recon.graph.estimate import MapEstimate
from recon.sequence.table import read_table

SIGMAS, RESIDUALS, CLOSURES = "pose_sigmas.txt", "residuals.txt", "loop_closures.txt"
KINDS = ("lidar", "image", "motion", "odometry")
"""Columns of residuals.txt."""


def write_accuracy(folder: Path, estimate: MapEstimate) -> None:
    """Standard deviations and residuals of every pose, and the time stamps of scans that are one place."""
    stamps = estimate.trajectory.timestamps
    lines = ["# timestamp sigma_x sigma_y sigma_yaw (s, m, m, rad)"]
    lines += [f"{t:.6f} {x:.6f} {y:.6f} {yaw:.7f}" for t, (x, y, yaw) in zip(stamps, estimate.pose_sigmas, strict=True)]
    (folder / SIGMAS).write_text("\n".join(lines) + "\n", encoding="utf-8")
    lines = [f"# timestamp {' '.join(KINDS)} (s, root mean squares in standard deviations)"]
    none = np.full(len(stamps), np.nan)
    columns = np.stack([estimate.scan_residuals.get(kind, none) for kind in KINDS], axis=1)
    lines += [f"{t:.6f} {' '.join(f'{v:.3f}' for v in row)}" for t, row in zip(stamps, columns, strict=True)]
    (folder / RESIDUALS).write_text("\n".join(lines) + "\n", encoding="utf-8")
    lines = ["# t1 t2 (s), time stamps of two scans of one place"]
    lines += [f"{stamps[first]:.6f} {stamps[second]:.6f}" for first, second in estimate.closures]
    (folder / CLOSURES).write_text("\n".join(lines) + "\n", encoding="utf-8")


def read_sigmas(folder: Path) -> Array:
    """(N, 4) time stamps and standard deviations of x, y (m) and yaw (rad); (0, 4) where the folder holds none.

    Raises InputError for a damaged file.
    """
    path = folder / SIGMAS
    rows = read_table(path, "timestamp sigma_x sigma_y sigma_yaw") if path.exists() else np.zeros((0, 4))
    if not np.isfinite(rows).all() or (rows[:, 1:] < 0).any():
        raise InputError(f"{path}: holds a standard deviation that is negative or not finite, expected m, m, rad")
    return rows


def read_scan_residuals(folder: Path) -> dict[str, Array]:
    """Residuals of every scan (N,) by kind, nan where it has none; empty where the folder holds none.

    Raises InputError for a damaged file.
    """
    path = folder / RESIDUALS
    if not path.exists():
        return {}
    rows = read_table(path, f"timestamp {' '.join(KINDS)}")
    return {kind: rows[:, k] for k, kind in enumerate(KINDS, start=1) if np.isfinite(rows[:, k]).any()}


def read_closures(folder: Path) -> Array:
    """(L, 2) time stamps of loop closures; (0, 2) where the folder holds none. Raises InputError for a damaged file."""
    path = folder / CLOSURES
    return read_table(path, "t1 t2") if path.exists() else np.zeros((0, 2))
