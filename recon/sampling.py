"""Colours of textured faces at points."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array
from recon.model import NEUTRAL_COLOURS, Face


def sample_texture(texture: NDArray[np.uint8], uv: Array) -> NDArray[np.float32]:
    """Bilinear colours (N, 3), 0 to 255, of a texture (H, W, 3) at uv (N, 2), v up; clamped to the edge texels.

    Texel (row, column) has its centre at u = (column + 0.5) / W, v = 1 - (row + 0.5) / H.
    """
    height, width = texture.shape[:2]
    x = np.clip(uv[:, 0] * width - 0.5, 0, width - 1)
    y = np.clip((1 - uv[:, 1]) * height - 0.5, 0, height - 1)
    column, row = x.astype(np.int64), y.astype(np.int64)
    right, down = np.minimum(column + 1, width - 1), np.minimum(row + 1, height - 1)
    fx, fy = (x - column).astype(np.float32)[:, None], (y - row).astype(np.float32)[:, None]
    top = texture[row, column] * (1 - fx) + texture[row, right] * fx
    bottom = texture[down, column] * (1 - fx) + texture[down, right] * fx
    return np.asarray(top * (1 - fy) + bottom * fy, dtype=np.float32)


def shrink_texture(texture: NDArray[np.uint8], factor: float) -> NDArray[np.uint8]:
    """The texture at 1/factor of its size, averaged so that fine detail does not alias; factor <= 1: as it is."""
    if factor <= 1:
        return texture
    height, width = texture.shape[:2]
    size = max(round(width / factor), 1), max(round(height / factor), 1)
    return np.asarray(cv2.resize(texture, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)


def uv_from_points(face: Face) -> Array:
    """Affine map (4, 2) from homogeneous points [x, y, z, 1] of the plane of `face` to its uv (least squares)."""
    homogeneous = np.column_stack([face.vertices, np.ones(len(face.vertices))])
    return np.asarray(np.linalg.lstsq(homogeneous, face.uv, rcond=1e-9)[0])


def face_colours(face: Face, points: Array, spacing: float = 0.0) -> NDArray[np.float32]:
    """sRGB colours (N, 3), 0 to 255, of `face` at points (N, 3) of its plane.

    spacing: distance in m between neighbouring points, to average over texels that are finer than that.
    """
    if face.texture is None:
        return np.tile(np.array(NEUTRAL_COLOURS[face.kind], np.float32), (len(points), 1))
    uv_map = uv_from_points(face)
    texel = 1 / max(float(np.linalg.norm(uv_map[:3, 0])) * face.texture.shape[1], 1e-12)
    texture = shrink_texture(face.texture, spacing / texel)
    return sample_texture(texture, points @ uv_map[:3] + uv_map[3])
