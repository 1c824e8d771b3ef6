"""Which wall every observed segment belongs to.

Along the drive first: a segment joins the wall line it overlaps and agrees with by Mahalanobis distance, or starts a
new one. Later, with optimised poses and walls, all segments are assigned at once.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array, wrap_angle
from recon.graph.line import FLATNESS, Difference, Lines, carry, squared_distance, symmetric
from recon.graph.motion import Motion
from recon.graph.nearest import NONE, nearest_walls

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
MARGIN = 1.0
"""m: walls that miss the circle around a scan's segments by more are not compared with them."""


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
        yaw = poses[:-1, 2]
        c, s = np.cos(yaw), np.sin(yaw)
        turn = np.stack([np.stack([c, -s], -1), np.stack([s, c], -1)], -2)
        step = turn @ motion.covariance[:, :2, :2] @ turn.transpose(0, 2, 1)
        position = np.concatenate([np.zeros((1, 2, 2)), np.cumsum(step, axis=0)])
        heading = np.concatenate([[0.0], np.cumsum(motion.covariance[:, 2, 2])])
        return Drift(position, heading, 0.01, 0.003)

    @staticmethod
    def solved(scans: int) -> Drift:
        """Drift of an optimised trajectory: the same small uncertainty everywhere."""
        return Drift(np.zeros((scans, 2, 2)), np.zeros(scans), 0.003, 0.001)

    def between(self, scan: int, first: Ints, last: Ints, normals: Array) -> tuple[Array, Array]:
        """Variances (W,) across walls (m^2, along `normals` (W, 2)) and of heading (rad^2), from `scan` to when the
        walls were seen, from scan `first` to `last` (W,)."""
        nearest = np.clip(scan, first, last)
        delta = self.position[scan] - self.position[nearest]
        across = np.abs(np.einsum("wi,wij,wj->w", normals, delta, normals))
        heading = np.abs(self.heading[scan] - self.heading[nearest])
        return np.minimum(across, MAX_DRIFT**2), np.minimum(heading, MAX_HEADING_DRIFT**2)


class WallTable:
    """Wall lines that grow along the drive: an extended Kalman filter for each, on (offset, angle).

    Walls live in the drifting frame of the newest scans: one seen again after a while moves to where it is seen now.
    """

    def __init__(self, capacity: int) -> None:
        self.size = 0
        self._pose = np.zeros((capacity, 3))
        self._covariance = np.zeros((capacity, 2, 2))
        self._half = np.zeros(capacity)
        self._first = np.zeros(capacity, dtype=np.int64)
        self._last = np.zeros(capacity, dtype=np.int64)

    @property
    def lines(self) -> Lines:
        """The walls so far."""
        n = self.size
        return Lines(self._pose[:n, :2], self._pose[:n, 2], self._half[:n], self._covariance[:n])

    def near(self, lines: Lines) -> Ints:
        """Walls that may touch one of the lines."""
        centre = lines.middle.mean(axis=0)
        radius = float((np.linalg.norm(lines.middle - centre, axis=1) + lines.half).max())
        away = self._pose[: self.size, :2] - centre
        return np.flatnonzero(np.hypot(away[:, 0], away[:, 1]) <= self._half[: self.size] + radius + MARGIN)

    def seen(self) -> tuple[Ints, Ints]:
        """First and last scan (W,) that saw each wall."""
        return self._first[: self.size], self._last[: self.size]

    def add(self, lines: Lines, scan: int) -> Ints:
        """New walls, one a segment; returns their labels."""
        rows = slice(self.size, self.size + len(lines))
        self._pose[rows], self._half[rows] = lines.pose, lines.half
        self._covariance[rows] = lines.covariance
        self._first[rows], self._last[rows] = scan, scan
        self.size += len(lines)
        return np.arange(rows.start, rows.stop)

    def update(self, label: int, line: Lines, drift: Array, scan: int) -> None:
        """Fuse one segment. drift: (2, 2) covariance of the wall's drift since it was seen, at the segment's middle."""
        x, y, yaw = self._pose[label]
        c, s = np.cos(yaw), np.sin(yaw)
        dx, dy = line.middle[0] - self._pose[label, :2]
        along, offset, angle = c * dx + s * dy, c * dy - s * dx, wrap_angle(line.angle[0] - yaw)
        low, high = min(-self._half[label], along - line.half[0]), max(self._half[label], along + line.half[0])
        shift = (low + high) / 2  # the wall's origin moves to the middle of its stretch
        back = shift - along
        prior = carry(self._covariance[label], shift) + carry(drift, back)
        gain = prior @ np.linalg.inv(prior + carry(line.covariance[0], back))
        offset, angle = gain @ np.array([offset + back * angle, angle])
        self._pose[label] = x + c * shift - s * offset, y + s * shift + c * offset, yaw + angle
        self._covariance[label] = prior - gain @ prior
        self._half[label] = (high - low) / 2
        self._first[label], self._last[label] = min(self._first[label], scan), max(self._last[label], scan)


def track(lines: Lines, scan: Ints, poses: Array, drift: Drift) -> Ints:
    """Labels (K,) of segments `lines` (map frame) taken in order of `scan` (K,), each the wall it joins or starts."""
    labels = np.full(len(lines), NONE, dtype=np.int64)
    table = WallTable(len(lines))
    order = np.argsort(scan, kind="stable")
    cuts = np.flatnonzero(np.diff(scan[order])) + 1
    for rows in np.split(order, cuts) if len(order) else []:
        labels[rows] = _track_scan(table, lines[rows], int(scan[rows[0]]), poses, drift)
    return labels


def _track_scan(table: WallTable, lines: Lines, scan: int, poses: Array, drift: Drift) -> Ints:
    labels = np.full(len(lines), NONE, dtype=np.int64)
    near = table.near(lines)
    if len(near):
        walls = table.lines[near]
        difference = Difference.between(lines, walls)
        normals = np.stack([-np.sin(walls.angle), np.cos(walls.angle)], axis=1)
        first, last = table.seen()
        across, heading = drift.between(scan, first[near], last[near], normals)
        lever = np.sum((lines.middle - poses[scan, :2]) * lines.direction, axis=1)
        moved = _pose_covariance(lever[:, None], across[None], heading[None])
        noise = lines.covariance + _pose_covariance(lever, drift.floor_position**2, drift.floor_heading**2)
        spread = carry(walls.covariance[None], difference.along) + moved + (noise + flatness(lines))[:, None]
        found = _nearest(difference, spread)
        noisy = replace(lines, covariance=noise)
        for k in np.flatnonzero(found != NONE):
            labels[k] = near[found[k]]
            table.update(int(labels[k]), noisy[k : k + 1], moved[k, found[k]], scan)
    new = labels == NONE
    labels[new] = table.add(lines[new], scan)
    return labels


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


def _nearest(difference: Difference, spread: Array) -> Ints:
    """Label (K,) of the wall with the smallest Mahalanobis distance among those touched, NONE beyond the gate."""
    distance = squared_distance(difference.offset, difference.angle, spread)
    distance[(difference.gap > REACH) | (np.abs(difference.angle) > MAX_TURN)] = np.inf
    best = np.argmin(distance, axis=1)
    return np.where(distance[np.arange(len(best)), best] <= GATE, best, NONE)
