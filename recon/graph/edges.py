"""Relative measurements between poses that are not neighbours, or are: what closures and chains have in common."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array, between2, wrap_angle

Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


@dataclass(frozen=True)
class Edges:
    """E measurements: the pose `second` seen from the pose `first` (E,), relative (E, 3), covariance (E, 3, 3).

    The covariance is of [x, y, yaw] (m, rad) in the frame of the first pose.
    """

    first: Ints
    second: Ints
    relative: Array
    covariance: Array

    def __len__(self) -> int:
        return len(self.first)

    def __getitem__(self, index: Ints | Bools | slice) -> Edges:
        return Edges(self.first[index], self.second[index], self.relative[index], self.covariance[index])

    @staticmethod
    def concatenate(parts: list[Edges]) -> Edges:
        """One after the other."""
        return Edges(
            np.concatenate([p.first for p in parts]),
            np.concatenate([p.second for p in parts]),
            np.concatenate([p.relative for p in parts]),
            np.concatenate([p.covariance for p in parts]),
        )

    @staticmethod
    def none() -> Edges:
        """No measurement."""
        return Edges(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 3, 3)))

    def residuals(self, poses: Array) -> Array:
        """(E,) squared Mahalanobis distance of the measurements to `poses` (N, 3)."""
        off = between2(poses[self.first], poses[self.second]) - self.relative
        off[:, 2] = wrap_angle(off[:, 2])
        return np.asarray(np.einsum("ei,eij,ej->e", off, np.linalg.inv(self.covariance), off))
