"""Textures as JPEG files, and colours as the formats want them."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from recon.geometry import Array
from recon.model import NEUTRAL_COLOURS, Face, Model

JPEG_QUALITY = 92
TEXTURE_SUFFIX = ".jpg"


def encode_jpeg(texture: NDArray[np.uint8]) -> bytes:
    """A texture (H, W, 3), RGB, as a JPEG file: photographs at a tenth of PNG's size, full colour resolution."""
    options = [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY]
    options += [cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444]
    ok, data = cv2.imencode(TEXTURE_SUFFIX, cv2.cvtColor(texture, cv2.COLOR_RGB2BGR), options)
    if not ok:
        raise RuntimeError(f"OpenCV cannot encode a texture of shape {texture.shape}")
    return data.tobytes()


def texture_files(model: Model, folder: str) -> dict[str, bytes]:
    """JPEG files of all textured faces, by path: `folder/wall_003.jpg`."""
    return {texture_path(f, folder): encode_jpeg(f.texture) for f in model.faces if f.texture is not None}


def texture_path(face: Face, folder: str) -> str:
    """Where `texture_files` puts the texture of `face`."""
    return f"{folder}/{face.name}{TEXTURE_SUFFIX}"


def linear_rgb(srgb: ArrayLike) -> Array:
    """sRGB values (..., 3) of 0 to 255 as linear light of 0 to 1 (IEC 61966-2-1)."""
    c = np.asarray(srgb, dtype=np.float64) / 255
    return np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)


def mean_colour(face: Face) -> Array:
    """sRGB colour (3,), 0 to 255, that stands for the face where no texture is shown."""
    if face.texture is None:
        return np.array(NEUTRAL_COLOURS[face.kind], dtype=np.float64)
    return np.asarray(face.texture.reshape(-1, 3).mean(axis=0), dtype=np.float64)
