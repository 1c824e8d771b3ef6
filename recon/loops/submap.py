"""Submaps: stretches of consecutive keyframes, short enough that drift inside does not matter."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array, between2, driven2
from recon.lidar.cloud import Cloud
from recon.lidar.clouds import Clouds

Ints = NDArray[np.int64]

KEYFRAME_DISTANCE, KEYFRAME_TURN = 0.2, np.radians(6.0)
"""m or rad moved from one keyframe to the next."""
LENGTH = 4.0
"""m driven within one submap."""


@dataclass(frozen=True)
class Submaps:
    """M stretches of keyframes. scans: (K,) scan of every keyframe; clouds: K.

    first: (M + 1,) first keyframe of every submap, and K. anchor: (M,) keyframe in the middle, whose frame is the
    submap's. driven: (M,) m (turns count too) from the start to the anchor.
    """

    scans: Ints
    clouds: Clouds
    first: Ints
    anchor: Ints
    driven: Array

    def __len__(self) -> int:
        return len(self.anchor)

    @property
    def anchor_scans(self) -> Ints:
        """(M,) scan of every anchor."""
        return self.scans[self.anchor]

    def keyframes(self, number: int, around: int = 0) -> tuple[int, int]:
        """First keyframe of a submap and `around` neighbours on either side, and the one after the last."""
        low, high = max(number - around, 0), min(number + around + 1, len(self))
        return int(self.first[low]), int(self.first[high])

    def cloud(self, number: int, poses: Array, around: int = 0) -> Cloud:
        """Keyframes of a submap and `around` neighbours on either side, in its frame; poses: (N, 3) of all scans."""
        base = poses[self.anchor_scans[number]]
        start, end = self.keyframes(number, around)
        return self.clouds.moved(start, end, between2(base, poses[self.scans[start:end]]))


def choose_keyframes(poses: Array, usable: NDArray[np.bool_]) -> Ints:
    """Scans at which the platform has moved or turned enough since the last one chosen; poses: (N, 3)."""
    chosen: list[int] = []
    for k in np.flatnonzero(usable):
        if chosen:
            step = between2(poses[chosen[-1]], poses[k])
            if np.hypot(step[0], step[1]) < KEYFRAME_DISTANCE and abs(step[2]) < KEYFRAME_TURN:
                continue
        chosen.append(int(k))
    return np.array(chosen, dtype=np.int64)


def make_submaps(scans: Ints, clouds: Clouds, poses: Array) -> Submaps:
    """Of keyframes at `scans` (K,); poses: (N, 3) of all scans."""
    driven = driven2(between2(poses[scans[:-1]], poses[scans[1:]]))
    count = max(1, round(driven[-1] / LENGTH))
    number = np.minimum((driven / max(driven[-1], 1e-9) * count).astype(np.int64), count - 1)
    first = np.concatenate([np.unique(number, return_index=True)[1], [len(scans)]]).astype(np.int64)
    anchor = (first[:-1] + first[1:] - 1) // 2
    return Submaps(scans, clouds, first, anchor, driven[anchor])
