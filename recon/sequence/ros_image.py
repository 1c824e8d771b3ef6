"""Pixels of Image messages, and what kind of picture a CompressedImage holds."""

from __future__ import annotations

import io
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]

# encoding: (numpy type of a sample, samples a pixel, OpenCV's conversion to BGR or None)
ENCODINGS: dict[str, tuple[str, int, int | None]] = {
    "mono8": ("u1", 1, None),
    "8UC1": ("u1", 1, None),
    "bgr8": ("u1", 3, None),
    "8UC3": ("u1", 3, None),
    "rgb8": ("u1", 3, cv2.COLOR_RGB2BGR),
    "bgra8": ("u1", 4, cv2.COLOR_BGRA2BGR),
    "8UC4": ("u1", 4, cv2.COLOR_BGRA2BGR),
    "rgba8": ("u1", 4, cv2.COLOR_RGBA2BGR),
    "bayer_rggb8": ("u1", 1, cv2.COLOR_BayerRGGB2BGR),
    "bayer_bggr8": ("u1", 1, cv2.COLOR_BayerBGGR2BGR),
    "bayer_gbrg8": ("u1", 1, cv2.COLOR_BayerGBRG2BGR),
    "bayer_grbg8": ("u1", 1, cv2.COLOR_BayerGRBG2BGR),
    "yuv422": ("u1", 2, cv2.COLOR_YUV2BGR_UYVY),
    "uyvy": ("u1", 2, cv2.COLOR_YUV2BGR_UYVY),
    "yuv422_yuy2": ("u1", 2, cv2.COLOR_YUV2BGR_YUY2),
    "yuyv": ("u1", 2, cv2.COLOR_YUV2BGR_YUY2),
    "mono16": ("u2", 1, None),
    "16UC1": ("u2", 1, None),
    "rgb16": ("u2", 3, cv2.COLOR_RGB2BGR),
    "bgr16": ("u2", 3, None),
    "bayer_rggb16": ("u2", 1, cv2.COLOR_BayerRGGB2BGR),
    "bayer_bggr16": ("u2", 1, cv2.COLOR_BayerBGGR2BGR),
    "bayer_gbrg16": ("u2", 1, cv2.COLOR_BayerGBRG2BGR),
    "bayer_grbg16": ("u2", 1, cv2.COLOR_BayerGRBG2BGR),
}
DEPTHS = ("16UC1", "32FC1")
"""Encodings of depth cameras: no pictures, unless the user names the topic and it holds integers."""


def is_colour(encoding: str) -> bool:
    """Whether pictures of this encoding come out in colour."""
    _, channels, conversion = ENCODINGS[encoding]
    return channels > 1 or conversion is not None


def samples(message: Any) -> NDArray[Any] | None:
    """The samples (H, W) or (H, W, C) of an Image as sent, None when data is missing or the encoding is unknown."""
    known = ENCODINGS.get(message.encoding)
    if known is None:
        return None
    kind, channels, _ = known
    dtype = np.dtype(kind).newbyteorder(">" if message.is_bigendian else "<")
    height, width = int(message.height), int(message.width)
    row = width * channels * dtype.itemsize
    step = int(message.step) or row
    data = np.asarray(message.data, dtype=np.uint8)
    if not row or step < row or len(data) < step * (height - 1) + row or height < 1:
        return None
    rows = np.lib.stride_tricks.as_strided(data, (height, row), (step, 1), writeable=False)
    pixels = np.ascontiguousarray(rows).view(dtype)
    return pixels.reshape((height, width) if channels == 1 else (height, width, channels))


def picture(message: Any, bits: int = 16) -> Image | None:
    """An Image as uint8 BGR (H, W, 3) or grey (H, W); of 16-bit samples the upper 8 of `bits`."""
    pixels = samples(message)
    if pixels is None:
        return None
    if pixels.dtype.itemsize == 2:
        pixels = np.minimum(pixels.astype(np.uint16) >> max(bits - 8, 0), 255)
    pixels = np.ascontiguousarray(pixels.astype(np.uint8))
    conversion = ENCODINGS[message.encoding][2]
    if conversion is None:
        return pixels
    return np.asarray(cv2.cvtColor(pixels, conversion), dtype=np.uint8)


def used_bits(message: Any) -> int:
    """How many bits the brightest sample needs; 8 at least."""
    pixels = samples(message)
    return 8 if pixels is None or not pixels.size else max(8, int(pixels.max()).bit_length())


def file_kind(data: bytes) -> str | None:
    """`jpg` or `png` by the first bytes of a CompressedImage, None for anything else (depth, video)."""
    if data[:2] == b"\xff\xd8":
        return "jpg"
    return "png" if data[:8] == b"\x89PNG\r\n\x1a\n" else None


def file_size(data: bytes) -> tuple[int, int] | None:
    """Width and height in the header of a JPEG or PNG, None when it is damaged."""
    from PIL import Image as PillowImage

    try:
        with PillowImage.open(io.BytesIO(data)) as image:
            return image.size
    except (OSError, ValueError, SyntaxError, PillowImage.DecompressionBombError):
        return None
