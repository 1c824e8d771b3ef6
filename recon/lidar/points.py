"""Returns of one scan as points in the platform frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array
from recon.sequence.sequence import Scans


@dataclass(frozen=True)
class ScanPoints:
    """Valid returns of one scan, counter-clockwise.

    xy: (n, 2) m, platform frame at the scan's timestamp. steps: (n,) beams counted counter-clockwise; they go on
    past the last beam where a full-circle scanner closes. beams: (n,) index into the scan's ranges. step: rad.
    """

    xy: Array
    steps: NDArray[np.int64]
    beams: NDArray[np.int64]
    step: float


def scan_points(scans: Scans, index: int, velocity: Array | None = None) -> ScanPoints:
    """The valid returns of scan `index`, without motion distortion where `velocity` is given.

    velocity: (3,) m/s, m/s, rad/s of the platform in its own frame during the scan; used with `time_increment`.
    """
    beams = np.flatnonzero(scans.valid(index))
    ranges = scans.ranges[index, beams].astype(np.float64)
    bearings = scans.angle_min + scans.angle_increment * beams
    xy = np.stack([ranges * np.cos(bearings), ranges * np.sin(bearings)], axis=1)
    if velocity is not None and scans.time_increment > 0:
        xy = carry(xy, scans.time_increment * beams.astype(np.float64), velocity)
    count, step = scans.ranges.shape[1], abs(float(scans.angle_increment))
    steps = beams.copy()
    if scans.angle_increment < 0:
        xy, beams, steps = xy[::-1], beams[::-1], count - 1 - beams[::-1]
    if len(beams) > 1 and count * step > 2 * np.pi - 1.5 * step:
        start = _widest_jump(xy, steps, count)
        xy, beams = np.roll(xy, -start, axis=0), np.roll(beams, -start)
        steps = np.concatenate([steps[start:], steps[:start] + count])
    return ScanPoints(np.ascontiguousarray(xy), np.ascontiguousarray(steps), np.ascontiguousarray(beams), step)


def carry(xy: Array, times: Array, velocity: Array) -> Array:
    """Points (n, 2) seen `times` (n,) s after the scan's timestamp, in the platform frame at the timestamp."""
    yaw = velocity[2] * times
    # chord of the arc driven since: exact for constant velocity in the platform frame
    half = 0.5 * yaw
    chord = np.sinc(half / np.pi) * times
    dx = chord * (np.cos(half) * velocity[0] - np.sin(half) * velocity[1])
    dy = chord * (np.sin(half) * velocity[0] + np.cos(half) * velocity[1])
    c, s = np.cos(yaw), np.sin(yaw)
    return np.stack([c * xy[:, 0] - s * xy[:, 1] + dx, s * xy[:, 0] + c * xy[:, 1] + dy], axis=1)


def _widest_jump(xy: Array, steps: NDArray[np.int64], count: int) -> int:
    """Where to cut the full circle open: the point after the longest run without returns, else the longest jump."""
    gaps = np.diff(steps, prepend=steps[-1] - count)
    jumps = np.linalg.norm(xy - np.roll(xy, 1, axis=0), axis=1)
    return int(np.lexsort((jumps, gaps))[-1])
