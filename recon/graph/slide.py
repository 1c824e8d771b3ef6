"""How far the platform moved between two images along a direction in which the scans are blind.

What the scans do tell, the heading and the way across, is taken from them, and so is where the surfaces are: a corner
on a wall or on the floor is a point in space, and where it is seen in the next image gives the one number that lacks.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from recon.calibration.refine import perturb
from recon.geometry import Array, Pose3, rotation2
from recon.sequence.camera import Camera

SIGMA_PIXEL = 1.0  # corners side by side err alike: more than one alone is off
SIGMA_HEADING = 0.001  # rad, of the scans' turn from image to image
SIGMA_ACROSS = 0.003  # m
MAX_HEIGHT = 2.0  # m: higher up it may be a ceiling
MIN_RANGE, MAX_RANGE = 0.5, 12.0  # m from the camera
OVERHANG = 0.3  # m that a wall goes on beyond the segment seen
MIN_CORNERS = 8
MAX_AWAY = 0.06  # m from the start: farther off it is another's way
MIN_SHARE = 0.3  # of the corners that must agree
ITERATIONS = 10
KERNEL = 3.0  # px, Geman and McClure's


@dataclass(frozen=True)
class Slide:
    """way: m along the direction. sigma: m, of chance alone. change: (6,) by how much the way changes with the camera's
    pose: rotation vector (rad, platform frame) and translation (m). corners: how many agree."""

    way: float
    sigma: float
    change: Array
    corners: int


def on_surfaces(rays: Array, pose: Pose3, segments: Array) -> Array:
    """(N, 3) m, platform frame: where rays (N, 3) of the camera frame meet the floor or a wall, nan where neither.

    segments: (M, 2, 2) m, platform frame, feet of upright walls.
    """
    way = rays @ pose.rotation.T
    centre = pose.translation
    with np.errstate(divide="ignore", invalid="ignore"):
        best = np.where(way[:, 2] < 0, -centre[2] / way[:, 2], np.inf)
        for a, b in segments:
            along = (b - a) / np.linalg.norm(b - a)
            normal = np.array([-along[1], along[0]])
            reach = (normal @ (a - centre[:2])) / (way[:, :2] @ normal)
            place = (centre[:2] + reach[:, None] * way[:, :2] - a) @ along
            hit = (reach > 0) & (place > -OVERHANG) & (place < np.linalg.norm(b - a) + OVERHANG)
            best = np.where(hit & (reach < best), reach, best)
        points = centre + best[:, None] * way
        distance = best * np.linalg.norm(way, axis=1)
        bad = ~((distance > MIN_RANGE) & (distance < MAX_RANGE) & (points[:, 2] < MAX_HEIGHT))
    points[bad] = np.nan
    return points


@dataclass(frozen=True)
class Step:
    """Two images' platform poses but for the way along `direction` (2,), unit, first frame.

    turn: rad. across: m to the left of the direction.
    """

    direction: Array
    turn: float
    across: float

    def relative(self, parameters: Array) -> Array:
        """(3,) pose of the second seen from the first: way (m), and what is added to across (m) and turn (rad)."""
        left = np.array([-self.direction[1], self.direction[0]])
        x, y = parameters[0] * self.direction + (self.across + parameters[1]) * left
        return np.array([x, y, self.turn + parameters[2]])


def project(points: Array, relative: Array, pose: Pose3, camera: Camera) -> Array:
    """(N, 2) px of points (N, 3), first platform frame, in the camera that moved by `relative` (3,)."""
    moved = np.empty_like(points)
    moved[:, :2] = (points[:, :2] - relative[:2]) @ rotation2(float(relative[2]))
    moved[:, 2] = points[:, 2]
    return camera.project(pose.inverse().apply(moved))


def estimate_slide(
    rays: Array, seen: Array, step: Step, start: float, pose: Pose3, camera: Camera, segments: Array
) -> Slide | None:
    """The way from where corners with `rays` (N, 3) in the first image are `seen` (N, 2), px, in the second.

    start: m, nearly the way. Robust least squares over way, across and turn, the latter two held by the scans. None
    where few corners agree.
    """
    points = on_surfaces(rays, pose, segments)
    known = np.isfinite(points[:, 0])
    points, seen, rays = points[known], seen[known], rays[known]
    if len(points) < MIN_CORNERS:
        return None
    parameters, kernel = np.array([start, 0.0, 0.0]), 2 * KERNEL
    prior = np.diag([0.0, SIGMA_ACROSS**-2, SIGMA_HEADING**-2])
    for _ in range(ITERATIONS):
        residual = seen - project(points, step.relative(parameters), pose, camera)
        jacobian = _derivative(points, step, parameters, pose, camera)
        weight = _weights(residual, kernel)
        normal = np.einsum("n,nia,nib->ab", weight, jacobian, jacobian) / SIGMA_PIXEL**2 + prior
        pull = np.einsum("n,nia,ni->a", weight, jacobian, np.nan_to_num(residual)) / SIGMA_PIXEL**2 - prior @ parameters
        parameters = parameters + np.linalg.solve(normal, pull)
        kernel = max(KERNEL, kernel / 2)
    agree = weight > 0.25
    if agree.sum() < max(MIN_CORNERS, MIN_SHARE * len(points)) or abs(parameters[0] - start) > MAX_AWAY:
        return None
    spread = max(1.0, float(np.sum(weight[:, None] * residual**2) / (2 * np.sum(weight))) / SIGMA_PIXEL**2)
    inverse = np.linalg.inv(normal)
    weighted = np.einsum("n,nia->nia", weight, jacobian) / SIGMA_PIXEL**2
    moved = _camera_derivative(rays, seen, step, parameters, pose, camera, segments)
    change = inverse[0] @ np.einsum("nia,nic->ac", weighted, moved)
    return Slide(float(parameters[0]), float(np.sqrt(inverse[0, 0] * spread)), change, int(agree.sum()))


def _weights(residual: Array, kernel: float) -> Array:
    square = np.sum(residual**2, axis=1)
    return np.where(np.isfinite(square), 1 / (1 + np.nan_to_num(square) / kernel**2) ** 2, 0.0)


def _derivative(points: Array, step: Step, parameters: Array, pose: Pose3, camera: Camera) -> Array:
    """(N, 2, 3) px of the projections by way, across and turn."""
    base = project(points, step.relative(parameters), pose, camera)
    columns = [
        (project(points, step.relative(parameters + 1e-5 * axis), pose, camera) - base) / 1e-5 for axis in np.eye(3)
    ]
    return np.nan_to_num(np.stack(columns, axis=2))


def _camera_derivative(
    rays: Array, seen: Array, step: Step, parameters: Array, pose: Pose3, camera: Camera, segments: Array
) -> Array:
    """(N, 2, 6) px by which `seen` minus projection changes with the camera's pose."""
    relative = step.relative(parameters)
    base = project(on_surfaces(rays, pose, segments), relative, pose, camera)
    columns = []
    for axis in np.eye(6):
        moved = perturb(pose, 1e-5 * axis)
        columns.append((base - project(on_surfaces(rays, moved, segments), relative, moved, camera)) / 1e-5)
    return np.nan_to_num(np.stack(columns, axis=2))
