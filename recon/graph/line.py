"""Directed lines in the plane with stretches and covariances: what walls and observations have in common."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array, wrap_angle
from recon.graph.observation import WallObservations

FLATNESS = 0.005
"""m: a wall that leaves its straight line by this much is still one wall (plaster, skirting, frames)."""


def carry(covariance: Array, along: Array) -> Array:
    """Covariance (..., 2, 2) of (offset, angle) of a line, moved `along` (...,) metres along it."""
    c00, c01, c11 = covariance[..., 0, 0], covariance[..., 0, 1], covariance[..., 1, 1]
    off = c00 + 2 * along * c01 + along**2 * c11
    return symmetric(off, c01 + along * c11, c11)


def lever(along: Array) -> Array:
    """Matrices (..., 2, 2) that take (offset, angle) of a line to `along` (...,) metres from its origin."""
    out = np.zeros((*along.shape, 2, 2))
    out[..., 0, 0] = out[..., 1, 1] = 1.0
    out[..., 0, 1] = along
    return out


def symmetric(first: Array, mixed: Array, second: Array | float) -> Array:
    """Symmetric matrices (..., 2, 2) from their three entries."""
    out = np.empty((*np.shape(first), 2, 2))
    out[..., 0, 0], out[..., 0, 1], out[..., 1, 0], out[..., 1, 1] = first, mixed, mixed, second
    return out


def squared_distance(offset: Array, angle: Array, covariance: Array) -> Array:
    """Squared Mahalanobis distance (...,) of (offset, angle) for covariances (..., 2, 2)."""
    a, b, c = covariance[..., 0, 0], covariance[..., 0, 1], covariance[..., 1, 1]
    return np.asarray((c * offset**2 - 2 * b * offset * angle + a * angle**2) / (a * c - b * b))


@dataclass(frozen=True)
class Lines:
    """K stretches of directed lines, free space on the left.

    middle: (K, 2) m. angle: (K,) rad. half: (K,) half the length, m. covariance: (K, 2, 2) of (offset m, angle rad)
    at the middle, offset counted towards the free space.
    """

    middle: Array
    angle: Array
    half: Array
    covariance: Array

    def __len__(self) -> int:
        return len(self.angle)

    def __getitem__(self, index: slice | NDArray[np.int64] | NDArray[np.bool_]) -> Lines:
        return Lines(self.middle[index], self.angle[index], self.half[index], self.covariance[index])

    @staticmethod
    def of_observations(observations: WallObservations, poses: Array) -> Lines:
        """Observations in the map frame, seen from `poses` (N, 3)."""
        ends, pose = observations.endpoints, poses[observations.pose]
        delta = ends[:, 1] - ends[:, 0]
        middle = ends.mean(axis=1)
        c, s = np.cos(pose[:, 2]), np.sin(pose[:, 2])
        in_map = np.stack([c * middle[:, 0] - s * middle[:, 1], s * middle[:, 0] + c * middle[:, 1]], axis=1)
        angle = wrap_angle(np.arctan2(delta[:, 1], delta[:, 0]) + pose[:, 2])
        return Lines(in_map + pose[:, :2], angle, np.hypot(*delta.T) / 2, observations.covariance)

    @property
    def direction(self) -> Array:
        """(K, 2) unit vectors along the lines."""
        return np.stack([np.cos(self.angle), np.sin(self.angle)], axis=1)

    @property
    def pose(self) -> Array:
        """(K, 3) map_from_line [x, y, yaw]: x axis along the line, y axis into the free space."""
        return np.column_stack([self.middle, self.angle])

    @staticmethod
    def concatenate(parts: list[Lines]) -> Lines:
        """One after the other."""
        return Lines(
            np.concatenate([p.middle for p in parts]),
            np.concatenate([p.angle for p in parts]),
            np.concatenate([p.half for p in parts]),
            np.concatenate([p.covariance for p in parts]),
        )


@dataclass(frozen=True)
class Difference:
    """How stretches lie to walls; all (K, W) of every one to every other, (K,) of pairs.

    along, offset (m): the stretch's middle in the wall's frame. angle (rad): its direction there.
    gap (m): empty distance along the wall between the two, negative where they overlap.
    """

    along: Array
    offset: Array
    angle: Array
    gap: Array

    @staticmethod
    def between(lines: Lines, walls: Lines) -> Difference:
        """Of every stretch to every wall."""
        return _difference(lines.middle[:, None], lines.angle[:, None], lines.half[:, None], walls)

    @staticmethod
    def paired(lines: Lines, walls: Lines) -> Difference:
        """Of every stretch to the wall of the same row."""
        return _difference(lines.middle, lines.angle, lines.half, walls)


def _difference(middle: Array, direction: Array, half: Array, walls: Lines) -> Difference:
    delta = middle - walls.middle
    c, s = np.cos(walls.angle), np.sin(walls.angle)
    along = delta[..., 0] * c + delta[..., 1] * s
    offset = -delta[..., 0] * s + delta[..., 1] * c
    angle = wrap_angle(direction - walls.angle)
    reach = walls.half + half * np.abs(np.cos(angle))
    return Difference(along, offset, angle, np.abs(along) - reach)
