"""The factor graph: poses, wall lines, building axes, and what ties them together, in GTSAM's native factors.

A wall is a Pose2 whose x axis lies along it, the SPmodel of Castellanos and Tardos ("Mobile Robot Localization and Map
Building", 1999). A segment seen from a pose is a between factor without information along the wall.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array, wrap_angle
from recon.graph.closures import closure_information
from recon.graph.control import Control, control_factors, fitted_frame
from recon.graph.edges import Edges
from recon.graph.line import Lines, carry
from recon.graph.motion import Motion, information_beyond_walls, sqrt_information
from recon.graph.observation import WallObservations
from recon.graph.odometry import OdometryModel
from recon.graph.relations import Axis
from recon.graph.tape import TAPE_ROBUST, Tape, tape_factors, tape_spans

Ints = NDArray[np.int64]

GAUGE_POSITION, GAUGE_HEADING = 1e-5, 1e-6
"""m and rad: how tightly the first pose is held."""
ALONG_SIGMA = 1e-3
"""m: how tightly a wall's origin is held along the wall. Where it lies is a matter of choice, but an origin that slid
would change, to second order, what the segments say across the wall."""
ROBUST = 3.0
"""Normalised residual beyond which a factor loses its hold."""


@dataclass(frozen=True)
class Problem:
    """poses (N, 3) and walls: where the optimisation starts. labels (K,): the wall of every observation, all >= 0.

    repetition: (2,) variances of LiDAR segments' offset and angle count for so many times as much, since segments of
    one wall share errors.
    """

    poses: Array
    motion: Motion
    observations: WallObservations
    labels: Ints
    walls: Lines
    odometry: OdometryModel | None = None
    axes: tuple[Axis, ...] = ()
    tape: Tape | None = None
    closures: Edges = field(default_factory=Edges.none)
    control: Control | None = None
    repetition: Array = field(default_factory=lambda: np.ones(2))


@dataclass(frozen=True)
class Graph:
    """A GTSAM graph and its start. Keys: poses 0..N-1, then walls, axes and the survey's frame, where there is one.

    rows: factor numbers by kind.
    """

    factors: Any
    initial: Any
    rows: dict[str, Ints]
    variables: int


def wall_measurements(lines: Lines, poses: Array, walls: Array) -> tuple[Array, Array]:
    """Walls measured in the platform frame, poses (K, 3) anchored nearest the wall's origin, and the square roots
    (K, 3, 3) of their information.

    lines: observations in the map frame of the current `poses` (K, 3), one a line. walls: (K, 3) the wall of each. The
    segment's covariance is carried from its middle to where the wall's origin is. GTSAM takes the logarithm of the
    error: a move along the wall changes its y by half the angle between segment and wall, whose noise would so hold
    the pose along the wall, by 3 / length^2 a segment. The first column takes that away again.
    """
    delta = walls[:, :2] - lines.middle
    along = np.sum(delta * lines.direction, axis=1)
    anchor = lines.middle + along[:, None] * lines.direction - poses[:, :2]
    c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    x, y = c * anchor[:, 0] + s * anchor[:, 1], -s * anchor[:, 0] + c * anchor[:, 1]
    root = np.zeros((len(lines), 3, 3))
    information = np.linalg.inv(carry(lines.covariance, along))
    root[:, :2, 1:] = np.linalg.cholesky(information).transpose(0, 2, 1)
    root[:, 0, 0] = -root[:, 0, 1] * wrap_angle(walls[:, 2] - lines.angle) / 2
    return np.stack([x, y, lines.angle - poses[:, 2]], axis=1), root


def build(problem: Problem, redescending: bool) -> Graph:
    """The graph; wall factors with a Cauchy loss where `redescending`, else Huber's."""
    import gtsam

    factors, initial, rows = gtsam.NonlinearFactorGraph(), gtsam.Values(), {}
    poses, walls = problem.poses, problem.walls.pose
    for key, pose in enumerate(np.concatenate([poses, walls, _axis_poses(problem)])):
        initial.insert(key, gtsam.Pose2(*pose))
    held = np.diag([1 / GAUGE_POSITION, 1 / GAUGE_POSITION, 1 / GAUGE_HEADING])
    factors.add(gtsam.PriorFactorPose2(0, gtsam.Pose2(*poses[0]), gtsam.noiseModel.Gaussian.SqrtInformation(held)))

    earlier = np.arange(len(poses) - 1)
    information = information_beyond_walls(problem.motion, problem.observations, problem.labels)
    root = sqrt_information(problem.motion.relative, information)
    cauchy, huber = gtsam.noiseModel.mEstimator.Cauchy.Create(ROBUST), gtsam.noiseModel.mEstimator.Huber.Create(ROBUST)
    # the chain must not break: with a loss that lets go, badly associated walls tear poses out of it
    rows["motion"] = _between(factors, earlier, earlier + 1, problem.motion.relative, root, huber)
    if problem.odometry is not None:
        some = np.flatnonzero(problem.odometry.inside)
        relative, covariance = problem.odometry.motion.relative[some], problem.odometry.motion.covariance[some]
        root = sqrt_information(relative, np.asarray(np.linalg.inv(covariance)))
        rows["odometry"] = _between(factors, some, some + 1, relative, root, cauchy)
    if len(problem.closures):
        again = problem.closures
        information = closure_information(again, problem.observations, problem.labels, poses)
        root = sqrt_information(again.relative, information)
        rows["closure"] = _between(factors, again.first, again.second, again.relative, root, cauchy)
    _add_walls(factors, problem, rows, cauchy if redescending else huber)
    _add_axes(factors, problem, rows, cauchy)
    if problem.tape is not None:
        pairs, spans = tape_spans(problem.tape, problem.walls, walls)
        keys, trusted = len(poses) + pairs, gtsam.noiseModel.mEstimator.Huber.Create(TAPE_ROBUST)
        rows["tape"] = _between(factors, keys[:, 0], keys[:, 1], *tape_factors(spans, problem.tape), trusted)
    count = len(poses) + len(walls) + len(problem.axes)
    if problem.control is not None:
        _add_control(factors, initial, problem, rows, count)
        count += 1
    return Graph(factors, initial, rows, count)


def _add_walls(factors: Any, problem: Problem, rows: dict[str, Ints], loss: Any) -> None:
    import gtsam

    observations, labels, walls = problem.observations, problem.labels, problem.walls.pose
    seen_from = problem.poses[observations.pose]
    lines, often = Lines.of_observations(observations, problem.poses), np.sqrt(problem.repetition)
    wider = np.where((observations.image < 0)[:, None, None], often[:, None] * often, 1.0)
    lines = replace(lines, covariance=lines.covariance * wider)
    measured, root = wall_measurements(lines, seen_from, walls[labels])
    for kind, chosen in (("lidar", observations.image < 0), ("image", observations.image >= 0)):
        k = np.flatnonzero(chosen)
        keys = len(problem.poses) + labels[k]
        rows[kind] = _between(factors, observations.pose[k], keys, measured[k], root[k], loss)
    held = gtsam.noiseModel.Gaussian.SqrtInformation(np.diag([1 / ALONG_SIGMA, 0.0, 0.0]), False)
    for number, pose in enumerate(walls):
        factors.add(gtsam.PriorFactorPose2(len(problem.poses) + number, gtsam.Pose2(*pose), held))


def _add_axes(factors: Any, problem: Problem, rows: dict[str, Ints], loss: Any) -> None:
    """Every axis of the building is a Pose2 of which only the direction matters, tied to its walls by quarter turns."""
    import gtsam

    still = gtsam.noiseModel.Gaussian.SqrtInformation(np.diag([1.0, 1.0, 0.0]), False)
    numbers = []
    for number, axis in enumerate(problem.axes):
        key = len(problem.poses) + len(problem.walls) + number
        factors.add(gtsam.PriorFactorPose2(key, gtsam.Pose2(0.0, 0.0, axis.angle), still))
        count = len(axis.members)
        relative = np.stack([np.zeros(count), np.zeros(count), axis.turns * np.pi / 2], axis=1)
        root = np.broadcast_to(np.diag([0.0, 0.0, 1 / axis.scatter]), (count, 3, 3))
        keys = len(problem.poses) + axis.members
        numbers.append(_between(factors, np.full(count, key), keys, relative, root, loss))
    if numbers:
        rows["relation"] = np.concatenate(numbers)


def _add_control(factors: Any, initial: Any, problem: Problem, rows: dict[str, Ints], key: int) -> None:
    """The survey's frame, and a tie from it to the pose of every mark and to both walls of every corner."""
    import gtsam

    control, poses, walls = problem.control, problem.poses, problem.walls.pose
    if control is None:
        return
    pairs = control.landmarks(problem.walls)
    frame = fitted_frame(control, control.places(poses, walls, pairs))
    initial.insert(key, gtsam.Pose2(*frame))
    scans, corners, relative, root = control_factors(control, frame, poses, walls, pairs)
    first = np.concatenate([np.full(len(scans), key), len(poses) + corners])
    second = np.concatenate([scans, np.full(len(corners), key)])
    rows["control"] = _between(factors, first, second, relative, root, None)


def _between(factors: Any, first: Ints, second: Ints, relative: Array, root: Array, loss: Any) -> Ints:
    """Adds one between factor a row, with a `loss` or None; returns their numbers in the graph."""
    from gtsam import BetweenFactorPose2, Pose2, noiseModel

    start, add = factors.size(), factors.add
    gaussian, robust = noiseModel.Gaussian.SqrtInformation, noiseModel.Robust.Create
    for a, b, (x, y, yaw), r in zip(first.tolist(), second.tolist(), relative.tolist(), root, strict=True):
        noise = gaussian(r, False)
        add(BetweenFactorPose2(a, b, Pose2(x, y, yaw), noise if loss is None else robust(loss, noise)))
    return np.arange(start, factors.size())


def _axis_poses(problem: Problem) -> Array:
    return np.array([[0.0, 0.0, axis.angle] for axis in problem.axes]).reshape(-1, 3)
