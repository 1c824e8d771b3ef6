"""Solving the factor graph."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array, between2, wrap_angle
from recon.graph.covariance import Covariance
from recon.graph.line import Lines, squared_distance
from recon.graph.linear import LinearGraph
from recon.graph.motion import information_beyond_walls, sqrt_information
from recon.graph.odometry import OdometryModel
from recon.graph.problem import Graph, Problem, build
from recon.memory import give_back

Ints = NDArray[np.int64]

MAX_ITERATIONS = 30
SLIDE = 0.5
"""m along a wall from which what was linear at the start no longer is: segments would pull along their walls."""
ROUNDS = 10
REPEATED = 0.05
"""A slide that differs by less than this part of the last one goes to and fro."""
MOST_LAGS = 10
"""Segments of a wall over which their errors are followed."""
LEAST_CORRELATION = 0.05
"""Correlations below are chance."""
LEAST_PAIRS = 100
PROBES = 8
"""Random signs by which leverage is estimated."""
EXPECTED = 2 * (1 - np.exp(-4.5))
"""Mean of chi-square with two degrees of freedom, clipped at 9."""


@dataclass(frozen=True)
class Solution:
    """poses: (N, 3). walls: (W, 3). covariance: of poses, walls, axes and frame, numbered in this order.

    leverage: degrees of freedom that the solution takes from "lidar" and from "image" segments.
    frame: (3,) map_from_survey, the survey counted from the centre of the control points; (0,) without any.
    """

    poses: Array
    walls: Array
    covariance: Covariance
    leverage: dict[str, float]
    frame: Array

    @cached_property
    def blocks(self) -> Array:
        """(N + W, 3, 3) marginal covariances of poses and walls, each in its own frame."""
        return self.covariance.blocks()

    def between_walls(self, first: Ints, second: Ints) -> Array:
        """(P, 2, 2) covariance of the (offset, angle) of walls `first` with those of walls `second`, both (P,)."""
        return self.covariance.between(len(self.poses) + first, len(self.poses) + second)[:, 1:, 1:]


def optimise(problem: Problem, final: bool, rounds: int = ROUNDS, last: float = 0.0) -> Solution:
    """Levenberg-Marquardt from the problem's start; the `final` time with Huber's loss, before with Cauchy's.

    Anew from the solution, up to `rounds` in all, where poses slid along their walls, since factors of walls say
    nothing of that only near the start (`wall_measurements`); no more where they slid as far the `last` time, m.
    """
    import gtsam

    graph = build(problem, redescending=not final)
    give_back()
    values = _minimum(graph, final)
    give_back()
    found = gtsam.utilities.extractPose2(values)  # in order of the keys
    poses, walls, rest = np.split(found, [len(problem.poses), len(problem.poses) + len(problem.walls)])
    slide = _slide(problem, poses, walls)
    if rounds > 1 and slide >= SLIDE and abs(slide - last) > REPEATED * last:
        del graph, values  # before the next one is built
        moved = replace(problem.walls, middle=walls[:, :2], angle=walls[:, 2])
        return optimise(replace(problem, poses=poses, walls=moved), final, rounds - 1, slide)
    linear, rows = LinearGraph(graph.factors.linearize(values), graph.variables), graph.rows
    del graph, values  # large on a long drive, and of no further use
    give_back()
    frame = rest[-1] if problem.control is not None else np.zeros(0)
    return Solution(poses, walls, *_covariance(problem, linear, rows), frame)


def _covariance(problem: Problem, linear: LinearGraph, rows: dict[str, Ints]) -> tuple[Covariance, dict[str, float]]:
    """Of the linearised problem, with what numbers that were estimated apart add, and the segments' leverage."""
    covariance = Covariance(linear)
    if problem.odometry is not None:
        change = _change_with_scale(problem.odometry)[:, None]
        covariance.add_unknown(linear.pull(rows["odometry"], change), problem.odometry.scale_sigma)
    for unknown in _change_with_motions(problem):
        covariance.add_unknown(linear.pull(rows["motion"], unknown[:, None]), 1.0)
    return covariance, {k: covariance.leverage(linear.random_pull(rows[k], PROBES)) for k in ("lidar", "image")}


def _minimum(graph: Graph, final: bool) -> Any:
    import gtsam

    parameters = gtsam.LevenbergMarquardtParams()
    parameters.setMaxIterations(MAX_ITERATIONS)
    parameters.setRelativeErrorTol(1e-6 if final else 1e-4)
    parameters.setlambdaInitial(1e-6)
    return gtsam.LevenbergMarquardtOptimizer(graph.factors, graph.initial, parameters).optimize()


def _slide(problem: Problem, poses: Array, walls: Array) -> float:
    """m: how far a pose has moved along a wall that it sees, at most."""
    if not len(problem.observations):
        return 0.0
    seen_from, labels = problem.observations.pose, problem.labels
    before = problem.walls.pose[labels, :2] - problem.poses[seen_from, :2]
    delta = walls[labels, :2] - poses[seen_from, :2] - before
    angle = walls[labels, 2]
    return float(np.abs(np.cos(angle) * delta[:, 0] + np.sin(angle) * delta[:, 1]).max())


def _change_with_scale(odometry: OdometryModel) -> Array:
    """(3n,) by how much the residuals of odometry's factors change with its scale."""
    relative, covariance = odometry.motion.relative[odometry.inside], odometry.motion.covariance[odometry.inside]
    c, s = np.cos(relative[:, 2]), np.sin(relative[:, 2])
    x, y = relative[:, 0] / odometry.scale, relative[:, 1] / odometry.scale
    turned = np.stack([c * x + s * y, c * y - s * x, np.zeros(len(x))], axis=1)
    root = sqrt_information(relative, np.asarray(np.linalg.inv(covariance)))
    return -np.asarray(np.einsum("nij,nj->ni", root, turned)).reshape(-1)


def _change_with_motions(problem: Problem) -> Iterator[Array]:
    """(3(N-1),) by how much the residuals of scan matches change with each unknown of the motions."""
    if not len(problem.motion.unknown):
        return
    relative = problem.motion.relative
    root = sqrt_information(relative, information_beyond_walls(problem.motion, problem.observations, problem.labels))
    c, s = np.cos(relative[:, 2]), np.sin(relative[:, 2])
    for x, y in problem.motion.unknown.transpose(0, 2, 1):
        turned = np.stack([c * x + s * y, c * y - s * x, np.zeros(len(x))], axis=1)
        yield -np.asarray(np.einsum("nij,nj->ni", root, turned)).reshape(-1)


def _off_walls(problem: Problem, solution: Solution) -> tuple[Array, Lines]:
    """(K, 2) offset (m) and angle (rad) of every observation from its wall, and the observations' lines."""
    lines = Lines.of_observations(problem.observations, solution.poses)
    wall = solution.walls[problem.labels]
    delta = lines.middle - wall[:, :2]
    offset = -delta[:, 0] * np.sin(wall[:, 2]) + delta[:, 1] * np.cos(wall[:, 2])
    return np.stack([offset, wrap_angle(lines.angle - wall[:, 2])], axis=1), lines


def wall_residuals(problem: Problem, solution: Solution) -> Array:
    """(K,) squared Mahalanobis distance of every observation to its wall."""
    off, lines = _off_walls(problem, solution)
    return squared_distance(off[:, 0], off[:, 1], lines.covariance)


def repetition(problem: Problem, solution: Solution) -> Array:
    """(2,) how many LiDAR segments, one after the other on a wall, say the same thing: for offset and for angle.

    A wall that is not quite flat is off the same way in every scan that sees the same stretch of it. The integrated
    autocorrelation of the residuals along the drive, 1 where they are independent, is summed by pairs of lags while
    these are positive (Geyer, "Practical Markov Chain Monte Carlo", 1992).
    """
    off, lines = _off_walls(problem, solution)
    lidar = np.flatnonzero(problem.observations.image < 0)
    order = lidar[np.lexsort((problem.observations.pose[lidar], problem.labels[lidar]))]
    sigma = np.sqrt(np.diagonal(lines.covariance, axis1=1, axis2=2))
    residual, wall = np.clip(off / sigma, -3, 3)[order], problem.labels[order]
    out = np.ones(2)
    for kind in range(2):
        some = residual[:, kind]
        for lag in range(1, MOST_LAGS, 2):
            both = _correlation(some, wall, lag) + _correlation(some, wall, lag + 1)
            if both < 2 * LEAST_CORRELATION:
                break
            out[kind] += 2 * both
    return out


def _correlation(residual: Array, wall: Ints, lag: int) -> float:
    """Of residuals (n,), sorted by wall and time, with those `lag` later on the same wall."""
    same = wall[lag:] == wall[:-lag]
    if same.sum() < LEAST_PAIRS:
        return 0.0
    return float(np.mean((residual[lag:] * residual[:-lag])[same]) / np.mean(residual**2))


def variance_factor(problem: Problem, solution: Solution, kind: str) -> float:
    """How much larger the squared errors of "lidar" or "image" observations are than their covariances say.

    The variance component of adjustment theory: squared residuals over the redundancy, robust by clipping at 3 sigma.
    """
    chosen = problem.observations.image >= 0 if kind == "image" else problem.observations.image < 0
    squared = wall_residuals(problem, solution)[chosen]
    redundancy = 2 * len(squared) - solution.leverage[kind]
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
