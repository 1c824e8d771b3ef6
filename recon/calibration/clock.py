"""The camera's clock against the scanner's, from turns: headings of vanishing points against headings of the scans.

Cameras on USB and cheap drivers stamp images when they arrive, tenths of a second early or late. While the platform
turns, an image then seems to look elsewhere than it did. How vanishing points turn from image to image does not depend
on where the camera sits, so this comes before the extrinsics, whose search a wrong clock would mislead.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from recon.calibration.topdown import ground_from_camera
from recon.geometry import Array
from recon.sequence.trajectory import Trajectory
from recon.vision.frame import HORIZONTAL_1, HORIZONTAL_2, FrameLines

MAX_OFFSET = 0.35  # s
STEP = 0.005  # s
LONGEST = 3.0  # s between the images of a pair
LAGS = 6  # images between those of a pair, at most
LEAST_HEADING = 0.003  # rad, of one vanishing point
CLIP = 3.0  # standard deviations beyond which a pair says nothing
MIN_PAIRS = 10
SIGNIFICANT = 3.0  # standard deviations
SYSTEMATIC = 0.002  # s: exposures and stamps of scans are no better known


@dataclass(frozen=True)
class ClockOffset:
    """Seconds to add to image stamps to have the scanner's time, and one standard deviation (inf: not observable)."""

    offset: float
    sigma: float

    @property
    def is_significant(self) -> bool:
        """Whether the clocks differ beyond doubt."""
        return abs(self.offset) > SIGNIFICANT * self.sigma


UNKNOWN = ClockOffset(0.0, float("inf"))


def image_headings(lines: Sequence[FrameLines | None], vertical: Array) -> Array:
    """(F,) rad modulo a quarter turn: the camera's heading in its building, nan where no horizontal direction shows."""
    turn = ground_from_camera(vertical)
    out = np.full(len(lines), np.nan)
    for i, frame in enumerate(lines):
        if frame is None:
            continue
        level = frame.directions[[HORIZONTAL_1, HORIZONTAL_2]] @ turn.T
        angle = np.arctan2(level[:, 1], level[:, 0])
        out[i] = -angle[0] if np.isfinite(angle[0]) else -angle[1]
    return out % (np.pi / 2)


def heading_offset(
    lines: Sequence[FrameLines | None], vertical: Array, times: Array, trajectory: Trajectory
) -> ClockOffset:
    """The offset at which vanishing points turn as the platform does, over pairs of images a few seconds apart.

    vertical: unit vector (3,) in the camera frame, pointing down. times: (F,) image stamps, s. UNKNOWN where the
    platform hardly turns or few images show a horizontal direction.
    """
    first, second, turned = _pairs(image_headings(lines, vertical), times)
    if len(first) < MIN_PAIRS or len(trajectory) < 2:
        return UNKNOWN
    yaw = np.unwrap(trajectory.poses[:, 2])
    offsets = np.arange(-MAX_OFFSET, MAX_OFFSET + STEP / 2, STEP)
    at = np.interp(times[:, None] + offsets, trajectory.timestamps, yaw)
    misfit = _quarter(turned[:, None] - (at[second] - at[first]))
    scale = max(LEAST_HEADING, float(np.min(np.median(np.abs(misfit), axis=0))) / 0.6745)
    cost = np.sum(np.minimum((misfit / scale) ** 2, CLIP**2), axis=0)
    best = int(np.argmin(cost))
    if best in (0, len(offsets) - 1):
        return UNKNOWN
    rate = np.gradient(at, STEP, axis=1)[:, best]
    good = np.abs(misfit[:, best]) < CLIP * scale
    # an image takes part in up to 2 LAGS pairs: its error counts that often
    information = float(np.sum((rate[second] - rate[first])[good] ** 2)) / (2 * LAGS * scale**2)
    if information <= 0:
        return UNKNOWN
    left, centre, right = cost[best - 1 : best + 2]
    bend = left - 2 * centre + right
    peak = 0.5 * (left - right) / bend if bend > 0 else 0.0
    return ClockOffset(float(offsets[best] + peak * STEP), float(np.hypot(information**-0.5, STEP)))


def _pairs(headings: Array, times: Array) -> tuple[Array, Array, Array]:
    """First and second image (P,) of pairs, and how far the heading turned between (P,), modulo a quarter turn."""
    seen = np.flatnonzero(np.isfinite(headings))
    first = np.concatenate([seen[:-lag] for lag in range(1, LAGS + 1)])
    second = np.concatenate([seen[lag:] for lag in range(1, LAGS + 1)])
    near = times[second] - times[first] < LONGEST
    first, second = first[near], second[near]
    return first, second, headings[second] - headings[first]


def _quarter(angle: Array) -> Array:
    """Angles (rad) brought into [-pi/4, pi/4) by quarter turns."""
    return np.asarray((angle + np.pi / 4) % (np.pi / 2) - np.pi / 4)
