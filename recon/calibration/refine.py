"""Joint non-linear refinement of platform_from_camera over all inliers, with its covariance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.calibration.support import CalibrationFrames, Matches, match
from recon.calibration.topdown import ground_from_camera
from recon.geometry import Array, Pose3
from recon.sequence.camera import Camera

SIGMA_PIXEL = 1.0  # of an end of an image line, across it
SIGMA_WALL = 0.012  # m, of a LiDAR segment against the foot that the camera sees
SIGMA_FOOT = 0.01  # m, prior of how far the visible foot (a baseboard) stands in front of what the scanner sees
SIGMA_TIME = 0.3  # s, prior of how late the camera's clock is
MIN_MATCHES = 4

RIGID = np.array([True] * 7 + [False])
RIGID_TIMED = np.array([True] * 8)
SIMILARITY = np.array([False, False, True, True, True, True, False, False])
HEIGHT = np.array([False] * 5 + [True] + [False] * 2)
"""Which of roll, pitch, yaw (rad, about the platform axes), x, y, z (m), foot offset (m) and time offset (s) are
free."""


@dataclass(frozen=True)
class Refinement:
    """A refined pose, its covariance (6, 6) (rotation vector in the platform frame, translation) and matches.

    time_offset, sigma_time: s, to add to image stamps; sigma 0 where it was held.
    """

    platform_from_camera: Pose3
    foot_offset: float
    time_offset: float
    sigma_time: float
    covariance: Array
    matches: Matches
    rms: float


def perturb(pose: Pose3, delta: Array) -> Pose3:
    """Turn by the rotation vector delta[:3] in the target frame, move by delta[3:6]."""
    from scipy.spatial.transform import Rotation

    return Pose3(Rotation.from_rotvec(delta[:3]).as_matrix() @ pose.rotation, pose.translation + delta[3:6])


def foot_distances(camera: Camera, pose: Pose3, feet: Array, pixels: Array, offset: float | Array = 0.0) -> Array:
    """Signed distances (N, 2), pixels, of the points (N, 2, 2) from the projected foot lines.

    feet: (N, 2, 2) m, platform frame. offset: m, how far the foot stands in front of the line (to its left).
    """
    d = feet[:, 1] - feet[:, 0]
    d = d / np.linalg.norm(d, axis=1, keepdims=True)
    normal = np.stack([-d[:, 1], d[:, 0]], axis=1)
    point = feet[:, 0] + np.asarray(offset) * normal
    a = np.concatenate([point, np.zeros((len(feet), 1))], axis=1) - pose.translation
    b = np.concatenate([d, np.zeros((len(feet), 1))], axis=1)
    plane = np.cross(a, b) @ pose.rotation  # of the camera's centre and the foot, in the camera frame
    line = plane @ np.linalg.inv(camera.matrix)
    line = line / np.linalg.norm(line[:, :2], axis=1, keepdims=True)
    return np.asarray(np.einsum("nij,nj->ni", pixels, line[:, :2]) + line[:, 2:])


def foot_sigmas(camera: Camera, pose: Pose3, feet: Array, pixels: Array) -> Array:
    """Standard deviations (N, 2), pixels, of `foot_distances`: image noise and the wall's own, seen in the image."""
    shift = foot_distances(camera, pose, feet, pixels, SIGMA_WALL) - foot_distances(camera, pose, feet, pixels)
    return np.asarray(np.hypot(SIGMA_PIXEL, shift))


def _vertical_residual(pose: Pose3, vertical: Array, sigma: float) -> Array:
    """How far the pose's down direction lies from the measured vertical, normalised (2,)."""
    return np.asarray((ground_from_camera(vertical) @ pose.rotation.T)[:2, 2] / sigma)


def refine(
    frames: CalibrationFrames,
    camera: Camera,
    pose: Pose3,
    vertical: tuple[Array, float],
    tolerances: tuple[float, ...],
    free: NDArray[np.bool_] = RIGID,
    which: NDArray[np.int64] | None = None,
    twists: Array | None = None,
) -> Refinement | None:
    """Minimise the distances of matched image lines to projected wall feet by iteratively reweighted least squares.

    Lines are matched anew at each of the tolerances (pixels) and weighted by Tukey's biweight, so that lines beside
    the foot (a baseboard's upper edge, a floor border) do not pull. vertical: unit vector (3,) in the camera frame,
    pointing down, and its sigma (rad). twists: (F, 3) m/s, m/s, rad/s of the platform in its own frame at each image,
    needed where the time offset is free. Returns None where too few lines match. Covariance: Gauss-Newton, scaled by
    the residuals where they exceed what was expected.
    """
    state = _State(pose, 0.0, 0.0)
    system, matches = None, None
    for tolerance in tolerances:
        matches = match(frames, camera, state.pose, tolerance, which)
        if len(matches) < MIN_MATCHES:
            return None
        feet = _Feet(frames.segments[matches.segment], None if twists is None else twists[matches.frame])
        system = _normal_equations(state, camera, feet, matches.pixels, vertical, tolerance, free)
        step = np.zeros(8)
        step[free] = np.linalg.lstsq(system.information, system.gradient, rcond=1e-12)[0]
        state = state.moved(step)
    assert system is not None and matches is not None
    covariance = np.zeros((8, 8))
    covariance[np.ix_(free, free)] = np.linalg.pinv(system.information) * max(1.0, system.rms**2)
    sigma_time = float(np.sqrt(covariance[7, 7]))
    return Refinement(state.pose, state.offset, state.time, sigma_time, covariance[:6, :6], matches, system.rms)


@dataclass(frozen=True)
class _State:
    pose: Pose3
    offset: float
    time: float

    def moved(self, delta: Array) -> _State:
        """By delta (8,)."""
        return _State(perturb(self.pose, delta), self.offset + float(delta[6]), self.time + float(delta[7]))


@dataclass(frozen=True)
class _Feet:
    """Wall feet (N, 2, 2), m, platform frame at the images' stamps, and how the platform moves then (N, 3)."""

    ends: Array
    twists: Array | None

    def after(self, seconds: float) -> Array:
        """The feet in the platform frame that much later: what stands still moves against the platform."""
        if self.twists is None:
            return self.ends
        x, y, turn = (self.twists[:, k, None] for k in range(3))
        velocity = np.stack([x - turn * self.ends[..., 1], y + turn * self.ends[..., 0]], axis=-1)
        return np.asarray(self.ends - seconds * velocity)


@dataclass(frozen=True)
class _System:
    """Gauss-Newton system of the free parameters, and the weighted rms of the normalised distances."""

    information: Array
    gradient: Array
    rms: float


def _normal_equations(
    state: _State,
    camera: Camera,
    feet: _Feet,
    pixels: Array,
    vertical: tuple[Array, float],
    tolerance: float,
    free: NDArray[np.bool_],
) -> _System:
    """One weighted linearization, by forward differences."""
    sigma = foot_sigmas(camera, state.pose, feet.after(state.time), pixels)

    def residuals(delta: Array) -> tuple[Array, Array]:
        at = state.moved(delta)
        distance = foot_distances(camera, at.pose, feet.after(at.time), pixels, at.offset) / sigma
        prior = [*_vertical_residual(at.pose, *vertical), at.offset / SIGMA_FOOT, at.time / SIGMA_TIME]
        return distance.ravel(), np.array(prior)

    distance, prior = residuals(np.zeros(8))
    worst = np.abs(distance.reshape(-1, 2) * sigma).max(axis=1) / tolerance
    weight = np.repeat(np.clip(1 - worst**2, 0, None) ** 2, 2)
    columns = []
    for axis in np.flatnonzero(free):
        delta = np.zeros(8)
        delta[axis] = 1e-6
        d, p = residuals(delta)
        columns.append(np.concatenate([d - distance, p - prior]) / 1e-6)
    jacobian = np.stack(columns, axis=1)
    weights = np.concatenate([weight, np.ones(len(prior))])
    residual = np.concatenate([distance, prior])
    information = (jacobian * weights[:, None]).T @ jacobian
    gradient = -(jacobian * weights[:, None]).T @ residual
    rms = float(np.sqrt(np.sum(weight * distance**2) / max(np.sum(weight), 1e-9)))
    return _System(information, gradient, rms)
