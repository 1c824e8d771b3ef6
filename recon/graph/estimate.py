"""What the factor graph gives."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array
from recon.graph.joint import WallCovariance
from recon.lidar.clock import OdometryClock
from recon.model import Source
from recon.sequence.trajectory import Trajectory


@dataclass(frozen=True)
class WallLine:
    """An optimised wall line and the stretches of it that were seen.

    pose: (3,) map_from_wall [x, y, yaw]: x axis along the wall, y axis into the free space (to the left).
    intervals: (K, 2) m, sorted and disjoint stretches along the x axis that observations support.
    sigma_offset (m), sigma_angle (rad): one standard deviation at the wall's origin, across and of its direction.
    """

    pose: Array
    intervals: Array
    sigma_offset: float
    sigma_angle: float
    source: Source
    observations: int

    @property
    def direction(self) -> Array:
        """Unit vector (2,) along the wall."""
        return np.array([np.cos(self.pose[2]), np.sin(self.pose[2])])

    @property
    def normal(self) -> Array:
        """Unit vector (2,) into the free space."""
        return np.array([-np.sin(self.pose[2]), np.cos(self.pose[2])])


@dataclass(frozen=True)
class Survey:
    """The map in the frame of a survey, and K control points.

    survey_from_map: (3,) planar pose [x, y, yaw]. sigma: (3,) one standard deviation of where the map lies, x and y at
    the points' centre (m) and yaw (rad). solved: (K, 2) m, the points as the model has them, survey frame. kept: (K,)
    points that the solution keeps to; the others contradict it. off: (K,) how far each was from what the map and the
    other points said before, standard deviations.
    """

    survey_from_map: Array
    sigma: Array
    solved: Array
    kept: NDArray[np.bool_]
    off: Array


@dataclass(frozen=True)
class MapEstimate:
    """Poses at every scan, wall lines, and how sure they are.

    pose_sigmas: (N, 3) one standard deviation of x, y (m) and yaw (rad), relative to the first pose.
    odometry_scale: estimated factor true / reported of the given odometry's distances, None without odometry.
    residuals: root mean square of normalised residuals by kind of factor (1 = as expected).
    scan_residuals: the same of every scan (N,), nan where it has no factor of the kind.
    tape: (T,) m, solved distances between the walls that were measured by hand.
    survey: how map and surveyed control points fit, None without any.
    odometry_clock: the lag of the given odometry behind the scans, None without odometry.
    closures: (L, 2) scans that are one place visited again, as far as loop closure found and kept them.
    joint: covariances between the walls, None where only their own are known.
    """

    trajectory: Trajectory
    pose_sigmas: Array
    walls: tuple[WallLine, ...]
    odometry_scale: float | None = None
    residuals: dict[str, float] = field(default_factory=dict)
    tape: Array = field(default_factory=lambda: np.zeros(0))
    survey: Survey | None = None
    scan_residuals: dict[str, Array] = field(default_factory=dict)
    odometry_clock: OdometryClock | None = None
    closures: NDArray[np.int64] = field(default_factory=lambda: np.zeros((0, 2), dtype=np.int64))
    joint: WallCovariance | None = None
