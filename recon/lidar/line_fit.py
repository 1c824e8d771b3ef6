"""Total-least-squares line of a run of returns, with its covariance (compiled).

The range noise acts along each beam; across the line it counts with the cosine between beam and normal. Minimising
the squares of these distances is the maximum-likelihood line (Pfister, Roumeliotis, Burdick, ICRA 2003).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from recon.geometry import Array

FLATNESS = 0.003
"""m: how far a wall of a building leaves its straight line without being two walls."""
GRAZING_NOISE = 0.15
"""Part of the range noise that stays across the wall at grazing incidence (bearing jitter, width of the beam)."""
OUTLIER = 3.0
"""Standard deviations from the line beyond which a return is not of the wall."""


@njit(cache=True)
def total_least_squares(xy: Array, weights: Array) -> tuple[float, float, float, float]:
    """Centroid x, y (m) and unit normal x, y of the line through points (n, 2) with weights (n,)."""
    total, mx, my = 0.0, 0.0, 0.0
    for i in range(len(xy)):
        total += weights[i]
        mx += weights[i] * xy[i, 0]
        my += weights[i] * xy[i, 1]
    mx, my = mx / total, my / total
    sxx, sxy, syy = 0.0, 0.0, 0.0
    for i in range(len(xy)):
        dx, dy = xy[i, 0] - mx, xy[i, 1] - my
        sxx += weights[i] * dx * dx
        sxy += weights[i] * dx * dy
        syy += weights[i] * dy * dy
    angle = 0.5 * math.atan2(2.0 * sxy, sxx - syy)
    return mx, my, -math.sin(angle), math.cos(angle)


@njit(cache=True)
def across_variance(x: float, y: float, nx: float, ny: float, sigma: float) -> float:
    """Variance (m^2) across a line with normal (nx, ny) of a return at (x, y) with range noise sigma."""
    cosine = (nx * x + ny * y) / (math.hypot(x, y) + 1e-12)
    return sigma * sigma * (cosine * cosine + GRAZING_NOISE * GRAZING_NOISE)


@njit(cache=True)
def fit_line(xy: Array, sigma: float, out: Array, inlier: NDArray[np.bool_]) -> int:
    """Fits a line to the run xy (n, 2); returns the number of inliers.

    out: (8,) written: ends x1, y1, x2, y2 (m, scanner on the left from the first to the second), covariance of
    (offset m, angle rad) at the middle: oo, oa, aa, and the root mean square of the normalised distances.
    inlier: (n,) written: whether each point is of the line.
    """
    n = len(xy)
    weights = np.ones(n)
    mx, my, nx, ny = total_least_squares(xy, weights)
    count = n
    for _ in range(3):
        count = 0
        for i in range(n):
            variance = across_variance(xy[i, 0], xy[i, 1], nx, ny, sigma)
            distance = nx * (xy[i, 0] - mx) + ny * (xy[i, 1] - my)
            inlier[i] = distance * distance <= OUTLIER**2 * (variance + FLATNESS**2)
            weights[i] = 1.0 / variance if inlier[i] else 0.0
            count += 1 if inlier[i] else 0
        if count < 3:
            return count
        mx, my, nx, ny = total_least_squares(xy, weights)
    if nx * mx + ny * my > 0:  # the normal points to the scanner, to the left of the direction
        nx, ny = -nx, -ny
    _describe(xy, weights, mx, my, nx, ny, out)
    return count


@njit(cache=True)
def _describe(xy: Array, weights: Array, mx: float, my: float, nx: float, ny: float, out: Array) -> None:
    tx, ty = ny, -nx
    low, high = np.inf, -np.inf
    for i in range(len(xy)):
        if weights[i] > 0:
            s = tx * (xy[i, 0] - mx) + ty * (xy[i, 1] - my)
            low, high = min(low, s), max(high, s)
    middle = 0.5 * (low + high)
    w, ws, wss, chi2, count = 0.0, 0.0, 0.0, 0.0, 0
    for i in range(len(xy)):
        if weights[i] > 0:
            s = tx * (xy[i, 0] - mx) + ty * (xy[i, 1] - my) - middle
            e = nx * (xy[i, 0] - mx) + ny * (xy[i, 1] - my)
            w += weights[i]
            ws += weights[i] * s
            wss += weights[i] * s * s
            chi2 += weights[i] * e * e
            count += 1
    # e = offset + angle * s: the inverse of the normal equations is the covariance at the middle
    det = w * wss - ws * ws
    out[0], out[1] = mx + low * tx, my + low * ty
    out[2], out[3] = mx + high * tx, my + high * ty
    out[4], out[5], out[6] = wss / det, -ws / det, w / det
    out[7] = math.sqrt(chi2 / count)
