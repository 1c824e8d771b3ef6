"""Compiled inner loops (numba): rays against segments, and the lookup of filtered textures."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

MAX_TAPS = 8
"""Most texture samples along a pixel's footprint."""


@njit(cache=True)
def cast_segments(segments: Any, origins: Any, directions: Any) -> Any:
    """Nearest of segments (M, 4) along rays (N, 2), (N, 2): distances (N,), inf without a hit, and indices (N,), -1."""
    n, m = origins.shape[0], segments.shape[0]
    distance = np.full(n, np.inf)
    index = np.full(n, -1, np.int64)
    for i in range(n):
        ox, oy, dx, dy = origins[i, 0], origins[i, 1], directions[i, 0], directions[i, 1]
        best, which = np.inf, -1
        for j in range(m):
            ax, ay = segments[j, 0] - ox, segments[j, 1] - oy
            ex, ey = segments[j, 2] - segments[j, 0], segments[j, 3] - segments[j, 1]
            cross = dx * ey - dy * ex
            if cross == 0.0:
                continue
            share = (ax * dy - ay * dx) / cross
            if share < 0.0 or share > 1.0:
                continue
            t = (ax * ey - ay * ex) / cross
            if 1e-9 < t < best:
                best, which = t, j
        distance[i], index[i] = best, which
    return distance, index


@njit(cache=True)
def _texel(
    texels: Any, decode: Any, base: int, width: int, height: int, x: float, y: float, out: Any, w: float
) -> None:
    """Add w times the bilinear sample at texel coordinates x, y (centres at halves), clamped at the border."""
    x, y = x - 0.5, y - 0.5
    x0, y0 = math.floor(x), math.floor(y)
    fx, fy = x - x0, y - y0
    for k in range(4):
        i, j = k & 1, k >> 1
        c = min(max(int(x0) + i, 0), width - 1)
        r = min(max(int(y0) + j, 0), height - 1)
        share = w * (fx if i else 1.0 - fx) * (fy if j else 1.0 - fy)
        at = base + 3 * (r * width + c)
        out[0] += share * decode[texels[at]]
        out[1] += share * decode[texels[at + 1]]
        out[2] += share * decode[texels[at + 2]]


@njit(cache=True)
def shade(
    origin: Any, rays: Any, step_x: Any, step_y: Any, surface: Any, blur: float,
    planes: Any, scales: Any, offsets: Any, sizes: Any, levels: Any, texels: Any, decode: Any,
) -> Any:  # fmt: skip
    """Colours (N, 3), linear, of rays (N, 3) from `origin` that hit the planes of `surface` (N,); -1 is black.

    step_x, step_y: (N, 3), how a ray changes to the next pixel: the footprint over which the texture is filtered
    (trilinear in the mip levels, several samples along the footprint's longer axis). blur: mip levels added.
    planes: (S, 12) origin, u, v, normal. scales: (S,) texels a metre. offsets (S, L), sizes (S, L, 2), levels (S,)
    say where each mip level lies in texels; row 0 is the top. decode: (256,) stored value to linear.
    """
    n = rays.shape[0]
    out = np.zeros((n, 3))
    grad = np.empty(4)
    for i in range(n):
        s = surface[i]
        if s < 0:
            continue
        p = planes[s]
        nd = p[9] * rays[i, 0] + p[10] * rays[i, 1] + p[11] * rays[i, 2]
        no = p[9] * (p[0] - origin[0]) + p[10] * (p[1] - origin[1]) + p[11] * (p[2] - origin[2])
        t = no / nd
        hx = origin[0] + t * rays[i, 0] - p[0]
        hy = origin[1] + t * rays[i, 1] - p[1]
        hz = origin[2] + t * rays[i, 2] - p[2]
        u = hx * p[3] + hy * p[4] + hz * p[5]
        v = hx * p[6] + hy * p[7] + hz * p[8]
        for axis in range(2):
            d = step_x[i] if axis == 0 else step_y[i]
            dn = (p[9] * d[0] + p[10] * d[1] + p[11] * d[2]) / nd
            gx, gy, gz = d[0] - dn * rays[i, 0], d[1] - dn * rays[i, 1], d[2] - dn * rays[i, 2]
            grad[2 * axis] = t * (gx * p[3] + gy * p[4] + gz * p[5]) * scales[s]
            grad[2 * axis + 1] = -t * (gx * p[6] + gy * p[7] + gz * p[8]) * scales[s]
        _filtered(out[i], u * scales[s], sizes[s, 0, 0] - v * scales[s], grad, blur,
                  offsets[s], sizes[s], levels[s], texels, decode)  # fmt: skip
    return out


@njit(cache=True)
def _filtered(
    out: Any,
    x: float,
    y: float,
    grad: Any,
    blur: float,
    offsets: Any,
    sizes: Any,
    levels: int,
    texels: Any,
    decode: Any,
) -> None:
    """The texture at texel x, y of level 0, averaged over the footprint that grad (4,) spans."""
    a = math.hypot(grad[0], grad[1])
    b = math.hypot(grad[2], grad[3])
    major, minor = max(a, b), max(min(a, b), 1e-6)
    gx, gy = (grad[0], grad[1]) if a >= b else (grad[2], grad[3])
    taps = int(min(max(math.ceil(major / max(minor, 1.0)), 1.0), MAX_TAPS))
    lod = min(max(math.log2(max(major / taps, 1e-6)) + blur, 0.0), levels - 1.0)
    low = int(lod)
    for k in range(taps):
        shift = (k + 0.5) / taps - 0.5
        for level in range(low, min(low + 2, levels)):
            weight = (1.0 - (lod - low)) if level == low else lod - low
            if weight > 0.0:
                h, w = sizes[level, 0], sizes[level, 1]
                sx, sy = w / sizes[0, 1], h / sizes[0, 0]
                _texel(texels, decode, offsets[level], w, h, (x + shift * gx) * sx, (y + shift * gy) * sy,
                       out, weight / taps)  # fmt: skip
