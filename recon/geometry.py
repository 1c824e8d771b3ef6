"""Conventions and rigid transforms.

Units are SI: metres, radians, seconds. Frames (FORMAT.md, ROS REP 103/105):

- platform: the LiDAR frame dropped to the floor; x forward, y left, z up, z = 0 on the floor
- camera: optical frame; x right, y down, z forward
- map: the platform frame at the first scan

Transforms are named `target_from_source`: `map_from_platform` takes platform coordinates to map coordinates.
A planar pose is an array `[x, y, yaw]` of shape (..., 3); a spatial one is a `Pose3`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

TURN_EFFORT = 0.5
"""m/rad: a turn on the spot counts as this way."""
LOOKING_AHEAD: Array = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""(3, 3) platform_from_camera of a level camera that looks forward."""


def wrap_angle(angle: ArrayLike) -> Array:
    """Angle(s) in radians brought into [-pi, pi)."""
    return np.asarray((np.asarray(angle, dtype=np.float64) + np.pi) % (2 * np.pi) - np.pi)


def rotation2(yaw: float) -> Array:
    """(2, 2) rotation matrix, counter-clockwise by `yaw` radians."""
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([[c, -s], [s, c]])


def cross(a: NDArray[np.floating], b: NDArray[np.floating]) -> Array:
    """Vector products (..., 3), shapes broadcast: as `np.cross`, to the bit, which takes longer for few."""
    out = np.empty(np.broadcast_shapes(a.shape, b.shape))
    out[..., 0] = a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1]
    out[..., 1] = a[..., 2] * b[..., 0] - a[..., 0] * b[..., 2]
    out[..., 2] = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return out


def plane_axes(normal: Array, up: tuple[float, float, float] = (1.0, 0.0, 0.0)) -> Array:
    """Right, up and the unit normal (3,) itself of a plane, as rows (3, 3), right-handed.

    Up is as far upwards as the plane allows; of a plane that is level rather than upright, as far along `up`.
    """
    right = np.cross((0.0, 0.0, 1.0) if abs(normal[2]) < 0.7 else up, normal)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(normal, right), normal])


def compose2(a_from_b: ArrayLike, b_from_c: ArrayLike) -> Array:
    """Planar composition: (..., 3) poses a_from_b and b_from_c give a_from_c; shapes broadcast."""
    a, b = np.asarray(a_from_b, dtype=np.float64), np.asarray(b_from_c, dtype=np.float64)
    c, s = np.cos(a[..., 2]), np.sin(a[..., 2])
    x = a[..., 0] + c * b[..., 0] - s * b[..., 1]
    y = a[..., 1] + s * b[..., 0] + c * b[..., 1]
    return np.stack([x, y, wrap_angle(a[..., 2] + b[..., 2])], axis=-1)


def inverse2(a_from_b: ArrayLike) -> Array:
    """Planar inverse: (..., 3) poses a_from_b give b_from_a."""
    a = np.asarray(a_from_b, dtype=np.float64)
    c, s = np.cos(a[..., 2]), np.sin(a[..., 2])
    return np.stack([-c * a[..., 0] - s * a[..., 1], s * a[..., 0] - c * a[..., 1], wrap_angle(-a[..., 2])], axis=-1)


def between2(map_from_a: ArrayLike, map_from_b: ArrayLike) -> Array:
    """Pose of b seen from a: a_from_b, shape (..., 3)."""
    return compose2(inverse2(map_from_a), map_from_b)


def apply2(a_from_b: ArrayLike, points_b: ArrayLike) -> Array:
    """Points (N, 2) of frame b in frame a, for one planar pose (3,)."""
    pose = np.asarray(a_from_b, dtype=np.float64)
    return np.asarray(points_b, dtype=np.float64) @ rotation2(float(pose[2])).T + pose[:2]


def driven2(steps: Array) -> Array:
    """(N,) m driven up to each of N poses, from the N - 1 steps (N - 1, 3) between them; turns count too."""
    effort = np.hypot(steps[:, 0], steps[:, 1]) + TURN_EFFORT * np.abs(steps[:, 2])
    return np.concatenate([[0.0], np.cumsum(effort)])


def turned2(covariances: Array, yaw: Array) -> Array:
    """Covariances (N, 2, 2) of positions in frames that are turned by `yaw` (N,), rad, as seen from outside."""
    c, s = np.cos(yaw), np.sin(yaw)
    turn = np.stack([np.stack([c, -s], -1), np.stack([s, c], -1)], -2)
    return np.asarray(turn @ covariances @ turn.transpose(0, 2, 1))


def cross2(a: Array, b: Array) -> Array:
    """z component of the cross product of planar vectors (..., 2)."""
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def align2(points: ArrayLike, reference: ArrayLike) -> Array:
    """Planar pose (3,) that brings points (N, 2) closest to reference (N, 2) (Umeyama 1991, without scale)."""
    p, q = np.asarray(points, dtype=np.float64), np.asarray(reference, dtype=np.float64)
    a, b = p - p.mean(axis=0), q - q.mean(axis=0)
    yaw = float(np.angle(np.sum((a @ np.array([1, -1j])) * (b @ np.array([1, 1j])))))
    shift = q.mean(axis=0) - apply2([0.0, 0.0, yaw], p.mean(axis=0)[None])[0]
    return np.array([*shift, yaw])


@dataclass(frozen=True)
class Pose3:
    """A rigid transform in space, `target_from_source`.

    rotation: (3, 3), orthonormal, its columns are the source axes in the target frame.
    translation: (3,), m, the source origin in the target frame.
    """

    rotation: Array
    translation: Array

    @staticmethod
    def identity() -> Pose3:
        """The transform that changes nothing."""
        return Pose3(np.eye(3), np.zeros(3))

    @staticmethod
    def from_matrix(matrix: ArrayLike) -> Pose3:
        """From a homogeneous (4, 4) matrix."""
        m = np.asarray(matrix, dtype=np.float64)
        return Pose3(m[:3, :3].copy(), m[:3, 3].copy())

    @staticmethod
    def from_quaternion(translation: ArrayLike, quaternion_xyzw: ArrayLike) -> Pose3:
        """From a translation (3,) and a quaternion (4,) in the order x, y, z, w (normalised here)."""
        x, y, z, w = np.asarray(quaternion_xyzw, dtype=np.float64) / np.linalg.norm(quaternion_xyzw)
        rotation = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
            ]
        )
        return Pose3(rotation, np.asarray(translation, dtype=np.float64))

    @staticmethod
    def from_planar(pose: ArrayLike) -> Pose3:
        """From a planar pose [x, y, yaw] (3,): a turn about z and a move in z = 0."""
        x, y, yaw = np.asarray(pose, dtype=np.float64)
        rotation = np.eye(3)
        rotation[:2, :2] = rotation2(float(yaw))
        return Pose3(rotation, np.array([x, y, 0.0]))

    def __matmul__(self, other: Pose3) -> Pose3:
        """a_from_b @ b_from_c is a_from_c."""
        return Pose3(self.rotation @ other.rotation, self.rotation @ other.translation + self.translation)

    def inverse(self) -> Pose3:
        """source_from_target."""
        return Pose3(self.rotation.T, -self.rotation.T @ self.translation)

    def apply(self, points: ArrayLike) -> Array:
        """Points (..., 3) of the source frame in the target frame."""
        return np.asarray(points, dtype=np.float64) @ self.rotation.T + self.translation

    def matrix(self) -> Array:
        """Homogeneous (4, 4) matrix."""
        m = np.eye(4)
        m[:3, :3], m[:3, 3] = self.rotation, self.translation
        return m

    def quaternion_xyzw(self) -> Array:
        """Unit quaternion (4,) in the order x, y, z, w, with w >= 0."""
        from scipy.spatial.transform import Rotation

        q = np.asarray(Rotation.from_matrix(self.rotation).as_quat(), dtype=np.float64)
        return -q if q[3] < 0 else q


def mounted_camera(position: ArrayLike, yaw: float, tilt: float, roll: float) -> Pose3:
    """platform_from_camera of a camera at `position` (3,) m that looks ahead, then is turned, tilted and rolled.

    yaw to the left, tilt downwards, roll clockwise as seen from behind, rad.
    """
    c, s = np.cos, np.sin
    about_z = np.array([[c(yaw), -s(yaw), 0.0], [s(yaw), c(yaw), 0.0], [0.0, 0.0, 1.0]])
    about_y = np.array([[c(tilt), 0.0, s(tilt)], [0.0, 1.0, 0.0], [-s(tilt), 0.0, c(tilt)]])
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, c(roll), -s(roll)], [0.0, s(roll), c(roll)]])
    return Pose3(about_z @ about_y @ about_x @ LOOKING_AHEAD, np.asarray(position, dtype=np.float64))
