"""Edge pixels, chained and placed to a fraction of a pixel."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numba
import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array

BLUR_SIGMA = 1.0
# Hysteresis thresholds in units of the gradient's noise; a floor for images without any.
LOW_FACTOR, HIGH_FACTOR = 2.2, 5.0
LOW_FLOOR, HIGH_FLOOR = 6.0, 14.0
# The lower 30 % of gradient magnitudes are taken for noise: a Rayleigh law has its 30 % quantile at 0.845 sigma.
NOISE_QUANTILE, RAYLEIGH_AT_QUANTILE = 0.3, 0.845
MIN_CHAIN_PIXELS = 8


@dataclass(frozen=True)
class EdgeChains:
    """Chains of edge points of the raw image, each from one junction or end to the next.

    points: (P, 2) pixels x, y, sub-pixel. gradients: (P, 2) unit vectors towards the brighter side.
    starts: (C + 1,) chain c owns the points starts[c]:starts[c + 1].
    """

    points: Array
    gradients: Array
    starts: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.starts) - 1


def find_edges(grey: NDArray[np.uint8]) -> EdgeChains:
    """Canny edges of an image (H, W), linked up to junctions and refined to sub-pixel along the gradient.

    The linking follows the idea that the paper cites (section 2.2): sequential edge points up to the junction points.
    """
    blurred = cv2.GaussianBlur(grey, (0, 0), BLUR_SIGMA)
    dx = cv2.Sobel(blurred, cv2.CV_16S, 1, 0)
    dy = cv2.Sobel(blurred, cv2.CV_16S, 0, 1)
    low, high = canny_thresholds(dx, dy)
    edges = cv2.Canny(dx, dy, low, high, L2gradient=True)
    pixels, starts = _link(edges, MIN_CHAIN_PIXELS)
    points, gradients = _refine(pixels, dx, dy)
    return EdgeChains(points, gradients, starts)


def canny_thresholds(dx: NDArray[np.int16], dy: NDArray[np.int16]) -> tuple[float, float]:
    """Hysteresis thresholds (low, high) for Sobel gradients (H, W) each, from the gradient's own noise.

    A quantile moves with the exposure; a low one is the noise of even surfaces also where half the image is texture.
    """
    sample = np.hypot(dx[::3, ::3].astype(np.float32), dy[::3, ::3].astype(np.float32)).ravel()
    if sample.size == 0:
        return LOW_FLOOR, HIGH_FLOOR
    k = int(NOISE_QUANTILE * (sample.size - 1))
    sigma = float(np.partition(sample, k)[k]) / RAYLEIGH_AT_QUANTILE
    return max(LOW_FLOOR, LOW_FACTOR * sigma), max(HIGH_FLOOR, HIGH_FACTOR * sigma)


@numba.njit(cache=True)
def _crossings(edges: NDArray[np.uint8], r: int, c: int) -> int:
    """How often the ring of eight neighbours goes from off to on: 1 an end, 2 along a line, 3 and more a junction."""
    ring = (
        edges[r - 1, c - 1], edges[r - 1, c], edges[r - 1, c + 1], edges[r, c + 1],
        edges[r + 1, c + 1], edges[r + 1, c], edges[r + 1, c - 1], edges[r, c - 1],
    )  # fmt: skip
    count = 0
    previous = ring[7]
    for k in range(8):
        if previous == 0 and ring[k] != 0:
            count += 1
        previous = ring[k]
    return count


@numba.njit(cache=True)
def _step(state: NDArray[np.uint8], r: int, c: int, dr: int, dc: int) -> tuple[int, int]:
    """The neighbour to go on to: a junction if there is one, else the unvisited pixel straightest ahead; (-1, -1) none.

    state: 0 no edge, 1 unvisited, 2 junction, 3 visited. (dr, dc): the last step, (0, 0) at the start.
    """
    best, br, bc = -10.0, -1, -1
    for a in range(-1, 2):
        for b in range(-1, 2):
            s = state[r + a, c + b]
            if (a == 0 and b == 0) or s == 0 or s == 3:
                continue
            ahead = a * dr + b * dc
            if s == 2 and ahead < 0:
                continue
            score = ahead - 0.1 * (a * a + b * b) + (4.0 if s == 2 else 0.0)
            if score > best:
                best, br, bc = score, r + a, c + b
    return br, bc


@numba.njit(cache=True)
def _classify(edges: NDArray[np.uint8]) -> tuple[NDArray[np.uint8], int]:
    """State of every pixel (0 no edge, 1 unvisited, 2 junction) and the number of edge pixels; the rim is left out."""
    h, w = edges.shape
    state = np.zeros((h, w), np.uint8)
    total = 0
    for r in range(1, h - 1):
        for c in range(1, w - 1):
            if edges[r, c] != 0:
                total += 1
                state[r, c] = 2 if _crossings(edges, r, c) > 2 else 1
    return state, total


@numba.njit(cache=True)
def _walk(state: NDArray[np.uint8], pixels: NDArray[np.int64], n: int, dr: int, dc: int) -> int:
    """Walk on from pixels[n - 1], the last step being (dr, dc), to an end or a junction; the new number of pixels."""
    r, c = pixels[n - 1, 0], pixels[n - 1, 1]
    while True:
        r1, c1 = _step(state, r, c, dr, dc)
        if r1 < 0:
            return n
        pixels[n, 0], pixels[n, 1] = r1, c1
        n += 1
        if state[r1, c1] == 2:
            return n
        state[r1, c1] = 3
        dr, dc, r, c = r1 - r, c1 - c, r1, c1


@numba.njit(cache=True)
def _reverse(pixels: NDArray[np.int64], a: int, b: int) -> None:
    """Turn round the pixels a to b."""
    while a < b:
        for k in range(2):
            pixels[a, k], pixels[b, k] = pixels[b, k], pixels[a, k]
        a, b = a + 1, b - 1


@numba.njit(cache=True)
def _link(edges: NDArray[np.uint8], min_pixels: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Chains as pixels (P, 2) row, column and starts (C + 1,); chains shorter than `min_pixels` are dropped."""
    state, total = _classify(edges)
    pixels = np.empty((3 * total + 1, 2), np.int64)  # a pixel, and a junction at both ends of its chain
    starts = np.zeros(total + 1, np.int64)
    chains, n = 0, 0
    for r in range(1, edges.shape[0] - 1):
        for c in range(1, edges.shape[1] - 1):
            if state[r, c] != 1:
                continue
            begin = n
            state[r, c] = 3
            pixels[n, 0], pixels[n, 1] = r, c
            n = _walk(state, pixels, n + 1, 0, 0)
            _reverse(pixels, begin, n - 1)
            if n - begin > 1:
                n = _walk(state, pixels, n, r - pixels[n - 2, 0], c - pixels[n - 2, 1])
            if n - begin < min_pixels:
                n = begin
            else:
                chains += 1
                starts[chains] = n
    return pixels[:n], starts[: chains + 1]


@numba.njit(cache=True)
def _refine(
    pixels: NDArray[np.int64], dx: NDArray[np.int16], dy: NDArray[np.int16]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Points (P, 2) x, y and unit gradients (P, 2): the peak of the gradient's magnitude across the edge.

    A blurred step has a Gaussian gradient, whose logarithm is a parabola: three samples give its peak without bias.
    The outer two are where the gradient's direction leaves the 3 x 3 neighbourhood, linear between two pixels.
    """
    n = len(pixels)
    points, gradients = np.empty((n, 2)), np.empty((n, 2))
    for i in range(n):
        r, c = pixels[i]
        gx, gy = float(dx[r, c]), float(dy[r, c])
        norm = np.hypot(gx, gy)
        gx, gy = gx / norm, gy / norm
        steep = abs(gy) > abs(gx)
        reach = 1.0 / max(abs(gx), abs(gy))
        t = gx * reach if steep else gy * reach  # where the direction crosses the neighbouring row or column
        s = (1 if gy > 0 else -1) if steep else (1 if gx > 0 else -1)
        logs = np.empty(2)
        for k in range(2):
            sign = 2 * k - 1
            side = 1 if sign * t > 0 else -1
            if steep:
                ra, ca, rb, cb = r + sign * s, c, r + sign * s, c + side
            else:
                ra, ca, rb, cb = r, c + sign * s, r + side, c + sign * s
            near = np.sqrt(float(dx[ra, ca]) ** 2 + float(dy[ra, ca]) ** 2)
            far = np.sqrt(float(dx[rb, cb]) ** 2 + float(dy[rb, cb]) ** 2)
            logs[k] = np.log(max(1.0, near + abs(t) * (far - near)))
        bend = logs[0] + logs[1] - 2.0 * np.log(max(1.0, norm))
        shift = 0.5 * reach * (logs[0] - logs[1]) / bend if bend < -1e-6 else 0.0
        shift = min(max(shift, -0.75), 0.75)
        points[i, 0], points[i, 1] = c + shift * gx, r + shift * gy
        gradients[i, 0], gradients[i, 1] = gx, gy
    return points, gradients
