"""Colours of textured faces at points."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array
from recon.model import NEUTRAL_COLOURS, Face


def bilinear(image: NDArray[np.uint8] | NDArray[np.float32], x: Array, y: Array) -> NDArray[np.float32]:
    """Values (N, C) of an image (H, W, C) at x, y (N,); pixel centres are at integers, clamped to the edge pixels."""
    height, width = image.shape[:2]
    x, y = np.clip(x, 0, width - 1), np.clip(y, 0, height - 1)
    column, row = x.astype(np.int64), y.astype(np.int64)
    right, down = np.minimum(column + 1, width - 1), np.minimum(row + 1, height - 1)
    fx, fy = (x - column).astype(np.float32)[:, None], (y - row).astype(np.float32)[:, None]
    top = image[row, column] * (1 - fx) + image[row, right] * fx
    bottom = image[down, column] * (1 - fx) + image[down, right] * fx
    return np.asarray(top * (1 - fy) + bottom * fy, dtype=np.float32)


def sample_texture(texture: NDArray[np.uint8], uv: Array) -> NDArray[np.float32]:
    """Bilinear colours (N, 3), 0 to 255, of a texture (H, W, 3) at uv (N, 2), v up; clamped to the edge texels.

    Texel (row, column) has its centre at u = (column + 0.5) / W, v = 1 - (row + 0.5) / H.
    """
    height, width = texture.shape[:2]
    return bilinear(texture, uv[:, 0] * width - 0.5, (1 - uv[:, 1]) * height - 0.5)


def uv_from_points(face: Face) -> Array:
    """Affine map (4, 2) from homogeneous points [x, y, z, 1] of the plane of `face` to its uv (least squares).

    Its first three rows lie in the plane: their lengths are u and v per metre.
    """
    middle = face.vertices.mean(axis=0)
    linear = np.linalg.lstsq(face.vertices - middle, face.uv - face.uv.mean(axis=0), rcond=1e-9)[0]
    return np.concatenate([linear, (face.uv.mean(axis=0) - middle @ linear)[None]])


class FaceColours:
    """The colours of one face at points of its plane, averaged over texels that are finer than asked for."""

    def __init__(self, face: Face) -> None:
        self._neutral = np.array(NEUTRAL_COLOURS[face.kind], np.float32)
        self._levels: list[NDArray[np.uint8]] = [] if face.texture is None else [face.texture]
        self._uv_map = uv_from_points(face)
        scale = float(np.linalg.norm(self._uv_map[:3, 0]))  # u per metre
        self._texel = 1 / max(scale * face.texture.shape[1], 1e-9) if face.texture is not None else 0.0

    def at(self, points: Array, spacing: Array | float) -> NDArray[np.float32]:
        """sRGB colours (N, 3), 0 to 255, at points (N, 3), m, whose neighbours are `spacing` m away (N,) or scalar."""
        if not self._levels:
            return np.tile(self._neutral, (len(points), 1))
        uv = points @ self._uv_map[:3] + self._uv_map[3]
        ratio = np.maximum(np.broadcast_to(spacing, len(points)) / self._texel, 1.0)
        levels = np.rint(np.log2(ratio)).astype(np.int64)
        out = np.empty((len(points), 3), np.float32)
        for level in np.unique(levels):
            mine = levels == level
            out[mine] = sample_texture(self._level(int(level)), uv[mine])
        return out

    def _level(self, level: int) -> NDArray[np.uint8]:
        """The texture at half the size `level` times over, at least one texel."""
        while len(self._levels) <= level:
            height, width = self._levels[-1].shape[:2]
            size = max(width // 2, 1), max(height // 2, 1)
            self._levels.append(np.asarray(cv2.resize(self._levels[-1], size, interpolation=cv2.INTER_AREA), np.uint8))
        return self._levels[level]
