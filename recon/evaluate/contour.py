"""The room's contour sampled per degree, as the paper made its scans (section 3): of a layout, or of a label image.

In an image the contour is where walls meet the floor. With known intrinsics, camera height and tilt every pixel of it
is a point on the floor; the straight line through those of one wall is known far better than one of them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array, Pose3, apply2, cross2, inverse2
from recon.labels import FIRST_WALL, FLOOR
from recon.model import Wall
from recon.sequence.camera import Camera

STEP = np.radians(1.0)
MIN_POINTS = 4
"""Image columns that show a wall's foot, fewer say nothing of where it is."""
INLIER = 1.5
"""Pixels of rows between a wall's foot and its line: recessed doors and baseboards lie off it."""
ROUNDS = 8
SIDE = np.radians(0.6)
"""Half a step and a little: a beam meets the wall whose foot shows at its bearing."""
MIN_RANGE = 0.05

Feet = dict[int, tuple[Array, Array]]
"""By wall label: its line in the platform's frame, (normal x, y, distance), and the bearings (K,) where it shows."""


ALL_ROUND: Array = STEP * np.arange(-180, 180)
"""(360,) rad: the bearings of a scan of a layout."""


def layout_ranges(walls: tuple[Wall, ...], map_from_platform: Array) -> Array:
    """(360,) m from a planar pose (3,) to the nearest wall ALL_ROUND; inf where there is none."""
    ends = np.stack([[wall.start, wall.end] for wall in walls])
    start, end = (apply2(inverse2(map_from_platform), ends[:, k]) for k in (0, 1))
    direction = np.stack([np.cos(ALL_ROUND), np.sin(ALL_ROUND)], axis=1)[:, None]  # (360, 1, 2) against (W, 2)
    along = end - start
    with np.errstate(divide="ignore", invalid="ignore"):
        determinant = cross2(direction, along)
        reach = cross2(start, along) / determinant
        part = cross2(start, direction) / determinant
    hit = (reach > MIN_RANGE) & (part >= 0.0) & (part <= 1.0)
    return np.asarray(np.where(hit, reach, np.inf).min(axis=1))


def bearings(camera: Camera, platform_from_camera: Pose3) -> Array:
    """(B,) rad, whole degrees counter-clockwise from ahead, that lie in the image's field of view at its middle row."""
    row = np.array([[0.0, (camera.height - 1) / 2], [camera.width - 1.0, (camera.height - 1) / 2]])
    rays = np.column_stack([camera.undistort(row), np.ones(2)]) @ platform_from_camera.rotation.T
    left, right = np.arctan2(rays[:, 1], rays[:, 0])
    return np.arange(np.ceil(right / STEP), np.floor(left / STEP) + 1) * STEP


def contour_ranges(labels: NDArray[np.uint16], camera: Camera, platform_from_camera: Pose3) -> Array:
    """(B,) m from the platform's origin to the contour at `bearings`; inf where the image shows no foot of a wall.

    labels: (H, W) in FORMAT.md's values. platform_from_camera: with the camera's height as its z.
    """
    angles = bearings(camera, platform_from_camera)
    feet = wall_feet(labels, camera, platform_from_camera)
    out = np.full(len(angles), np.inf)
    directions = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    for (nx, ny, distance), shown in feet.values():
        nearest = np.abs(angles[:, None] - shown[None]).min(axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            reach = distance / (directions @ np.array([nx, ny]))
        ok = (nearest <= SIDE) & (reach > MIN_RANGE)
        out[ok] = np.minimum(out[ok], reach[ok])
    return out


def wall_feet(labels: NDArray[np.uint16], camera: Camera, platform_from_camera: Pose3) -> Feet:
    """The line of every wall whose foot shows in enough columns, from pixels of it above pixels of floor."""
    wall = (labels[:-1] >= FIRST_WALL) & (labels[1:] == FLOOR)
    rows, columns = np.nonzero(wall)
    values = labels[rows, columns]
    pixels = np.column_stack([columns, rows + 0.5]).astype(np.float64)
    points, ok = on_floor(pixels, camera, platform_from_camera)
    rectified = camera.undistort(pixels) * camera.matrix[1, 1]
    feet: Feet = {}
    for value in np.unique(values):
        chosen = ok & (values == value)
        if chosen.sum() < MIN_POINTS:
            continue
        inliers = _straight(rectified[chosen])
        line = _floor_line(rectified[chosen][inliers] / camera.matrix[1, 1], platform_from_camera)
        here = points[chosen][inliers]
        feet[int(value)] = line, np.arctan2(here[:, 1], here[:, 0])
    return feet


def on_floor(pixels: Array, camera: Camera, platform_from_camera: Pose3) -> tuple[Array, NDArray[np.bool_]]:
    """Points (N, 2) m of the floor that pixels (N, 2) show, and whether their rays go down to it."""
    rays = np.column_stack([camera.undistort(pixels), np.ones(len(pixels))]) @ platform_from_camera.rotation.T
    down = rays[:, 2] < -1e-6
    origin = platform_from_camera.translation
    reach = origin[2] / np.where(down, -rays[:, 2], 1.0)
    return origin[:2] + reach[:, None] * rays[:, :2], down


def _straight(points: Array) -> NDArray[np.bool_]:
    """(N,) whether points (N, 2) px lie on the line of most of them: least squares on the half that fits best, often.

    Starts at the median slope between points half the columns apart (Theil and Sen, with few pairs).
    """
    order = np.argsort(points[:, 0], kind="stable")
    half = len(points) // 2
    step = points[order[half:]] - points[order[: len(points) - half]]
    step = step[np.abs(step[:, 0]) > 1e-9]
    slope = float(np.median(step[:, 1] / step[:, 0])) if len(step) else 0.0
    offset = float(np.median(points[:, 1] - slope * points[:, 0]))
    inliers = np.ones(len(points), dtype=bool)
    for _ in range(ROUNDS):
        off = np.abs(points[:, 1] - slope * points[:, 0] - offset) / np.hypot(1.0, slope)
        inliers = off <= max(INLIER, float(np.median(off)))
        if inliers.sum() < MIN_POINTS:
            return np.ones(len(points), dtype=bool)
        slope, offset = np.polyfit(points[inliers, 0], points[inliers, 1], 1)
    return inliers


def _floor_line(normalised: Array, platform_from_camera: Pose3) -> Array:
    """(normal x, normal y, distance) on the floor of the straight line through normalised image points (N, 2)."""
    slope, offset = np.polyfit(normalised[:, 0], normalised[:, 1], 1)
    ends = np.array([normalised[:, 0].min(), normalised[:, 0].max()])
    rays = np.column_stack([ends, slope * ends + offset, np.ones(2)]) @ platform_from_camera.rotation.T
    plane = np.cross(rays[0], rays[1])  # through the camera's centre, in the platform's axes
    across = plane @ platform_from_camera.translation
    return np.array([plane[0], plane[1], across]) / np.hypot(plane[0], plane[1])
