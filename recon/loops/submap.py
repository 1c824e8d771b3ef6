"""Submaps: stretches of consecutive keyframes, short enough that drift inside does not matter."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.config import LidarConfig
from recon.geometry import Array, between2, driven2
from recon.lidar.cloud import Cloud
from recon.lidar.clouds import Clouds
from recon.lidar.localmap import LocalMap, build_map
from recon.loops.grid import Pyramid, build_pyramid

Ints = NDArray[np.int64]

KEYFRAME_DISTANCE, KEYFRAME_TURN = 0.2, np.radians(6.0)
"""m or rad moved from one keyframe to the next."""
LENGTH = 4.0
"""m driven within one submap."""
VIEW = 15.0
"""m from its middle that the cloud of a submap reaches when it is searched for in others."""
POINTS = 200
"""Points of a cloud that is searched for."""


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

    def cloud(self, number: int, poses: Array, around: int = 0) -> Cloud:
        """Keyframes of a submap and `around` neighbours on either side, in its frame; poses: (N, 3) of all scans."""
        low, high = max(number - around, 0), min(number + around + 1, len(self))
        base = poses[self.anchor_scans[number]]
        start, end = int(self.first[low]), int(self.first[high])
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


@dataclass(frozen=True)
class Target:
    """A submap that others are matched with, in its own frame."""

    local: LocalMap
    pyramid: Pyramid


def make_target(submaps: Submaps, number: int, poses: Array, config: LidarConfig) -> Target:
    """The submap and its neighbours."""
    local = build_map(submaps.cloud(number, poses, around=1), np.zeros(2), config)
    return Target(local, build_pyramid(local.points))


def make_query(submaps: Submaps, number: int, poses: Array, config: LidarConfig) -> Cloud:
    """The submap alone, as points spread evenly over its surfaces."""
    local = build_map(submaps.cloud(number, poses), np.zeros(2), config)
    near = np.flatnonzero(np.hypot(local.points[:, 0], local.points[:, 1]) < VIEW)
    near = near[np.unique(np.linspace(0, len(near) - 1, min(len(near), POINTS)).astype(np.int64))]
    return Cloud(local.points[near], local.normals[near], local.flat[near], local.information[near])
