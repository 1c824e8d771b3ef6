"""2D similarity from the ground map to the platform frame (paper 2.3.2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from recon.geometry import Array, Pose3, rotation2, wrap_angle


@dataclass(frozen=True)
class Similarity:
    """platform = scale * R(yaw) * ground + translation; scale is the camera's height above the floor, m."""

    scale: float
    yaw: float
    translation: Array

    def apply(self, points: Array) -> Array:
        """Ground-map points (..., 2) in the platform frame, m."""
        return np.asarray(self.scale * points @ rotation2(self.yaw).T + self.translation)

    def platform_from_camera(self, ground_from_camera: Array) -> Pose3:
        """The camera's pose, with the top-down rotation (3, 3) that made the ground map."""
        turn = np.eye(3)
        turn[:2, :2] = rotation2(self.yaw)
        return Pose3(turn @ ground_from_camera, np.array([*self.translation, self.scale]))


def similarity_from_pairs(ground: Array, lidar: Array) -> Array:
    """Closed form from two pairs of corners (paper eq. 7), for N hypotheses at once.

    ground, lidar: (N, 2, 2), two corresponding points each. Returns (N, 4): scale, yaw, t_x, t_y; scale is inf or nan
    where the two ground points coincide.
    """
    dg, dl = ground[:, 0] - ground[:, 1], lidar[:, 0] - lidar[:, 1]
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = np.hypot(dl[:, 0], dl[:, 1]) / np.hypot(dg[:, 0], dg[:, 1])
        yaw = wrap_angle(np.arctan2(dl[:, 1], dl[:, 0]) - np.arctan2(dg[:, 1], dg[:, 0]))
        mg, ml = ground.mean(axis=1), lidar.mean(axis=1)
        c, s = scale * np.cos(yaw), scale * np.sin(yaw)
        tx = ml[:, 0] - mg[:, 0] * c + mg[:, 1] * s
        ty = ml[:, 1] - mg[:, 0] * s - mg[:, 1] * c
    return np.stack([scale, yaw, tx, ty], axis=1)


def fit_similarity(ground: Array, lidar: Array) -> Similarity:
    """Least-squares similarity over N >= 2 pairs of points (N, 2) (Umeyama 1991, in the plane)."""
    mg, ml = ground.mean(axis=0), lidar.mean(axis=0)
    g, p = (ground - mg) @ [1, 1j], (lidar - ml) @ [1, 1j]
    ratio = np.vdot(g, p) / np.vdot(g, g).real
    scale, yaw = float(abs(ratio)), float(np.angle(ratio))
    return Similarity(scale, yaw, ml - scale * rotation2(yaw) @ mg)
