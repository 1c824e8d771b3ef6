"""Solving the factor graph."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array, between2, wrap_angle
from recon.graph.covariance import JointCovariance
from recon.graph.line import Lines, squared_distance
from recon.graph.motion import sqrt_information
from recon.graph.odometry import OdometryModel
from recon.graph.problem import Graph, Problem, build

MAX_ITERATIONS = 30
EXPECTED = 2 * (1 - np.exp(-4.5))
"""Mean of chi-square with two degrees of freedom, clipped at 9."""


@dataclass(frozen=True)
class Solution:
    """poses: (N, 3). walls: (W, 3). covariance: of poses, walls and axes, in this order."""

    poses: Array
    walls: Array
    covariance: JointCovariance
    graph: Graph

    def between_walls(self, first: NDArray[np.int64], second: NDArray[np.int64]) -> Array:
        """(P, 2, 2) covariance of the (offset, angle) of walls `first` with those of walls `second`, both (P,)."""
        rest = self.covariance.rest()
        return rest.reshape(len(rest) // 3, 3, len(rest) // 3, 3)[first, 1:, second, 1:]


def optimise(problem: Problem, final: bool) -> Solution:
    """Levenberg-Marquardt from the problem's start; the `final` time with Huber's loss, before with Cauchy's."""
    import gtsam

    graph = build(problem, redescending=not final)
    parameters = gtsam.LevenbergMarquardtParams()
    parameters.setMaxIterations(MAX_ITERATIONS)
    parameters.setRelativeErrorTol(1e-6 if final else 1e-4)
    parameters.setlambdaInitial(1e-6)
    values = gtsam.LevenbergMarquardtOptimizer(graph.factors, graph.initial, parameters).optimize()
    found = gtsam.utilities.extractPose2(values)  # in order of the keys
    poses, walls, _ = np.split(found, [len(problem.poses), len(problem.poses) + len(problem.walls)])
    covariance = JointCovariance(graph.factors.linearize(values), len(poses), graph.variables)
    if problem.odometry is not None:
        covariance.add_unknown(
            _rows(graph, "odometry"), _change_with_scale(problem.odometry), problem.odometry.scale_sigma
        )
    return Solution(poses, walls, covariance, graph)


def _rows(graph: Graph, kind: str) -> NDArray[np.int64]:
    """Rows of the Jacobian that belong to factors of one kind."""
    return np.asarray((3 * graph.rows[kind][:, None] + np.arange(3)).reshape(-1))


def _change_with_scale(odometry: OdometryModel) -> Array:
    """(3n,) by how much the residuals of odometry's factors change with its scale."""
    relative, covariance = odometry.motion.relative[odometry.inside], odometry.motion.covariance[odometry.inside]
    c, s = np.cos(relative[:, 2]), np.sin(relative[:, 2])
    x, y = relative[:, 0] / odometry.scale, relative[:, 1] / odometry.scale
    turned = np.stack([c * x + s * y, c * y - s * x, np.zeros(len(x))], axis=1)
    root = sqrt_information(relative, np.asarray(np.linalg.inv(covariance)))
    return -np.asarray(np.einsum("nij,nj->ni", root, turned)).reshape(-1)


def wall_residuals(problem: Problem, solution: Solution) -> Array:
    """(K,) squared Mahalanobis distance of every observation to its wall."""
    lines = Lines.of_observations(problem.observations, solution.poses)
    wall = solution.walls[problem.labels]
    delta = lines.middle - wall[:, :2]
    offset = -delta[:, 0] * np.sin(wall[:, 2]) + delta[:, 1] * np.cos(wall[:, 2])
    return squared_distance(offset, wrap_angle(lines.angle - wall[:, 2]), lines.covariance)


def variance_factor(problem: Problem, solution: Solution, kind: str) -> float:
    """How much larger the squared errors of "lidar" or "image" observations are than their covariances say.

    The variance component of adjustment theory: squared residuals over the redundancy, robust by clipping at 3 sigma.
    """
    chosen = problem.observations.image >= 0 if kind == "image" else problem.observations.image < 0
    squared = wall_residuals(problem, solution)[chosen]
    redundancy = 2 * len(squared) - solution.covariance.leverage(_rows(solution.graph, kind))
    if redundancy < 20:
        return 1.0
    factor = 1.0
    for _ in range(10):  # the clip moves with the factor
        clipped = np.minimum(squared / factor, 9.0).sum() / EXPECTED * 2 / redundancy
        factor *= float(clipped)
    return float(np.clip(factor, 0.02, 100.0))


def motion_residuals(relative: Array, covariance: Array, poses: Array) -> Array:
    """(N-1,) squared Mahalanobis distance of measured motions to the solved ones."""
    off = between2(poses[:-1], poses[1:]) - relative
    off[:, 2] = wrap_angle(off[:, 2])
    return np.einsum("ni,nij,nj->n", off, np.linalg.inv(covariance), off)
