"""Scan matching: the platform's trajectory from scans, with odometry or without."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.config import LidarConfig
from recon.geometry import Array, between2, compose2, rotation2, wrap_angle
from recon.lidar.cloud import Cloud, make_cloud
from recon.lidar.icp import Alignment, align
from recon.lidar.localmap import LocalMap, build_map
from recon.lidar.motion import Motion, predict
from recon.lidar.points import scan_points
from recon.sequence.sequence import Scans
from recon.sequence.trajectory import Trajectory


@dataclass(frozen=True)
class ScanMatching:
    """What scan matching gives for N scans.

    trajectory: poses at every scan's timestamp in the map frame (the platform frame at the first scan).
    covariances: (N-1, 3, 3) of each relative motion [x, y, yaw] (m, m, rad) in the frame of the earlier pose.
    failed: (N,) scans that fitted no map: their motion is the prediction, with the prediction's covariance.
    velocities: (N, 3) m/s, m/s, rad/s of the platform in its own frame, to take motion distortion out of scans.
    """

    trajectory: Trajectory
    covariances: Array
    failed: NDArray[np.bool_]
    velocities: Array


KEYFRAME_DISTANCE = 0.3
KEYFRAME_TURN = np.radians(12.0)
NEAR = 12.0
"""m: keyframes farther from the platform are left out of its local map."""
MEMORY = 40.0
"""m driven: older keyframes are left out too, as drift would double their walls."""
MIN_OVERLAP = 0.35
"""Share of a scan's points on the map below which matching failed."""


class _Keyframes:
    """Clouds in the map frame, chosen by motion, and the local map around the newest."""

    def __init__(self, config: LidarConfig) -> None:
        self._config = config
        self._clouds: list[Cloud] = []
        self._poses: list[Array] = []
        self._driven: list[float] = []
        self.map: LocalMap

    def add(self, cloud: Cloud, pose: Array, driven: float) -> None:
        self._clouds.append(cloud.moved(pose))
        self._poses.append(pose)
        self._driven.append(driven)
        poses = np.array(self._poses)
        near = np.hypot(poses[:, 0] - pose[0], poses[:, 1] - pose[1]) < NEAR
        near &= driven - np.array(self._driven) < MEMORY
        self.map = build_map(Cloud.concatenate([self._clouds[i] for i in np.flatnonzero(near)]), pose[:2], self._config)

    def is_due(self, pose: Array) -> bool:
        step = between2(self._poses[-1], pose)
        return bool(np.hypot(step[0], step[1]) > KEYFRAME_DISTANCE or abs(step[2]) > KEYFRAME_TURN)


def match_scans(scans: Scans, odometry: Trajectory | None, config: LidarConfig) -> ScanMatching:
    n = len(scans)
    poses, failed, velocities = np.zeros((n, 3)), np.zeros(n, np.bool_), np.zeros((n, 3))
    covariances = np.zeros((max(n - 1, 0), 3, 3))
    keyframes, driven = _Keyframes(config), 0.0
    keyframes.add(make_cloud(scan_points(scans, 0), config), poses[0], 0.0)
    previous = np.zeros((3, 3))
    noise = max(3.0 * config.range_sigma, 0.02)
    for k in range(1, n):
        start, end = float(scans.timestamps[k - 1]), float(scans.timestamps[k])
        motion = predict(odometry, start, end, velocities[k - 1])
        cloud = make_cloud(scan_points(scans, k), config)
        guess = compose2(poses[k - 1], motion.mean)
        turn = np.eye(3)
        turn[:2, :2] = rotation2(float(poses[k - 1, 2]))
        prior = turn @ np.diag(motion.sigma**-2) @ turn.T
        result = align(cloud, keyframes.map, guess, guess, prior, 0.15, noise)
        poses[k] = result.pose
        step = between2(poses[k - 1], poses[k])
        velocities[k] = step / (end - start)
        driven += float(np.hypot(step[0], step[1]))
        failed[k] = result.overlap < MIN_OVERLAP
        if keyframes.is_due(poses[k]):
            keyframes.add(cloud, poses[k], driven)
    return ScanMatching(Trajectory(scans.timestamps, poses), covariances, failed, velocities)
