"""Straight line segments from chains of edge points: split, fit, merge."""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array

SPLIT_TOLERANCE = 1.2  # px, largest distance of a point from the chord of its piece
MIN_POINTS = 8
TRIM = 2.5  # points further than this many rms from a first fit (corners, junctions) do not take part in the second
MERGE_RMS = 0.5  # px, of the points of two pieces about one common line
MERGE_DISTANCE = 1.5  # px, of the ends of one piece from the line of the other
MERGE_OVERLAP = 4.0  # px
GAP_ALWAYS, GAP_SHARE, GAP_MOST = 10.0, 0.3, 60.0  # px; share of both lengths; px: the gap that a merger may close
MERGE_COSINE = 0.7  # of the gradients: two edges of a thin dark line look the opposite way and stay apart


@dataclass(frozen=True)
class Segments:
    """Straight segments. endpoints: (L, 2, 2) px, the brighter side on the right hand going from first to second as
    one sees the image (y down); sigmas: (L,) px, root mean square distance of the edge points from the line.

    Longest first.
    """

    endpoints: Array
    sigmas: Array


def fit_segments(
    points: Array, gradients: Array, starts: NDArray[np.int64], stretch: Array, min_length: float, sigma_floor: float
) -> Segments:
    """Split chains of points into straight pieces, fit them by total least squares, merge collinear neighbours.

    points: (P, 2) px, gradients: (P, 2) unit, starts: (C + 1,) as in EdgeChains; stretch: (P,) how many px of these
    coordinates one pixel of the image takes; nan points are left out. All tolerances, `min_length` and `sigma_floor`
    (the least standard deviation of an edge point) are pixels of the image.
    """
    valid = np.isfinite(points).all(axis=1) & np.isfinite(stretch)
    kept = np.concatenate([[0], np.cumsum(valid)])[starts]
    points, gradients, stretch = points[valid], gradients[valid], stretch[valid]
    pieces = _split(points, stretch, kept, SPLIT_TOLERANCE, MIN_POINTS)
    moments, ends, fronts, scales = _fit_pieces(points, gradients, stretch, pieces)
    order = np.argsort(-_image_lengths(ends, scales), kind="stable")
    moments, ends, fronts, scales = moments[order], ends[order], fronts[order], scales[order]
    alive = _merge(moments, ends, fronts, scales)
    alive &= _image_lengths(ends, scales) >= min_length
    endpoints, rms = ends[alive], _rms(moments[alive])
    sigmas = np.maximum(rms, sigma_floor) * scales[alive]
    order = np.argsort(-np.linalg.norm(endpoints[:, 1] - endpoints[:, 0], axis=1), kind="stable")
    return Segments(endpoints[order], sigmas[order])


def _image_lengths(ends: Array, scales: Array) -> Array:
    """(n,) lengths in pixels of the image."""
    return np.asarray(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) / scales)


@numba.njit(cache=True)
def _split(
    points: Array, stretch: Array, starts: NDArray[np.int64], tolerance: float, min_points: int
) -> NDArray[np.int64]:
    """Pieces (n, 2), first and past-the-end point: split at the point farthest from the chord until none is too far."""
    pieces = np.empty((len(points) + 1, 2), np.int64)
    stack = np.empty((len(points) + 1, 2), np.int64)
    n = 0
    for chain in range(len(starts) - 1):
        stack[0, 0], stack[0, 1] = starts[chain], starts[chain + 1]
        depth = 1
        while depth > 0:
            depth -= 1
            a, b = stack[depth, 0], stack[depth, 1]
            if b - a < min_points:
                continue
            x0, y0 = points[a, 0], points[a, 1]
            ux, uy = points[b - 1, 0] - x0, points[b - 1, 1] - y0
            length = np.hypot(ux, uy)
            worst, at = tolerance, -1
            for i in range(a, b):
                x, y = points[i, 0] - x0, points[i, 1] - y0
                # A closed chain has no chord: the distance from its first point splits it at the far side.
                d = abs(ux * y - uy * x) / length if length > 1e-6 else np.hypot(x, y)
                if d / stretch[i] > worst:
                    worst, at = d / stretch[i], i
            if at < 0:
                pieces[n, 0], pieces[n, 1] = a, b
                n += 1
            else:
                stack[depth, 0], stack[depth, 1] = at, b
                stack[depth + 1, 0], stack[depth + 1, 1] = a, at + 1
                depth += 2
    return pieces[:n]


@numba.njit(cache=True)
def _line(m: Array) -> tuple[float, float, float, float, float]:
    """Centre x, y, direction x, y and rms residual (image px) of the total-least-squares line of moments (7,).

    Moments: number of points, then the sums of w, w x, w y, w x x, w x y, w y y with w = 1 / stretch^2.
    """
    cx, cy = m[2] / m[1], m[3] / m[1]
    sxx, sxy, syy = m[4] / m[1] - cx * cx, m[5] / m[1] - cx * cy, m[6] / m[1] - cy * cy
    angle = 0.5 * np.arctan2(2.0 * sxy, sxx - syy)
    ux, uy = np.cos(angle), np.sin(angle)
    least = max(0.0, uy * uy * sxx - 2.0 * ux * uy * sxy + ux * ux * syy)
    return cx, cy, ux, uy, np.sqrt(least * m[1] / m[0])


@numba.njit(cache=True)
def _moments(points: Array, stretch: Array, a: int, b: int, line: tuple[float, ...], limit: float, into: Array) -> None:
    """Put the moments (7,) of the points a to b - 1 that are within `limit` (image px) of a line into `into`."""
    cx, cy, ux, uy, _ = line
    n, w_, x_, y_, xx, xy, yy = 0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(a, b):
        x, y, s = points[i, 0], points[i, 1], stretch[i]
        if abs(ux * (y - cy) - uy * (x - cx)) > limit * s:
            continue
        w = 1.0 / (s * s)
        n += 1
        w_, x_, y_ = w_ + w, x_ + w * x, y_ + w * y
        xx, xy, yy = xx + w * x * x, xy + w * x * y, yy + w * y * y
    into[0], into[1], into[2], into[3], into[4], into[5], into[6] = n, w_, x_, y_, xx, xy, yy


@numba.njit(cache=True)
def _fit_pieces(
    points: Array, gradients: Array, stretch: Array, pieces: NDArray[np.int64]
) -> tuple[Array, Array, Array, Array]:
    """Moments (n, 7), ends (n, 2, 2), mean unit gradients (n, 2) and mean stretch (n,) of pieces (n, 2)."""
    n = len(pieces)
    moments, ends = np.zeros((n, 7)), np.zeros((n, 2, 2))
    fronts, scales = np.zeros((n, 2)), np.zeros(n)
    for p in range(n):
        a, b = pieces[p, 0], pieces[p, 1]
        _moments(points, stretch, a, b, (0.0, 0.0, 1.0, 0.0, 0.0), np.inf, moments[p])
        line = _line(moments[p])
        limit = max(TRIM * line[4], 0.1)
        _moments(points, stretch, a, b, line, limit, moments[p])
        cx, cy, ux, uy, _ = line
        low, high, gx, gy, scale = np.inf, -np.inf, 0.0, 0.0, 0.0
        for i in range(a, b):
            x, y = points[i, 0] - cx, points[i, 1] - cy
            if abs(ux * y - uy * x) > limit * stretch[i]:
                continue
            gx, gy, scale = gx + gradients[i, 0], gy + gradients[i, 1], scale + stretch[i]
            low, high = min(low, ux * x + uy * y), max(high, ux * x + uy * y)
        norm = np.hypot(gx, gy) + 1e-12
        fronts[p, 0], fronts[p, 1], scales[p] = gx / norm, gy / norm, scale / moments[p, 0]
        ends[p, 0, 0], ends[p, 0, 1] = cx + low * ux, cy + low * uy
        ends[p, 1, 0], ends[p, 1, 1] = cx + high * ux, cy + high * uy
        _project_ends(moments[p], ends[p], fronts[p])
    return moments, ends, fronts, scales


@numba.njit(cache=True)
def _project_ends(m: Array, ends: Array, front: Array) -> None:
    """Put the ends (2, 2) on the line of the moments (7,), ordered with the brighter side on the right hand."""
    cx, cy, ux, uy, _ = _line(m)
    if ux * front[1] - uy * front[0] < 0:  # y points down: a positive cross product is on the right
        ux, uy = -ux, -uy
    t0 = ux * (ends[0, 0] - cx) + uy * (ends[0, 1] - cy)
    t1 = ux * (ends[1, 0] - cx) + uy * (ends[1, 1] - cy)
    low, high = min(t0, t1), max(t0, t1)
    ends[0, 0], ends[0, 1] = cx + low * ux, cy + low * uy
    ends[1, 0], ends[1, 1] = cx + high * ux, cy + high * uy


@numba.njit(cache=True)
def _gap(ends: Array, i: int, j: int, limit: float) -> float:
    """Gap along the line of piece i to piece j, negative where they overlap; inf if j is off it by over `limit`."""
    x0, y0 = ends[i, 0, 0], ends[i, 0, 1]
    dx, dy = ends[i, 1, 0] - x0, ends[i, 1, 1] - y0
    length = np.sqrt(dx * dx + dy * dy)
    ux, uy = dx / length, dy / length
    low, high = np.inf, -np.inf
    for k in range(2):
        x, y = ends[j, k, 0] - x0, ends[j, k, 1] - y0
        if abs(ux * y - uy * x) > limit:
            return np.inf
        low, high = min(low, ux * x + uy * y), max(high, ux * x + uy * y)
    return max(low - length, -high)


@numba.njit(cache=True)
def _joined(moments: Array, ends: Array, i: int, j: int, scale: float, both: Array) -> bool:
    """Whether the line of pieces i and j together stays close to its points and to the four ends.

    both: (7,), on return the moments of the two.
    """
    for k in range(7):
        both[k] = moments[i, k] + moments[j, k]
    cx, cy, ux, uy, rms = _line(both)
    if rms > MERGE_RMS:
        return False
    for p in (i, j):
        for k in range(2):
            if abs(ux * (ends[p, k, 1] - cy) - uy * (ends[p, k, 0] - cx)) > 0.67 * MERGE_DISTANCE * scale:
                return False
    return True


@numba.njit(cache=True)
def _merge(moments: Array, ends: Array, fronts: Array, scales: Array) -> NDArray[np.bool_]:
    """Join collinear neighbours in place, longest first, the nearest neighbour first; (n,) which pieces remain."""
    n = len(moments)
    alive = np.ones(n, np.bool_)
    both = np.empty(7)
    for i in range(n):
        best = i if alive[i] else -1
        while best >= 0:
            best, least = -1, np.inf
            for j in range(n):
                facing = fronts[i, 0] * fronts[j, 0] + fronts[i, 1] * fronts[j, 1]
                if j == i or not alive[j] or facing < MERGE_COSINE:
                    continue
                scale = max(scales[i], scales[j])
                gap = _gap(ends, i, j, MERGE_DISTANCE * scale)
                if gap >= least or gap < -MERGE_OVERLAP * scale or gap > _allowed_gap(ends, i, j, scale):
                    continue
                if _joined(moments, ends, i, j, scale, both):
                    best, least = j, gap
            if best >= 0:
                _absorb(moments, ends, fronts, scales, i, best)
                alive[best] = False
    return alive


@numba.njit(cache=True)
def _allowed_gap(ends: Array, i: int, j: int, scale: float) -> float:
    """The widest gap between pieces i and j that may be closed."""
    total = 0.0
    for p in (i, j):
        total += np.hypot(ends[p, 1, 0] - ends[p, 0, 0], ends[p, 1, 1] - ends[p, 0, 1])
    return min(max(GAP_ALWAYS * scale, GAP_SHARE * total), GAP_MOST * scale)


@numba.njit(cache=True)
def _absorb(moments: Array, ends: Array, fronts: Array, scales: Array, i: int, j: int) -> None:
    """Piece i becomes i and j together."""
    share = moments[j, 0] / (moments[i, 0] + moments[j, 0])
    scales[i] += share * (scales[j] - scales[i])
    gx = fronts[i, 0] + share * (fronts[j, 0] - fronts[i, 0])
    gy = fronts[i, 1] + share * (fronts[j, 1] - fronts[i, 1])
    norm = np.hypot(gx, gy) + 1e-12
    fronts[i, 0], fronts[i, 1] = gx / norm, gy / norm
    for k in range(7):
        moments[i, k] += moments[j, k]
    cx, cy, ux, uy, _ = _line(moments[i])
    low, high = np.inf, -np.inf
    for p in (i, j):
        for k in range(2):
            t = ux * (ends[p, k, 0] - cx) + uy * (ends[p, k, 1] - cy)
            low, high = min(low, t), max(high, t)
    ends[i, 0, 0], ends[i, 0, 1] = cx + low * ux, cy + low * uy
    ends[i, 1, 0], ends[i, 1, 1] = cx + high * ux, cy + high * uy
    _project_ends(moments[i], ends[i], fronts[i])


@numba.njit(cache=True)
def _rms(moments: Array) -> NDArray[np.float64]:
    """(n,) rms distance of the points from their line, image px."""
    out = np.empty(len(moments))
    for i in range(len(moments)):
        out[i] = _line(moments[i])[4]
    return out
