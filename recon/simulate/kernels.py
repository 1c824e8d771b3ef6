"""Compiled inner loops (numba): rays against segments, and the lookup of filtered textures."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

MAX_TAPS = 8
"""Most texture samples along a pixel's footprint."""


@njit(cache=True)
def bin_segments(segments: Any, corner: Any, shape: Any, cell: float) -> Any:
    """Which of segments (M, 4) pass near which square cells: start (rows * columns + 1,) and items, cell by cell.

    corner: (2,) m of cell (0, 0); shape: (2,) rows along x and columns along y; cell: m.
    """
    rows, columns = shape[0], shape[1]
    start = np.zeros(rows * columns + 1, np.int64)
    items = np.empty(0, np.int64)
    for fill in range(2):
        at = start[:-1].copy()
        for j in range(len(segments)):
            u0, u1 = _cells_between(segments[j, 0] - corner[0], segments[j, 2] - corner[0], cell, rows)
            v0, v1 = _cells_between(segments[j, 1] - corner[1], segments[j, 3] - corner[1], cell, columns)
            for u in range(u0, u1 + 1):
                for v in range(v0, v1 + 1):
                    if fill:
                        items[at[u * columns + v]] = j
                        at[u * columns + v] += 1
                    else:
                        start[u * columns + v + 1] += 1
        if not fill:
            start = np.cumsum(start)
            items = np.empty(start[-1], np.int64)
    return start, items


@njit(cache=True)
def _cells_between(a: float, b: float, cell: float, count: int) -> Any:
    """First and last of `count` cells that an interval touches, one nanometre to spare."""
    low, high = math.floor((min(a, b) - 1e-9) / cell), math.floor((max(a, b) + 1e-9) / cell)
    return min(max(low, 0), count - 1), min(max(high, 0), count - 1)


@njit(cache=True)
def cast_segments(segments: Any, start: Any, items: Any, corner: Any, shape: Any, cell: float, o: Any, d: Any) -> Any:
    """Nearest of segments (M, 4) along rays from o (N, 2) along d (N, 2): distances (N,), inf without a hit, and
    indices (N,), -1. start, items, corner, shape, cell: as `bin_segments` has them; cells are walked in order
    (Amanatides and Woo, 1987)."""
    distance, index = np.full(len(o), np.inf), np.full(len(o), -1, np.int64)
    for i in range(len(o)):
        x, y, dx, dy = o[i, 0] - corner[0], o[i, 1] - corner[1], d[i, 0], d[i, 1]
        t = _entry(x, y, dx, dy, shape[0] * cell, shape[1] * cell)
        u = min(max(math.floor((x + t * dx) / cell), 0), shape[0] - 1) if t < np.inf else -1
        v = min(max(math.floor((y + t * dy) / cell), 0), shape[1] - 1) if t < np.inf else -1
        step_u, step_v = (1 if dx > 0 else -1), (1 if dy > 0 else -1)
        next_u = ((u + (dx > 0)) * cell - x) / dx if dx != 0.0 else np.inf
        next_v = ((v + (dy > 0)) * cell - y) / dy if dy != 0.0 else np.inf
        best, which = np.inf, -1
        while 0 <= u < shape[0] and 0 <= v < shape[1]:
            for k in range(start[u * shape[1] + v], start[u * shape[1] + v + 1]):
                j = items[k]
                hit = _hit(segments[j], o[i, 0], o[i, 1], dx, dy)
                if hit < best or (hit == best and j < which):
                    best, which = hit, j
            if best <= min(next_u, next_v):
                break
            if next_u < next_v:
                u += step_u
                next_u += cell / abs(dx)
            else:
                v += step_v
                next_v += cell / abs(dy)
        distance[i], index[i] = best, which
    return distance, index


@njit(cache=True)
def _entry(x: float, y: float, dx: float, dy: float, width: float, height: float) -> float:
    """How far along a ray the box [0, width] x [0, height] begins; 0 inside, inf where the ray misses it."""
    near, far = 0.0, np.inf
    for p, q, size in ((x, dx, width), (y, dy, height)):
        if q == 0.0:
            if p < 0.0 or p > size:
                return np.inf
            continue
        near, far = max(near, min(-p / q, (size - p) / q)), min(far, max(-p / q, (size - p) / q))
    return near if near <= far else np.inf


@njit(cache=True)
def _hit(segment: Any, ox: float, oy: float, dx: float, dy: float) -> float:
    """Distance along a ray to a segment (4,), inf without a hit."""
    ax, ay = segment[0] - ox, segment[1] - oy
    ex, ey = segment[2] - segment[0], segment[3] - segment[1]
    cross = dx * ey - dy * ex
    if cross == 0.0:
        return np.inf
    share = (ax * dy - ay * dx) / cross
    if share < 0.0 or share > 1.0:
        return np.inf
    t = (ax * ey - ay * ex) / cross
    return t if t > 1e-9 else np.inf


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
