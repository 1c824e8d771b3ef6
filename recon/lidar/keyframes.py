"""Keyframes: scans whose clouds make up the local map."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np

from recon.config import LidarConfig
from recon.geometry import Array, between2
from recon.lidar.cloud import Cloud
from recon.lidar.localmap import LocalMap, build_map

DISTANCE = 0.3
"""m moved after which a scan becomes a keyframe."""
TURN = np.radians(12.0)
"""rad turned after which a scan becomes a keyframe."""
NEAR = 12.0
"""m: keyframes farther from the platform are left out of its local map."""
MEMORY = 40.0
"""m driven: older keyframes are left out too, as drift would double their walls; loops are closed elsewhere."""


@dataclass(frozen=True)
class _Keyframe:
    """cloud: in the map frame; pose: (3,); driven: m since the first keyframe."""

    cloud: Cloud
    pose: Array
    driven: float


class Keyframes:
    """Clouds in the map frame, and the local map around the newest of them (`map`)."""

    def __init__(self, config: LidarConfig, cloud: Cloud, pose: Array) -> None:
        self._config = config
        self._recent: deque[_Keyframe] = deque()
        self.map: LocalMap
        self.add(cloud, pose)

    def add(self, cloud: Cloud, pose: Array) -> None:
        """A new keyframe: its cloud (platform frame) at its pose (3,)."""
        driven = 0.0
        if self._recent:
            driven = self._recent[-1].driven + float(np.hypot(*(pose[:2] - self._recent[-1].pose[:2])))
        self._recent.append(_Keyframe(cloud.moved(pose), pose.copy(), driven))
        while driven - self._recent[0].driven >= MEMORY:
            self._recent.popleft()
        apart = np.linalg.norm(np.array([k.pose[:2] for k in self._recent]) - pose[:2], axis=1)
        chosen = [k.cloud for k, distance in zip(self._recent, apart, strict=True) if distance < NEAR]
        self.map = build_map(Cloud.concatenate(chosen), pose[:2], self._config)

    def is_due(self, pose: Array) -> bool:
        """Whether the platform at `pose` has moved far enough from the newest keyframe for another."""
        step = between2(self._recent[-1].pose, pose)
        return bool(np.hypot(step[0], step[1]) > DISTANCE or abs(step[2]) > TURN)
