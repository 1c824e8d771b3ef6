"""A picture of a surface being painted: metres in, antialiased texels out."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array

Colour = tuple[float, float, float]
Image = NDArray[np.float32]


class Canvas:
    """RGB in [0, 1] as the eye grades it (sRGB-like). image: (H, W, 3), row 0 is the top; u right and v up, m."""

    def __init__(self, width: float, height: float, ppm: float, colour: Colour) -> None:
        self.ppm, self.width, self.height = ppm, width, height
        shape = (max(1, int(np.ceil(height * ppm - 1e-6))), max(1, int(np.ceil(width * ppm - 1e-6))))
        self.image: Image = np.empty((*shape, 3), np.float32)
        self.image[:] = colour

    @property
    def u(self) -> Array:
        """(W,) m, the middle of each column."""
        return np.asarray((np.arange(self.image.shape[1]) + 0.5) / self.ppm, np.float64)

    @property
    def v(self) -> Array:
        """(H,) m, the middle of each row."""
        return np.asarray((self.image.shape[0] - np.arange(self.image.shape[0]) - 0.5) / self.ppm, np.float64)

    def rectangle(self, u0: float, v0: float, u1: float, v1: float, colour: Colour, alpha: float = 1.0) -> None:
        """Fill; edges that fall inside a texel cover part of it."""
        rows, columns = _cover(self.v, v0, v1, self.ppm), _cover(self.u, u0, u1, self.ppm)
        r, c = np.flatnonzero(rows), np.flatnonzero(columns)
        if len(r) and len(c):
            weight = (alpha * np.outer(rows[r], columns[c]))[..., None].astype(np.float32)
            part = self.image[r[0] : r[-1] + 1, c[0] : c[-1] + 1]
            part += weight * (np.array(colour, np.float32) - part)

    def frame(self, u0: float, v0: float, u1: float, v1: float, width: float, colour: Colour) -> None:
        """The border of a rectangle, `width` m inwards."""
        self.rectangle(u0, v0, u1, v0 + width, colour)
        self.rectangle(u0, v1 - width, u1, v1, colour)
        self.rectangle(u0, v0 + width, u0 + width, v1 - width, colour)
        self.rectangle(u1 - width, v0 + width, u1, v1 - width, colour)

    def paste(self, u0: float, v1: float, picture: NDArray[np.uint8]) -> None:
        """Put an RGB picture with its upper left corner at u0, v1; what sticks out is cut off."""
        row, column = self.image.shape[0] - round(v1 * self.ppm), round(u0 * self.ppm)
        top, left = max(row, 0), max(column, 0)
        part = self.image[top : max(row + picture.shape[0], 0), left : max(column + picture.shape[1], 0)]
        part[:] = picture[top - row :, left - column :][: part.shape[0], : part.shape[1]] / np.float32(255)

    def shade(self, factor: Array | Image) -> None:
        """Multiply by (H, W), or by anything that broadcasts to it."""
        self.image *= np.asarray(factor, np.float32)[..., None]

    def noise(self, rng: np.random.Generator, sigma: float, scale: float, stretch: float = 1.0) -> None:
        """Multiply by smooth noise: standard deviation sigma, features of `scale` m, `stretch` times longer in u."""
        self.shade(1.0 + sigma * smooth_noise(self.image.shape[:2], scale * self.ppm, rng, stretch))


def smooth_noise(shape: tuple[int, ...], scale: float, rng: np.random.Generator, stretch: float = 1.0) -> Image:
    """(H, W) noise of unit variance whose features are `scale` pixels in v and `stretch` times that in u."""
    h, w = int(shape[0]), int(shape[1])
    rows, columns = max(2, round(h / max(scale, 1.0)) + 1), max(2, round(w / max(scale * stretch, 1.0)) + 1)
    coarse = rng.standard_normal((min(rows, h + 1), min(columns, w + 1)), dtype=np.float32)
    out = cv2.resize(coarse, (w, h), interpolation=cv2.INTER_CUBIC)
    return np.asarray(out, np.float32)


def mix(a: Colour, b: Colour, share: float) -> Colour:
    """a, moved towards b by `share`."""
    return (a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1]), a[2] + share * (b[2] - a[2]))


def _cover(middle: Array, low: float, high: float, ppm: float) -> Array:
    """Share of each texel that lies between low and high."""
    half = 0.5 / ppm
    return np.clip((np.minimum(middle + half, high) - np.maximum(middle - half, low)) * ppm, 0.0, 1.0)
