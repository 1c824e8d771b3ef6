"""Errors of relative poses (Kuemmerle et al., "On measuring the accuracy of SLAM algorithms", Auton. Robots, 2009)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from recon.errors import InputError
from recon.geometry import Array, between2, wrap_angle
from recon.graph.between import along_odometry
from recon.lidar.clock import OdometryClock, odometry_clock
from recon.sequence.groundtruth import Relations
from recon.sequence.trajectory import Trajectory
from recon.sequence.tum import read_planar

AT_END = 1e-3
"""s: stamps this little outside the trajectory are still read."""


@dataclass(frozen=True)
class Spread:
    """Mean and standard deviation of errors and of their squares."""

    mean: float
    deviation: float
    squared_mean: float
    squared_deviation: float

    @staticmethod
    def of(errors: Array) -> Spread:
        """Of errors (K,), K > 0."""
        squared = errors**2
        return Spread(float(errors.mean()), float(errors.std()), float(squared.mean()), float(squared.std()))


@dataclass(frozen=True)
class RelationErrors:
    """translation (m, squares m^2) and rotation (deg, squares deg^2) over the relations `used`.

    `left_out`: relations with a stamp outside the trajectory. clock: of the odometry along which they were read.
    """

    translation: Spread
    rotation: Spread
    used: int
    left_out: int
    clock: OdometryClock | None = None


def relation_errors(trajectory: Trajectory, relations: Relations, odometry: Trajectory | None = None) -> RelationErrors:
    """Errors |trans(delta_est (-) delta_true)| and |rot(...)| of `trajectory` (poses at the scans) against `relations`.

    A stamp between two scans is read along the odometry between them, where it is given. Raises InputError when no
    relation lies within the trajectory.
    """
    translation, rotation, inside = relation_residuals(trajectory, relations, odometry)
    if not inside.any():
        raise InputError(
            f"groundtruth/relations.txt: none of its {len(inside)} relations lies within the trajectory's "
            f"{trajectory.timestamps[0]:.3f} to {trajectory.timestamps[-1]:.3f} s"
        )
    used = int(inside.sum())
    return RelationErrors(
        Spread.of(translation[inside]), Spread.of(np.degrees(rotation[inside])), used, len(inside) - used
    )


def relation_residuals(
    trajectory: Trajectory, relations: Relations, odometry: Trajectory | None = None
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Translational (m) and rotational (rad) error of every relation (K,), and whether the trajectory holds it."""
    low, high = trajectory.timestamps[0] - AT_END, trajectory.timestamps[-1] + AT_END
    first, second = relations.first, relations.second
    inside = (np.minimum(first, second) >= low) & (np.maximum(first, second) <= high)
    estimate = between2(poses_at(trajectory, first, odometry), poses_at(trajectory, second, odometry))
    error = between2(relations.first_from_second, estimate)
    return np.hypot(error[:, 0], error[:, 1]), np.abs(wrap_angle(error[:, 2])), inside


def given_odometry(sequence: Path, trajectory: Trajectory) -> tuple[Trajectory | None, OdometryClock | None]:
    """The odometry of a sequence folder on the clock of its scans, as far as `trajectory` shows that; None without any.

    Nothing of the truth goes into it, which says how its clock lies to the odometry's. Raises InputError for a damaged
    file.
    """
    path = sequence / "odometry.txt"
    if not path.is_file():
        return None, None
    odometry = read_planar(path)
    clock = odometry_clock(trajectory, odometry)
    return clock.on_scan_clock(odometry), clock


def poses_at(trajectory: Trajectory, times: Array, odometry: Trajectory | None = None) -> Array:
    """Poses (M, 3) at `times` (M,) s, held at the ends.

    Between two poses the way is the odometry's, what it misses the later pose by being spread evenly over the gap; a
    straight line where the odometry does not cover the gap.
    """
    straight = trajectory.at(times)
    if odometry is None or len(trajectory) < 2 or len(odometry) < 2:
        return straight
    along, covered = along_odometry(trajectory, times, odometry)
    inside = (times >= trajectory.timestamps[0]) & (times <= trajectory.timestamps[-1])
    return np.where((covered & inside)[:, None], along, straight)
