"""Points of the raw image in the rectified one, fast enough for every edge point of every frame."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numba
import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array
from recon.sequence.camera import Camera

NODE_STEP = 2  # px between nodes: linear in between is off by less than 0.002 px of an ordinary lens
MAX_OFF_AXIS = np.deg2rad(80.0)
MAX_ROUND_TRIP = 0.2  # px: where projecting an undistorted pixel does not lead back, the lens model has no inverse


@dataclass(frozen=True)
class Rectifier:
    """Raw pixels to rectified pixels by a table of nodes.

    table: (rows, columns, 3) float64: rectified x, y (px), and stretch, at raw pixel (NODE_STEP * column,
    NODE_STEP * row); nan off the lens model. Stretch is the rectified length of a raw pixel (square root of the
    area's): 1 without distortion, large at the rim of a wide-angle lens.
    """

    table: Array | None

    def __call__(self, points: Array) -> tuple[Array, Array]:
        """Rectified pixels (N, 2) and stretch (N,) of raw pixels (N, 2); nan beyond 80 degrees off the axis."""
        if self.table is None:
            return points, np.ones(len(points))
        out = _interpolate(self.table, points, NODE_STEP)
        return out[:, :2], out[:, 2]


def rectifier(camera: Camera) -> Rectifier:
    """The rectifier of a camera, made once."""
    if not camera.is_distorted:
        return Rectifier(None)
    numbers = (camera.matrix.astype(np.float64).tobytes(), np.asarray(camera.distortion, np.float64).tobytes())
    return _cached(camera.width, camera.height, camera.distortion_model, *numbers)


@lru_cache(maxsize=4)
def _cached(width: int, height: int, model: str, matrix: bytes, distortion: bytes) -> Rectifier:
    camera = Camera(width, height, np.frombuffer(matrix).reshape(3, 3), model, np.frombuffer(distortion))  # type: ignore[arg-type]
    return Rectifier(_table(camera))


def _table(camera: Camera) -> Array:
    """The table of a distorted camera."""
    columns = NODE_STEP * np.arange((camera.width - 1) // NODE_STEP + 2)
    rows = NODE_STEP * np.arange((camera.height - 1) // NODE_STEP + 2)
    u, v = np.meshgrid(columns, rows)
    raw = np.stack([u.ravel(), v.ravel()], axis=1).astype(np.float64)
    xy = camera.undistort(raw)
    back = camera.project(np.concatenate([xy, np.ones((len(xy), 1))], axis=1))
    with np.errstate(invalid="ignore"):
        ok = np.linalg.norm(back - raw, axis=1) < MAX_ROUND_TRIP
        ok &= np.linalg.norm(xy, axis=1) < np.tan(MAX_OFF_AXIS)
    xy[~ok] = np.nan
    rectified = (xy @ camera.matrix[:2, :2].T + camera.matrix[:2, 2]).reshape(len(rows), len(columns), 2)
    along_v, along_u = (np.asarray(np.gradient(rectified, NODE_STEP, axis=k)) for k in (0, 1))
    area = along_u[..., 0] * along_v[..., 1] - along_u[..., 1] * along_v[..., 0]
    with np.errstate(invalid="ignore"):
        stretch = np.sqrt(np.where(area > 0, area, np.nan))
    return np.concatenate([rectified, stretch[..., None]], axis=2)


@numba.njit(cache=True)
def _interpolate(table: Array, points: Array, step: int) -> NDArray[np.float64]:
    """Bilinear: (N, 3) of the table at raw pixels (N, 2)."""
    rows, columns, channels = table.shape
    out = np.empty((len(points), channels))
    for i in range(len(points)):
        x, y = points[i, 0] / step, points[i, 1] / step
        c, r = min(max(int(np.floor(x)), 0), columns - 2), min(max(int(np.floor(y)), 0), rows - 2)
        a, b = x - c, y - r
        for k in range(channels):
            top = (1 - a) * table[r, c, k] + a * table[r, c + 1, k]
            bottom = (1 - a) * table[r + 1, c, k] + a * table[r + 1, c + 1, k]
            out[i, k] = (1 - b) * top + b * bottom
    return out


def stretch_at(camera: Camera, rectified: Array) -> Array:
    """(N,) rectified px a raw pixel at rectified pixels (N, 2); nan where the lens does not reach."""
    if not camera.is_distorted:
        return np.ones(len(rectified))
    inverse = np.linalg.inv(camera.matrix)
    corners = np.concatenate([rectified, rectified + np.array([1.0, 0.0]), rectified + np.array([0.0, 1.0])])
    raw = camera.project(np.concatenate([corners, np.ones((len(corners), 1))], axis=1) @ inverse.T)
    a, b, c = np.split(raw, 3)
    (ux, uy), (vx, vy) = (b - a).T, (c - a).T
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(1.0 / np.sqrt(np.abs(ux * vy - uy * vx)))
