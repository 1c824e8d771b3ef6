"""Which wall every observed segment belongs to.

Along the drive first: a segment joins the wall line it overlaps and agrees with by Mahalanobis distance, or starts a
new one. Later, with optimised poses and walls, all segments are assigned at once.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array, turned2
from recon.graph.line import FLATNESS, Lines, symmetric
from recon.graph.motion import Motion
from recon.graph.nearest import NONE, nearest_walls
from recon.graph.tracking import track_lines

Ints = NDArray[np.int64]

GATE = 13.8
"""Chi-square with two degrees of freedom, 99.9 %."""
REACH = 0.3
"""m: a segment that ends this close to a wall's stretch still touches it."""
MAX_TURN = 0.35
"""rad: segments further off than this never belong to a wall, however vague their direction."""
MAX_DRIFT = 0.15
"""m: beyond this much drift nearness says nothing about which wall it is."""
MAX_HEADING_DRIFT = 0.05
"""rad: the same for the heading."""


@dataclass(frozen=True)
class Drift:
    """How uncertain poses are to one another, growing along the drive.

    position: (N, 2, 2) m^2, map frame, and heading: (N,) rad^2, summed from the first scan on.
    floor_position (m), floor_heading (rad): uncertainty between neighbouring scans.
    """

    position: Array
    heading: Array
    floor_position: float
    floor_heading: float

    @staticmethod
    def of_motion(motion: Motion, poses: Array) -> Drift:
        """Drift of a chain of measured motions, independent of each other, along `poses` (N, 3)."""
        step = turned2(motion.covariance[:, :2, :2], poses[:-1, 2])
        position = np.concatenate([np.zeros((1, 2, 2)), np.cumsum(step, axis=0)])
        heading = np.concatenate([[0.0], np.cumsum(motion.covariance[:, 2, 2])])
        return Drift(position, heading, 0.01, 0.003)

    @staticmethod
    def solved(scans: int) -> Drift:
        """Drift of an optimised trajectory: the same small uncertainty everywhere."""
        return Drift(np.zeros((scans, 2, 2)), np.zeros(scans), 0.003, 0.001)


def track(lines: Lines, scan: Ints, poses: Array, drift: Drift) -> Ints:
    """Labels (K,) of segments `lines` (map frame) taken in order of `scan` (K,), each the wall it joins or starts."""
    labels = np.full(len(lines), NONE, dtype=np.int64)
    if not len(lines):
        return labels
    order = np.argsort(scan, kind="stable")
    some = lines[order]
    scans, start = np.unique(scan[order], return_index=True)
    lever = np.sum((some.middle - poses[scan[order], :2]) * some.direction, axis=1)
    noise = some.covariance + _pose_covariance(lever, drift.floor_position**2, drift.floor_heading**2)
    labels[order] = track_lines(
        np.column_stack([some.pose, some.half]),
        _rows(some.covariance),
        _rows(noise),
        _rows(flatness(some)),
        np.append(start, len(some)),
        scans,
        np.ascontiguousarray(poses),
        _rows(drift.position),
        np.ascontiguousarray(drift.heading),
        (GATE, REACH, MAX_TURN),
        (MAX_DRIFT**2, MAX_HEADING_DRIFT**2),
    )
    return labels


def _rows(matrices: Array) -> Array:
    """(K, 3) entries [a, b, d] of symmetric (K, 2, 2)."""
    return np.ascontiguousarray(matrices[:, [0, 0, 1], [0, 1, 1]])


def assign(lines: Lines, walls: Lines, poses: Array, scan: Ints) -> Ints:
    """Labels (K,) of segments among known `walls`, NONE where none fits, with optimised `poses` (N, 3)."""
    drift = Drift.solved(len(poses))
    lever = np.sum((lines.middle - poses[scan, :2]) * lines.direction, axis=1)
    pose = _pose_covariance(lever, drift.floor_position**2, drift.floor_heading**2)
    return nearest_walls(lines, lines.covariance + pose + flatness(lines), walls, (GATE, REACH, MAX_TURN))


def flatness(lines: Lines) -> Array:
    """(K, 2, 2) covariance of (offset, angle) of stretches of a wall that is not quite flat."""
    out = np.zeros((len(lines), 2, 2))
    out[:, 0, 0] = FLATNESS**2
    out[:, 1, 1] = (FLATNESS / np.maximum(lines.half, FLATNESS)) ** 2
    return out


def _pose_covariance(lever: Array, across: Array | float, heading: Array | float) -> Array:
    """Covariance (..., 2, 2) of (offset, angle) of a line `lever` m along itself from a pose of that uncertainty."""
    mixed = lever * heading
    return symmetric(across + lever * mixed, mixed, heading)
