"""How like a photograph a rendered picture is."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

Picture = NDArray[np.float32]
Mask = NDArray[np.bool_]

WINDOW, SIGMA = 11, 1.5
K1, K2, RANGE = 0.01, 0.03, 255.0
"""Wang et al. 2004, section III.C."""
ITERATIONS = 12
LEAST_SCALE = 6.0
"""Levels: residuals of the exposure below this all count fully."""
MOST_PIXELS = 40_000
"""An exposure is fitted to about this many, evenly; the other pixels say the same."""
RIM = 2
"""Pixels next to what is not scored whose gradients are left out: they would be those of the mask."""


@dataclass(frozen=True)
class Fidelity:
    """psnr, dB, over all channels; ssim of the brightness; sharpness: the render's gradient energy over the photo's."""

    psnr: float
    ssim: float
    sharpness: float


def fidelity(photo: Picture, render: Picture, mask: Mask) -> Fidelity:
    """Of two pictures (H, W, 3), 0 to 255, RGB, over the pixels of `mask` (H, W)."""
    error = float(np.mean((photo[mask] - render[mask]) ** 2))
    first, second = (cv2.cvtColor(np.asarray(p, np.float32), cv2.COLOR_RGB2GRAY) for p in (photo, render))
    inner = cv2.erode(mask.astype(np.uint8), np.ones((2 * RIM + 1, 2 * RIM + 1), np.uint8)).astype(bool)
    energies = [float(_gradient_energy(p)[inner].sum()) for p in (first, second)]
    psnr = 10 * np.log10(RANGE**2 / max(error, 1e-6))
    return Fidelity(float(psnr), ssim(first, second, mask), energies[1] / max(energies[0], 1e-6))


def fit_exposure(photo: Picture, render: Picture, mask: Mask) -> Picture:
    """The render (H, W, 3) with a gain and a bias on each channel that fit it to the photo where `mask`.

    Robust least squares (Geman-McClure): what stands in the photo and not in the model has no say.
    """
    out = np.empty_like(render)
    step = max(1, int(mask.sum()) // MOST_PIXELS)
    for c in range(render.shape[2]):
        x, y = (picture[..., c][mask][::step].astype(np.float64) for picture in (render, photo))
        gain, bias = _robust_line(x, y)
        out[..., c] = np.clip(gain * render[..., c] + bias, 0, RANGE)
    return out


def _robust_line(x: NDArray[np.float64], y: NDArray[np.float64]) -> tuple[float, float]:
    """gain, bias of y = gain x + bias, first by the quartiles of both."""
    (x1, x2), (y1, y2) = np.percentile(x, [25, 75]), np.percentile(y, [25, 75])
    gain = float(np.clip((y2 - y1) / max(x2 - x1, 1.0), 0.5, 2.0))
    bias = float(np.median(y - gain * x))
    for _ in range(ITERATIONS):
        residual = y - gain * x - bias
        scale = max(LEAST_SCALE, 1.5 * float(np.median(np.abs(residual))))
        w = 1 / (1 + (residual / scale) ** 2) ** 2
        mean_x, mean_y = np.average(x, weights=w), np.average(y, weights=w)
        spread = float((w * (x - mean_x) ** 2).sum())
        if spread < 1e-6:
            return gain, bias
        gain = float((w * (x - mean_x) * (y - mean_y)).sum() / spread)
        bias = float(mean_y - gain * mean_x)
    return gain, bias


def ssim(first: Picture, second: Picture, mask: Mask) -> float:
    """Mean structural similarity (Wang et al. 2004, eq. 13) of brightness (H, W) over `mask`.

    Gaussian windows of 11 pixels, sigma 1.5; pixels outside the mask have no weight in any window.
    """
    weight = mask.astype(np.float32)
    total = np.maximum(_blur(weight), 1e-6)

    def mean(values: Picture) -> Picture:
        return np.asarray(_blur(values * weight) / total)

    m1, m2 = mean(first), mean(second)
    v1, v2, common = mean(first * first) - m1**2, mean(second * second) - m2**2, mean(first * second) - m1 * m2
    c1, c2 = (K1 * RANGE) ** 2, (K2 * RANGE) ** 2
    similarity = (2 * m1 * m2 + c1) * (2 * common + c2) / ((m1**2 + m2**2 + c1) * (v1 + v2 + c2))
    return float(similarity[mask].mean())


def _blur(values: Picture) -> Picture:
    return np.asarray(cv2.GaussianBlur(values, (WINDOW, WINDOW), SIGMA, borderType=cv2.BORDER_REFLECT))


def _gradient_energy(picture: Picture) -> Picture:
    """Squared length of the gradient (H, W), Sobel."""
    x, y = (cv2.Sobel(picture, cv2.CV_32F, *axis) for axis in ((1, 0), (0, 1)))
    return np.asarray(x * x + y * y)
