"""Line segments of one scan, and of all scans of a drive."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import overload

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array


@dataclass(frozen=True)
class Segments:
    """M line segments of one scan in the platform frame.

    endpoints: (M, 2, 2) m; walking from the first to the second end the scanner is on the left.
    covariance: (M, 2, 2) of (offset m, angle rad) of the line at the middle of the segment.
    counts: (M,) points behind each. beams: (M, 2) first and last beam (inclusive; the first is the larger one where a
    segment crosses the seam of a full-circle scanner).
    """

    endpoints: Array
    covariance: Array
    counts: NDArray[np.int64]
    beams: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.endpoints)

    def __getitem__(self, index: slice) -> Segments:
        return Segments(self.endpoints[index], self.covariance[index], self.counts[index], self.beams[index])

    @staticmethod
    def concatenate(parts: Sequence[Segments]) -> Segments:
        """One after the other, each in the frame of its own scan."""
        return Segments(
            np.concatenate([np.zeros((0, 2, 2)), *(p.endpoints for p in parts)]),
            np.concatenate([np.zeros((0, 2, 2)), *(p.covariance for p in parts)]),
            np.concatenate([np.zeros(0, np.int64), *(p.counts for p in parts)]),
            np.concatenate([np.zeros((0, 2), np.int64), *(p.beams for p in parts)]),
        )

    @property
    def midpoints(self) -> Array:
        """(M, 2) m."""
        return np.asarray(self.endpoints.mean(axis=1))

    @property
    def lengths(self) -> Array:
        """(M,) m."""
        return np.asarray(np.linalg.norm(self.endpoints[:, 1] - self.endpoints[:, 0], axis=1))

    @property
    def angles(self) -> Array:
        """(M,) rad, direction from the first to the second end."""
        d = self.endpoints[:, 1] - self.endpoints[:, 0]
        return np.asarray(np.arctan2(d[:, 1], d[:, 0]))


@dataclass(frozen=True)
class ScanSegments(Sequence[Segments]):
    """Segments of N scans in one table: a long drive has a hundred thousand scans, each with a few segments.

    table: K segments, each in the platform frame of its scan. start: (N + 1,) first segment of every scan, and K.
    """

    table: Segments
    start: NDArray[np.int64]

    @staticmethod
    def pack(scans: Sequence[Segments]) -> ScanSegments:
        """From the segments of every scan."""
        return ScanSegments(Segments.concatenate(scans), np.cumsum([0, *map(len, scans)], dtype=np.int64))

    def __len__(self) -> int:
        return len(self.start) - 1

    @overload
    def __getitem__(self, scan: int) -> Segments: ...

    @overload
    def __getitem__(self, scan: slice) -> list[Segments]: ...

    def __getitem__(self, scan: int | slice) -> Segments | list[Segments]:
        if isinstance(scan, slice):
            return [self[i] for i in range(len(self))[scan]]
        number = range(len(self))[scan]
        return self.table[self.start[number] : self.start[number + 1]]

    @property
    def scan(self) -> NDArray[np.int64]:
        """(K,) the scan of every segment."""
        return np.repeat(np.arange(len(self)), np.diff(self.start))
