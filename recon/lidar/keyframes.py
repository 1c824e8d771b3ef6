"""Keyframes: scans whose clouds make up the local map."""

from __future__ import annotations

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


class Keyframes:
    """Clouds in the map frame, and the local map around the newest of them (`map`)."""

    def __init__(self, config: LidarConfig, cloud: Cloud, pose: Array) -> None:
        self._config = config
        self._clouds: list[Cloud] = []
        self._poses: list[Array] = []
        self._driven: list[float] = []
        self.map: LocalMap
        self.add(cloud, pose)

    def add(self, cloud: Cloud, pose: Array) -> None:
        """A new keyframe: its cloud (platform frame) at its pose (3,)."""
        step = np.hypot(*(pose[:2] - self._poses[-1][:2])) if self._poses else 0.0
        self._clouds.append(cloud.moved(pose))
        self._poses.append(pose.copy())
        self._driven.append(float(step) + (self._driven[-1] if self._driven else 0.0))
        apart = np.linalg.norm(np.array(self._poses)[:, :2] - pose[:2], axis=1)
        chosen = np.flatnonzero((apart < NEAR) & (self._driven[-1] - np.array(self._driven) < MEMORY))
        self.map = build_map(Cloud.concatenate([self._clouds[i] for i in chosen]), pose[:2], self._config)

    def is_due(self, pose: Array) -> bool:
        """Whether the platform at `pose` has moved far enough from the newest keyframe for another."""
        step = between2(self._poses[-1], pose)
        return bool(np.hypot(step[0], step[1]) > DISTANCE or abs(step[2]) > TURN)
