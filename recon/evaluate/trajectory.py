"""Absolute and relative trajectory error, as evo computes them (Sturm et al. 2012; github.com/MichaelGrupp/evo)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.errors import InputError
from recon.geometry import Array, align2, between2, compose2, wrap_angle
from recon.sequence.trajectory import Trajectory

MAX_TIME_DIFFERENCE = 0.01  # s, evo's default


@dataclass(frozen=True)
class TrajectoryErrors:
    """Root mean squares. ate (m) and heading (deg): after the best rigid alignment; rpe: from pose to next pose."""

    poses: int
    ate: float
    ate_max: float
    heading: float
    rpe: float
    rpe_rotation: float


def trajectory_errors(estimate: Trajectory, truth: Trajectory) -> TrajectoryErrors:
    """Errors over poses whose time stamps differ by less than 0.01 s.

    Raises InputError when fewer than two poses have a counterpart.
    """
    mine, theirs = associate(estimate.timestamps, truth.timestamps)
    if len(mine) < 2:
        raise InputError(
            f"groundtruth/trajectory.txt: {len(mine)} of its {len(truth)} poses have a counterpart within "
            f"{MAX_TIME_DIFFERENCE} s, expected at least 2"
        )
    a, b = estimate.poses[mine], truth.poses[theirs]
    moved = compose2(align2(a[:, :2], b[:, :2]), a)
    distance = np.linalg.norm(moved[:, :2] - b[:, :2], axis=1)
    relative = between2(between2(b[:-1], b[1:]), between2(a[:-1], a[1:]))
    return TrajectoryErrors(
        len(mine),
        _rms(distance),
        float(distance.max()),
        float(np.degrees(_rms(wrap_angle(moved[:, 2] - b[:, 2])))),
        _rms(np.linalg.norm(relative[:, :2], axis=1)),
        float(np.degrees(_rms(relative[:, 2]))),
    )


def associate(first: Array, second: Array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Indices into two increasing lists of stamps, nearest to each other, closer than MAX_TIME_DIFFERENCE."""
    nearest = np.clip(np.searchsorted(second, first), 1, max(len(second) - 1, 1))
    left = nearest - 1
    nearest = np.minimum(nearest, len(second) - 1)
    nearest = np.where(np.abs(second[left] - first) <= np.abs(second[nearest] - first), left, nearest)
    ok = np.flatnonzero(np.abs(second[nearest] - first) <= MAX_TIME_DIFFERENCE)
    return ok, nearest[ok]


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
