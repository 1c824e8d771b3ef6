"""Relative motion between consecutive scans."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array
from recon.graph.observation import WallObservations

LEAST = 1e-3
"""Part of a match's information that always stays, so that the chain of poses never breaks."""
STRAY = 1.0
"""m/s: how far from the prediction a platform may be where nothing tells: it does not jump."""
SPEED = 0.5
"""m/s: standard deviation of the speed of a platform that nothing tells; such platforms drive up to 1.5 m/s."""
SAME_SPEED = 5.0
"""s: over gaps up to this between motions that nothing tells the speed is as wrong as before."""
MOST_SPEEDS = 32
"""Stretches of the drive, at most, that have a speed of their own: this bounds what they cost."""


@dataclass(frozen=True)
class Motion:
    """N-1 measured motions between consecutive scans.

    relative: (N-1, 3) pose [x, y, yaw] of the later scan in the platform frame of the earlier one.
    covariance: (N-1, 3, 3) of those numbers, m and rad.
    guessed: (N-1,) bool, motions that nothing tells along one direction: they are predictions.
    unknown: (U, N-1, 2) m, changes of x and y by one standard deviation of numbers that motions share: they err alike.
    """

    relative: Array
    covariance: Array
    guessed: NDArray[np.bool_] | None = None
    unknown: Array = field(default_factory=lambda: np.zeros((0, 0, 2)))

    def __len__(self) -> int:
        return len(self.relative)

    def held(self, timestamps: Array) -> Motion:
        """The motions between scans at `timestamps` (N,), guessed ones held to what platforms can do.

        Along the direction that nothing tells the deviation is STRAY at most, and all motions of a stretch have an
        unknown speed in common: a guess errs the same way for long, which independent motions could not say.
        """
        if self.guessed is None or not self.guessed.any():
            return self
        rows, seconds = np.flatnonzero(self.guessed), np.diff(timestamps)
        values, vectors = np.linalg.eigh(self.covariance[rows, :2, :2])
        vague = vectors[:, :, 1] * np.where(vectors[:, :1, 1] < 0, -1.0, 1.0)  # ahead
        shorter = np.minimum(STRAY * seconds[rows] / np.sqrt(values[:, 1]), 1.0)
        shrink = np.tile(np.eye(3), (len(rows), 1, 1))
        shrink[:, :2, :2] -= (1 - shorter)[:, None, None] * vague[:, :, None] * vague[:, None]
        covariance = self.covariance.copy()
        covariance[rows] = shrink @ covariance[rows] @ shrink.transpose(0, 2, 1)
        stretch = _stretches(timestamps[rows])
        unknown = np.zeros((stretch[-1] + 1, len(self), 2))
        unknown[stretch, rows] = (SPEED * seconds[rows])[:, None] * vague
        return replace(self, covariance=covariance, unknown=unknown)


def _stretches(times: Array) -> NDArray[np.int64]:
    """(n,) numbers of the stretches that times (n,), s, form, ascending."""
    gap = SAME_SPEED
    while True:
        number = np.concatenate([[0], np.cumsum(np.diff(times) > gap)]).astype(np.int64)
        if number[-1] < MOST_SPEEDS:
            return number
        gap *= 2


def sqrt_information(relative: Array, information: Array) -> Array:
    """(N, 3, 3) square roots R, R^T R being the `information` (N, 3, 3) turned into the frame of the measured pose.

    GTSAM takes the error of a between factor in the frame of the measured pose, not in that of the first one.
    """
    c, s = np.cos(relative[:, 2]), np.sin(relative[:, 2])
    turn = np.zeros((len(relative), 3, 3))
    turn[:, 0, 0], turn[:, 0, 1], turn[:, 1, 0], turn[:, 1, 1], turn[:, 2, 2] = c, s, -s, c, 1.0
    turned = turn @ information @ turn.transpose(0, 2, 1)
    return np.asarray(np.linalg.cholesky((turned + turned.transpose(0, 2, 1)) / 2).transpose(0, 2, 1))


def information_beyond_walls(motion: Motion, observations: WallObservations, labels: NDArray[np.int64]) -> Array:
    """(N-1, 3, 3) information of the matches that the wall segments do not hold already.

    A scan match and the segments of its scan come from the same points. What the later scan's segments say of the
    motion, against walls that earlier scans saw, is taken away from the match's information; in coordinates in which
    the match's information is the identity, eigenvalues that become negative are clipped. What stays is what corners,
    clutter and curved surfaces say: the way along a corridor, mostly.
    """
    total = np.asarray(np.linalg.inv(motion.covariance), dtype=np.float64)
    of_walls = np.zeros_like(total)
    rows = _seen_before(observations, labels)
    step = observations.pose[rows] - 1
    np.add.at(of_walls, step, segment_information(motion.relative[step], observations, rows))
    return remaining_information(total, of_walls)


def remaining_information(total: Array, part: Array) -> Array:
    """(..., 3, 3) what is left of the information `total` of a match without `part`, never less than LEAST of it."""
    root = np.linalg.cholesky(total)
    inverse = np.linalg.inv(root)
    values, vectors = np.linalg.eigh(np.eye(3) - inverse @ part @ np.swapaxes(inverse, -1, -2))
    kept = (vectors * np.clip(values, LEAST, 1.0)[..., None, :]) @ np.swapaxes(vectors, -1, -2)
    return np.asarray(root @ kept @ np.swapaxes(root, -1, -2))


def _seen_before(observations: WallObservations, labels: NDArray[np.int64]) -> NDArray[np.int64]:
    """LiDAR segments of walls (label >= 0) that an earlier scan saw too."""
    lidar = np.flatnonzero((labels >= 0) & (observations.image < 0))
    if not len(lidar):
        return lidar
    first = np.full(int(labels.max()) + 1, np.iinfo(np.int64).max)
    np.minimum.at(first, labels[lidar], observations.pose[lidar])
    return lidar[observations.pose[lidar] > first[labels[lidar]]]


def segment_information(relative: Array, observations: WallObservations, rows: NDArray[np.int64]) -> Array:
    """(n, 3, 3) information of segments `rows` (n,) about motions `relative` (n, 3) into their scans, in the frame of
    the earlier pose, where the walls are known there."""
    ends = observations.endpoints[rows]
    delta = ends[:, 1] - ends[:, 0]
    direction = delta / np.linalg.norm(delta, axis=1, keepdims=True)
    angle = np.arctan2(delta[:, 1], delta[:, 0]) + relative[:, 2]
    jacobian = np.zeros((len(rows), 2, 3))
    jacobian[:, 0, 0], jacobian[:, 0, 1] = -np.sin(angle), np.cos(angle)
    jacobian[:, 0, 2] = np.sum(ends.mean(axis=1) * direction, axis=1)
    jacobian[:, 1, 2] = 1.0
    return np.asarray(jacobian.transpose(0, 2, 1) @ np.linalg.inv(observations.covariance[rows]) @ jacobian)
