"""Ground-wall boundary lines of images as observations of walls."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from recon.calibration.result import Calibration
from recon.geometry import Array, apply2, between2
from recon.graph.observation import WallObservations
from recon.sequence.camera import Camera
from recon.sequence.sequence import Scans
from recon.sequence.trajectory import Trajectory
from recon.vision.frame import HORIZONTAL_1, HORIZONTAL_2, FrameLines

SIGMA_PIXEL = 1.0
SIGMA_OFFSET = 0.015  # m, what calibration, baseboards and swaying add to every image's lines
SIGMA_ANGLE = 0.008  # rad
BEYOND = 0.9  # of the scanner's range: nearer walls are the scanner's to see
MAX_BEYOND = 2.5  # of the scanner's range
OPEN_SHARE = 0.8  # of the beams towards a line that return nothing
MIN_PIXELS = 30.0
MAX_SIGMA = 0.15  # m: farther lines may as well be a baseboard's edge, which stands metres behind the foot there


def boundary_observations(
    frames: Sequence[FrameLines | None],
    times: Array,
    camera: Camera,
    calibration: Calibration,
    scans: Scans,
    trajectory: Trajectory,
) -> WallObservations:
    """Lines on the floor beyond the scanner's reach, from images, in the platform frame of the nearest scan.

    The paper's end wall: the farthest line below the horizon in directions in which the scanner sees nothing within
    its range. What the scanner sees it measures better; lines on the floor in free space are no walls.
    """
    parts = []
    nearest = trajectory.nearest(times)
    platform_from_image = between2(trajectory.poses[nearest], trajectory.at(times))
    for i, frame in enumerate(frames):
        if frame is None or not len(frame.boundary):
            continue
        rows = frame.boundary[np.isin(frame.labels[frame.boundary], (HORIZONTAL_1, HORIZONTAL_2))]
        rows = rows[frame.lengths[rows] > MIN_PIXELS]
        ends = _on_floor(frame.endpoints[rows], camera, calibration)
        keep = _beyond(ends, platform_from_image[i], scans, int(nearest[i]))
        if not keep.any():
            continue
        ends, pixels = _with_sensor_left(ends[keep]), frame.endpoints[rows][keep]
        covariance = _covariance(pixels, camera, calibration)
        sharp = covariance[:, 0, 0] < MAX_SIGMA**2
        ends, covariance = ends[sharp], covariance[sharp]
        moved = apply2(platform_from_image[i], ends.reshape(-1, 2)).reshape(-1, 2, 2)
        count = len(moved)
        parts.append(WallObservations(np.full(count, nearest[i]), moved, covariance, np.full(count, i)))
    empty = np.zeros(0, np.int64)
    return WallObservations.concatenate(
        [WallObservations(empty, np.zeros((0, 2, 2)), np.zeros((0, 2, 2)), empty), *parts]
    )


def _on_floor(pixels: Array, camera: Camera, calibration: Calibration) -> Array:
    """Rectified pixels (..., 2) on the floor (..., 2), m, platform frame; nan at and above the horizon."""
    pose = calibration.platform_from_camera
    rays = np.concatenate([pixels, np.ones((*pixels.shape[:-1], 1))], axis=-1) @ np.linalg.inv(camera.matrix).T
    rays = rays @ pose.rotation.T
    down = np.where(rays[..., 2:] < -1e-6, -rays[..., 2:], np.nan)
    return np.asarray(pose.translation[:2] + rays[..., :2] / down * pose.translation[2])


def _beyond(ends: Array, platform_from_image: Array, scans: Scans, scan: int) -> NDArray[np.bool_]:
    """(N,) lines (N, 2, 2) that lie beyond the scanner's range, where its beams return nothing."""
    if len(ends) == 0:
        return np.zeros(0, np.bool_)
    moved = apply2(platform_from_image, ends.reshape(-1, 2)).reshape(-1, 2, 2)
    distance = np.linalg.norm(moved, axis=2)
    with np.errstate(invalid="ignore"):
        far = (distance > BEYOND * scans.range_max).all(axis=1) & (distance < MAX_BEYOND * scans.range_max).all(axis=1)
    silent = ~scans.valid(scan)
    bearings = scans.bearings
    for k in np.flatnonzero(far):
        a, b = np.arctan2(moved[k, :, 1], moved[k, :, 0])
        width = (b - a + np.pi) % (2 * np.pi) - np.pi
        start, width = (a, width) if width >= 0 else (b, -width)
        between = (bearings - start) % (2 * np.pi) <= width
        far[k] = between.any() and np.mean(silent[between]) >= OPEN_SHARE
    nearer = np.min(distance, axis=1)
    farthest = np.max(nearer[far], initial=0.0)  # the paper: the furthest line below the horizon
    return np.asarray(far & (nearer > farthest - 0.5))


def _with_sensor_left(ends: Array) -> Array:
    """Segments (N, 2, 2) turned so that the platform lies to their left."""
    cross = ends[:, 0, 0] * ends[:, 1, 1] - ends[:, 0, 1] * ends[:, 1, 0]
    return np.where((cross < 0)[:, None, None], ends[:, ::-1], ends)


def _covariance(pixels: Array, camera: Camera, calibration: Calibration) -> Array:
    """(N, 2, 2) of offset (m) and angle (rad) at the middle, from noise of both ends across the line."""
    way = pixels[:, 1] - pixels[:, 0]
    across = np.stack([-way[:, 1], way[:, 0]], axis=1) / np.linalg.norm(way, axis=1, keepdims=True)
    ends = _on_floor(pixels, camera, calibration)
    along = ends[:, 1] - ends[:, 0]
    length = np.linalg.norm(along, axis=1)
    normal = np.stack([-along[:, 1], along[:, 0]], axis=1) / length[:, None]
    out = np.zeros((len(pixels), 2, 2))
    for end, sign in ((0, -1.0), (1, 1.0)):
        moved = _on_floor(pixels[:, end] + 0.25 * across, camera, calibration)
        shift = np.abs(np.sum((moved - ends[:, end]) * normal, axis=1)) / 0.25 * SIGMA_PIXEL
        effect = np.stack([0.5 * shift, sign * shift / length], axis=1)
        out += effect[:, :, None] * effect[:, None, :]
    reach = np.linalg.norm(ends.mean(axis=1), axis=1)
    out[:, 0, 0] += (
        SIGMA_OFFSET**2 + (reach**2 * np.sqrt(calibration.covariance[0, 0] + calibration.covariance[1, 1])) ** 2
    )
    out[:, 1, 1] += SIGMA_ANGLE**2
    return out
