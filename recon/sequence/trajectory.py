"""Poses over time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from recon.geometry import Array


@dataclass(frozen=True)
class Trajectory:
    """Planar poses over time: timestamps (N,) increasing, s; poses (N, 3), map_from_platform [x, y, yaw]."""

    timestamps: Array
    poses: Array

    def __len__(self) -> int:
        return len(self.timestamps)

    def at(self, times: ArrayLike) -> Array:
        """Poses (M, 3) at `times` (M,), linear between neighbours, held at the ends."""
        t = np.atleast_1d(np.asarray(times, dtype=np.float64))
        if not len(t):
            return np.zeros((0, 3))
        # only the part around `times`: a few poses of a long drive are asked for again and again
        low = max(int(np.searchsorted(self.timestamps, t.min(initial=np.inf))) - 1, 0)
        part = slice(min(low, len(self) - 1), int(np.searchsorted(self.timestamps, t.max(initial=-np.inf))) + 1)
        stamps, poses = self.timestamps[part], self.poses[part]
        out = np.stack([np.interp(t, stamps, c) for c in (poses[:, 0], poses[:, 1], np.unwrap(poses[:, 2]))], axis=1)
        out[:, 2] = (out[:, 2] + np.pi) % (2 * np.pi) - np.pi
        return out

    def nearest(self, times: ArrayLike) -> NDArray[np.int64]:
        """(M,) index of the pose nearest in time to each of `times` (M,), the later one of two equally near."""
        t = np.atleast_1d(np.asarray(times, dtype=np.float64))
        right = np.clip(np.searchsorted(self.timestamps, t), min(1, len(self) - 1), len(self) - 1)
        left = np.maximum(right - 1, 0)
        return np.where(t - self.timestamps[left] < self.timestamps[right] - t, left, right)
