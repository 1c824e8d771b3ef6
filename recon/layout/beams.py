"""Beams aimed at a stretch of wall: those that ended there, went through or never came back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array
from recon.layout.evidence import MAX_RAYS
from recon.model import Wall
from recon.sequence.sequence import Scans
from recon.sequence.trajectory import Trajectory

NEAREST = 0.1
"""m before a wall: from nearer a scanner sees along it."""
REACH = 10.0
"""m; beams of further away lie far apart."""
STEEPEST = 0.3
"""Cosine to the wall's normal, at least: flatter beams carry errors across the wall far along it."""
LOST = 20.0
"""m behind the wall, where beams that never came back ended."""


@dataclass(frozen=True)
class Aimed:
    """Beams (n,) that cross a wall's face from before: where along the wall, m; where they ended, m before its face,
    `-LOST` without return; how far they go along the wall for every metre behind it; the scan of each."""

    along: Array
    across: Array
    slope: Array
    scan: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.along)

    def only(self, chosen: NDArray[np.bool_] | slice) -> Aimed:
        """Those of a mask (n,) or a slice."""
        return Aimed(self.along[chosen], self.across[chosen], self.slope[chosen], self.scan[chosen])


class Beams:
    """All beams of a drive, looked up by the stretch of wall that they are aimed at."""

    def __init__(self, trajectory: Trajectory, scans: Scans) -> None:
        self._trajectory, self._scans = trajectory, scans
        self._used = np.arange(0, len(scans), max(1, int(np.ceil(scans.ranges.size / MAX_RAYS))))
        self._poses = trajectory.at(scans.timestamps[self._used])

    def aimed(self, wall: Wall, low: float, high: float) -> Aimed:
        """The beams that cross the face of a wall from `low` to `high` m along it; invalid ones are left out."""
        offset = self._poses[:, :2] - wall.start
        before, beside = offset @ wall.normal, offset @ wall.direction - (low + high) / 2
        distance = np.hypot(before, beside)
        near = (before > NEAREST) & (distance < REACH) & (before > 0.8 * STEEPEST * distance)
        row, beam = self._between(np.flatnonzero(near), wall.start + np.outer([low, high], wall.direction))
        scan = self._used[row]
        ranges = self._scans.ranges[scan, beam].astype(np.float64)
        with np.errstate(invalid="ignore"):
            known = ranges >= self._scans.range_min  # not where it is nan
        row, beam, scan, ranges = row[known], beam[known], scan[known], ranges[known]
        increment = self._scans.time_increment
        pose = self._trajectory.at(self._scans.timestamps[scan] + increment * beam) if increment else self._poses[row]
        angle = self._scans.angle_min + self._scans.angle_increment * beam + pose[:, 2]
        way = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        inward, onward = -(way @ wall.normal), way @ wall.direction
        steep = inward > STEEPEST
        slope = onward[steep] / inward[steep]
        offset = pose[steep, :2] - wall.start
        before = offset @ wall.normal
        along = offset @ wall.direction + before * slope
        ends = before - ranges[steep] * inward[steep]
        across = np.where(ranges[steep] > self._scans.range_max, -LOST, np.maximum(ends, -LOST))
        return Aimed(along, across, slope, scan[steep]).only((along >= low) & (along <= high))

    def _between(self, rows: NDArray[np.int64], ends: Array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Rows and beams of the poses `rows` that point between two ends (2, 2) m, and a few beside."""
        step = self._scans.angle_increment
        turn = 2 * np.pi / abs(step)
        to = ends[:, None] - self._poses[rows, :2]
        bearing = np.arctan2(to[..., 1], to[..., 0]) - self._poses[rows, 2] - self._scans.angle_min
        one, other = (bearing / step) % turn
        span = (other - one) % turn
        first = np.floor(np.where(span > turn / 2, other, one)).astype(np.int64) - 2
        count = np.ceil(np.minimum(span, turn - span)).astype(np.int64) + 5
        row = np.repeat(rows, count)
        within = np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count)
        beam = (np.repeat(first, count) + within) % round(turn)
        real = beam < self._scans.ranges.shape[1]
        return row[real], beam[real]
