"""The solved graph as a MapEstimate: stretches, standard deviations, residuals."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array, turned2, wrap_angle
from recon.graph.association import GATE
from recon.graph.estimate import MapEstimate, WallLine
from recon.graph.intervals import supported
from recon.graph.joint import WallCovariance
from recon.graph.line import Difference, Lines, carry
from recon.graph.observation import WallObservations
from recon.graph.optimise import Solution, wall_residuals
from recon.graph.problem import Problem
from recon.graph.residuals import residuals, tape_distances
from recon.model import Source
from recon.sequence.trajectory import Trajectory

Ints = NDArray[np.int64]

LEAST_SIGHTINGS = 3
"""Scans, or images, that must see a wall."""
SHADOW = 0.12
"""m: of two parallel faces closer than this, seen along the same stretch from the same side, one is not there."""
SAME, SAME_TURN = 0.04, 0.03
"""m and rad: nearer still, they are one, seen twice with the scanner's own errors."""


def sightings(labels: Ints, observations: WallObservations, walls: int, scans: int) -> tuple[Ints, Ints]:
    """How many different scans and images (both (W,)) see each wall; observations labelled -1 count for none."""
    counts = []
    for seen, stamp in ((observations.image < 0, observations.pose), (observations.image >= 0, observations.image)):
        rows = np.flatnonzero(seen & (labels >= 0))
        pairs = np.unique(np.stack([labels[rows], stamp[rows]], axis=1), axis=0)
        counts.append(np.bincount(pairs[:, 0], minlength=walls))
    return counts[0], counts[1]


def map_estimate(timestamps: Array, problem: Problem, solution: Solution) -> MapEstimate:
    """What the solution says, walls with too few sightings or no stretch left out."""
    poses = solution.poses
    fits = wall_residuals(problem, solution) <= GATE
    labels = np.where(fits, problem.labels, -1)
    scans, images = sightings(labels, problem.observations, len(solution.walls), len(poses))
    blocks = solution.blocks
    need = min(LEAST_SIGHTINGS, len(poses))
    of_wall = np.split(np.argsort(labels, kind="stable"), np.cumsum(np.bincount(labels + 1, minlength=len(scans) + 1)))
    walls, numbers, middles = [], [], []
    for number in np.flatnonzero((scans >= need) | (images >= LEAST_SIGHTINGS)):
        intervals = _intervals(problem.observations, of_wall[number + 1], poses, solution.walls[number])
        if len(intervals):
            source: Source = "lidar" if scans[number] >= need else "image"
            spread, seen = blocks[len(poses) + number, 1:, 1:], int(scans[number] + images[number])
            walls.append(wall_line(solution.walls[number], spread, intervals, source, seen))
            numbers.append(number)
            middles.append((intervals[0, 0] + intervals[-1, 1]) / 2)
    scale = None if problem.odometry is None else problem.odometry.scale
    whole, by_scan = residuals(problem, solution)
    kept = ~shadowed(walls)
    return MapEstimate(
        Trajectory(np.asarray(timestamps, dtype=np.float64), poses),
        pose_sigmas(poses, blocks[: len(poses)]),
        tuple(wall for wall, stays in zip(walls, kept, strict=True) if stays),
        scale,
        whole,
        tape_distances(problem, solution),
        scan_residuals=by_scan,
        joint=WallCovariance(solution, np.array(numbers, np.int64)[kept], np.array(middles)[kept]),
    )


def _intervals(observations: WallObservations, rows: Ints, poses: Array, wall: Array) -> Array:
    """(K, 2) supported stretches along `wall` (3,)."""
    some = WallObservations(
        observations.pose[rows], observations.endpoints[rows], observations.covariance[rows], observations.image[rows]
    )
    lines = Lines.of_observations(some, poses)
    line = Lines(wall[None, :2], wall[None, 2], np.zeros(1), np.zeros((1, 2, 2)))
    return supported(Difference.between(lines, line).along[:, 0], lines.half, some.image, LEAST_SIGHTINGS)


def wall_line(pose: Array, covariance: Array, intervals: Array, source: Source, seen: int) -> WallLine:
    """The wall with its origin in the middle of its stretches."""
    middle = (intervals[0, 0] + intervals[-1, 1]) / 2
    x, y, yaw = pose
    moved = np.array([x + middle * np.cos(yaw), y + middle * np.sin(yaw), float(wrap_angle(yaw))])
    spread = carry(covariance, np.asarray(middle))
    sigma_offset, sigma_angle = np.sqrt(np.diag(spread))
    return WallLine(moved, intervals - middle, float(sigma_offset), float(sigma_angle), source, seen)


def pose_sigmas(poses: Array, blocks: Array) -> Array:
    """(N, 3) standard deviations of x, y (m, along the map's axes) and yaw (rad), relative to the first pose.

    blocks: (N, 3, 3) covariances of the poses, each in its own frame.
    """
    position = turned2(blocks[:, :2, :2], poses[:, 2])
    variance = np.stack([position[:, 0, 0], position[:, 1, 1], blocks[:, 2, 2]], axis=1)
    return np.sqrt(np.maximum(variance, 0))


def unshadowed(walls: list[WallLine]) -> tuple[WallLine, ...]:
    """Those of the walls that are not `shadowed`."""
    return tuple(wall for wall, gone in zip(walls, shadowed(walls), strict=True) if not gone)


def shadowed(walls: list[WallLine]) -> NDArray[np.bool_]:
    """(W,) walls just before or behind which a wall seen far more often runs along most of their length.

    Of walls that all but coincide the one seen most often stays.
    """
    out = np.zeros(len(walls), np.bool_)
    if not walls:
        return out
    pose, seen = np.array([w.pose for w in walls]), np.array([w.observations for w in walls])
    for number, wall in enumerate(walls):
        turn = np.abs(wrap_angle(wall.pose[2] - pose[:, 2]))
        to = wall.pose[:2] - pose[:, :2]
        offset = np.abs(np.cos(pose[:, 2]) * to[:, 1] - np.sin(pose[:, 2]) * to[:, 0])
        same = (seen > wall.observations) & (turn <= SAME_TURN) & (offset <= SAME)
        beside = np.flatnonzero(same | ((seen > 2 * wall.observations) & (turn <= 0.15) & (offset <= SHADOW)))
        out[number] = any(_covers(walls[k], wall) for k in beside)
    return out


def _covers(other: WallLine, wall: WallLine) -> bool:
    """Whether `other` runs along more than half the length of `wall`."""
    along = float((wall.pose[:2] - other.pose[:2]) @ other.direction)
    low = np.maximum.outer(wall.intervals[:, 0] + along, other.intervals[:, 0])
    high = np.minimum.outer(wall.intervals[:, 1] + along, other.intervals[:, 1])
    length = float(np.diff(wall.intervals, axis=1).sum())
    return bool(np.maximum(high - low, 0).sum() > 0.5 * length)
