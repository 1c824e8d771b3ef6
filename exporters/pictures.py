"""Textures as files, and colours as the formats want them."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from recon.exporters.options import TextureFormat
from recon.geometry import Array
from recon.model import NEUTRAL_COLOURS, Face, FaceKind, Model

QUALITY = 92
OPACITY: dict[FaceKind, float] = {"window": 0.35}
"""Of faces without a texture that are not opaque."""
MIME: dict[TextureFormat, str] = {"jpg": "image/jpeg", "png": "image/png", "webp": "image/webp"}
_OPTIONS: dict[TextureFormat, list[int]] = {
    "jpg": [cv2.IMWRITE_JPEG_QUALITY, QUALITY, cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444],
    "png": [cv2.IMWRITE_PNG_COMPRESSION, 6],
    "webp": [cv2.IMWRITE_WEBP_QUALITY, QUALITY],
}


def encode(texture: NDArray[np.uint8], kind: TextureFormat = "jpg") -> bytes:
    """A texture (H, W, 3), RGB, as a file. JPEG: photographs at a tenth of PNG's size, full colour resolution."""
    ok, data = cv2.imencode(f".{kind}", cv2.cvtColor(texture, cv2.COLOR_RGB2BGR), _OPTIONS[kind])
    if not ok:
        raise RuntimeError(f"OpenCV cannot encode a texture of shape {texture.shape}")
    return data.tobytes()


def texture_files(model: Model, folder: str, kind: TextureFormat = "jpg") -> dict[str, bytes]:
    """Files of all textures, by path: `folder/wall_003.jpg`."""
    pictures = {texture_path(f, folder, kind): f.texture for f in model.faces if f.texture is not None}
    return {path: encode(texture, kind) for path, texture in pictures.items()}


def texture_path(face: Face, folder: str, kind: TextureFormat = "jpg") -> str:
    """Where `texture_files` puts the texture of `face`."""
    return f"{folder}/{material_name(face)}.{kind}"


def material_name(face: Face) -> str:
    """Of its picture and material; faces on one page share theirs, those without a picture that of their kind."""
    return f"neutral_{face.kind}" if face.texture is None else face.page or face.name


def linear_rgb(srgb: ArrayLike) -> Array:
    """sRGB values (..., 3) of 0 to 255 as linear light of 0 to 1 (IEC 61966-2-1)."""
    c = np.asarray(srgb, dtype=np.float64) / 255
    return np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)


def mean_colour(face: Face) -> Array:
    """sRGB colour (3,), 0 to 255, that stands for the face where no texture is shown."""
    if face.texture is None:
        return np.array(NEUTRAL_COLOURS[face.kind], dtype=np.float64)
    height, width = face.texture.shape[:2]
    (left, bottom), (right, top) = face.uv.min(axis=0), face.uv.max(axis=0)  # its part of a page
    first, last = round((1 - top) * height), round((1 - bottom) * height)
    part = face.texture[first : max(last, first + 1), round(left * width) : max(round(right * width), 1)]
    return np.asarray((part if part.size else face.texture).reshape(-1, 3).mean(axis=0), dtype=np.float64)
