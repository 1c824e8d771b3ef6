"""Line segments of a scan by split-and-merge (paper 2.1).

Split: iterative end-point fit. Merge: neighbouring runs that one line explains as well as two. See Nguyen et al., "A
comparison of line extraction algorithms using 2D laser rangefinder for indoor mobile robotics", IROS 2005.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from recon.config import LidarConfig
from recon.geometry import Array
from recon.lidar.clusters import cluster
from recon.lidar.line_fit import FLATNESS, fit_line, total_least_squares
from recon.lidar.points import ScanPoints, scan_points
from recon.lidar.segment import Segments
from recon.sequence.sequence import Scans

Ints = NDArray[np.int64]

SPLIT_SIGMAS = 3.5
SPLIT_FLOOR = 0.02
"""m: what leaves the chord by less is never split (`SPLIT_SIGMAS` times the noise where that is more)."""
MERGE_CHI2 = 12.0
"""Rise of the squared distances, in units of the noise, up to which two runs become one line (2 degrees of freedom)."""
MAX_BRIDGE = 0.4
"""m: longest hole in a wall, e.g. behind a person's leg, that a segment goes on over."""
MAX_RMS = 2.0
"""Normalised root mean square above which a run is clutter and no line."""


def extract_segments(scans: Scans, index: int, config: LidarConfig, velocity: Array | None = None) -> Segments:
    """Line segments of scan `index` in the platform frame, counter-clockwise.

    velocity: (3,) m/s, m/s, rad/s of the platform in its own frame, to take out motion distortion where the scanner
    has a `time_increment` (`ScanMatching.velocities`). Where a segment crosses the seam of a full-circle scanner, its
    first beam is larger than its last. With `range_sigma` 0 the noise is estimated from the scans at every call: for
    many scans, resolve it once by `with_noise`.
    """
    from recon.lidar.noise import with_noise  # which itself finds segments

    config = with_noise(scans, config)
    points = scan_points(scans, index, velocity)
    lines, counts, runs, _, _ = find_segments(points, config)
    covariance = np.stack([lines[:, 4], lines[:, 5], lines[:, 5], lines[:, 6]], axis=1).reshape(-1, 2, 2)
    beams = points.beams[runs] if len(runs) else np.zeros((0, 2), np.int64)
    return Segments(lines[:, :4].reshape(-1, 2, 2).copy(), covariance, counts, beams)


def find_segments(points: ScanPoints, config: LidarConfig) -> tuple[Array, Ints, Ints, Ints, Ints]:
    """Lines (M, 8) as `fit_line` writes them, their counts (M,), runs (M, 2), and per point: segment and cluster.

    A run is the first and last inlier of a line, indices into `points`; segment and cluster are (n,), -1 for none.
    """
    label = cluster(points.xy, points.steps, points.step, config.range_sigma)
    kept = np.flatnonzero(label >= 0)
    lines, counts, spans, owner_kept = _find_lines(
        points.xy[kept], label[kept], config.range_sigma, config.min_points, config.min_length
    )
    owner = np.full(len(label), -1, np.int64)
    owner[kept] = owner_kept
    return lines, counts, kept[spans], owner, label


@njit(cache=True)
def _find_lines(
    xy: Array, label: Ints, sigma: float, min_points: int, min_length: float
) -> tuple[Array, Ints, Ints, Ints]:
    # plain loops throughout: array expressions make numba's first compilation several times longer
    runs = _split_clusters(xy, label, sigma)
    runs = runs[: _merge(xy, runs, label, sigma)]
    _move_cuts(xy, runs)
    lines, counts = np.zeros((len(runs), 8)), np.zeros(len(runs), np.int64)
    spans, owner = np.zeros((len(runs), 2), np.int64), np.full(len(xy), -1, np.int64)
    inlier = np.zeros(len(xy), np.bool_)
    m = 0
    for k in range(len(runs)):
        a, b = runs[k, 0], runs[k, 1] + 1
        if b - a < min_points:
            continue
        counts[m] = fit_line(xy[a:b], sigma, lines[m], inlier[a:b])
        length = math.hypot(lines[m, 2] - lines[m, 0], lines[m, 3] - lines[m, 1])
        if counts[m] < min_points or length < min_length or lines[m, 7] > MAX_RMS:
            continue
        spans[m, 0] = -1
        for i in range(a, b):
            if inlier[i]:
                owner[i] = m
                spans[m, 0] = i if spans[m, 0] < 0 else spans[m, 0]
                spans[m, 1] = i
        m += 1
    return lines[:m], counts[:m], spans[:m], owner


@njit(cache=True)
def _split_clusters(xy: Array, label: Ints, sigma: float) -> Ints:
    """First and last point (k, 2) of the pieces of all clusters that leave their chord by less than the tolerance."""
    n = len(xy)
    tolerance = max(SPLIT_SIGMAS * sigma, SPLIT_FLOOR)
    ends = np.zeros(n, np.bool_)  # last point of a piece
    stack, depth, first = np.zeros((n + 1, 2), np.int64), 0, 0
    for i in range(n):
        if i + 1 == n or label[i + 1] != label[i]:
            ends[i] = True
            stack[depth, 0], stack[depth, 1] = first, i
            depth += 1
            first = i + 1
    while depth > 0:
        depth -= 1
        a, b = stack[depth, 0], stack[depth, 1]
        at, deviation = _farthest(xy, a, b)
        if deviation > tolerance:
            ends[at] = True
            stack[depth, 0], stack[depth, 1] = a, at
            stack[depth + 1, 0], stack[depth + 1, 1] = at + 1, b
            depth += 2
    runs = np.zeros((n // 3 + 1, 2), np.int64)
    k, first = 0, 0
    for i in range(n):
        if ends[i]:
            if i - first >= 2:  # fewer than three points say nothing about a line
                runs[k, 0], runs[k, 1] = first, i
                k += 1
            first = i + 1
    return runs[:k]


@njit(cache=True)
def _farthest(xy: Array, a: int, b: int) -> tuple[int, float]:
    """The point between a and b farthest from their chord, and its distance (m)."""
    dx, dy = xy[b, 0] - xy[a, 0], xy[b, 1] - xy[a, 1]
    length = math.hypot(dx, dy) + 1e-12
    at, farthest = a, 0.0
    for i in range(a + 1, b):
        deviation = abs(dx * (xy[i, 1] - xy[a, 1]) - dy * (xy[i, 0] - xy[a, 0])) / length
        if deviation > farthest:
            at, farthest = i, deviation
    return at, farthest


@njit(cache=True)
def _merge(xy: Array, runs: Ints, label: Ints, sigma: float) -> int:
    """Joins neighbouring runs (k, 2), in place, that one line explains, the best pair first; how many are left."""
    k = len(runs)
    sums, cost = np.zeros((k, 6)), np.full(k, np.inf)
    for i in range(k):
        for p in range(runs[i, 0], runs[i, 1] + 1):
            x, y = xy[p, 0], xy[p, 1]
            for c, value in enumerate((1.0, x, y, x * x, x * y, y * y)):
                sums[i, c] += value
    for i in range(k - 1):
        cost[i] = _merge_cost(xy, runs, label, sums, i, sigma)
    while k > 1:
        best = 0
        for j in range(1, k - 1):
            best = j if cost[j] < cost[best] else best
        if cost[best] >= 1.0:
            break
        runs[best, 1] = runs[best + 1, 1]
        for c in range(6):
            sums[best, c] += sums[best + 1, c]
        k -= 1
        for j in range(best + 1, k):
            runs[j, 0], runs[j, 1] = runs[j + 1, 0], runs[j + 1, 1]
            for c in range(6):
                sums[j, c] = sums[j + 1, c]
        for j in range(best + 1, k):
            cost[j] = cost[j + 1]
        for j in range(max(best - 1, 0), min(best + 1, k - 1)):
            cost[j] = _merge_cost(xy, runs, label, sums, j, sigma)
    return k


@njit(cache=True)
def _merge_cost(xy: Array, runs: Ints, label: Ints, sums: Array, i: int, sigma: float) -> float:
    """How much worse one line is than two, in units of what noise and unevenness explain (below 1: one line)."""
    a, b = runs[i, 1], runs[i + 1, 0]
    if label[a] != label[b] and math.hypot(xy[b, 0] - xy[a, 0], xy[b, 1] - xy[a, 1]) > MAX_BRIDGE:
        return math.inf
    rise = _scatter(sums, i, i + 2) - _scatter(sums, i, i + 1) - _scatter(sums, i + 1, i + 2)
    paired = sums[i, 0] * sums[i + 1, 0] / (sums[i, 0] + sums[i + 1, 0])
    return rise / (MERGE_CHI2 * sigma * sigma + paired * FLATNESS * FLATNESS)


@njit(cache=True)
def _scatter(sums: Array, first: int, end: int) -> float:
    """Squared distances (m^2) to the total-least-squares line of runs with sums (k, 6) of 1, x, y, xx, xy, yy."""
    n, x, y, xx, xy, yy = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(first, end):
        n, x, y = n + sums[i, 0], x + sums[i, 1], y + sums[i, 2]
        xx, xy, yy = xx + sums[i, 3], xy + sums[i, 4], yy + sums[i, 5]
    sxx, sxy, syy = xx - x * x / n, xy - x * y / n, yy - y * y / n
    return max(0.0, 0.5 * (sxx + syy) - math.sqrt(0.25 * (sxx - syy) ** 2 + sxy * sxy))


@njit(cache=True)
def _move_cuts(xy: Array, runs: Ints) -> None:
    """Moves the cut between touching runs to where each point is nearer to its own line (in place)."""
    lines, ones = np.zeros((len(runs), 4)), np.ones(len(xy))
    for i in range(len(runs)):
        a, b = runs[i, 0], runs[i, 1] + 1
        margin = (b - a) // 4  # the line of the inner half is not bent by a misplaced cut
        mx, my, nx, ny = total_least_squares(xy[a + margin : b - margin], ones)
        lines[i, 0], lines[i, 1], lines[i, 2], lines[i, 3] = mx, my, nx, ny
    for i in range(len(runs) - 1):
        if runs[i + 1, 0] != runs[i, 1] + 1:
            continue
        low, high = (runs[i, 0] + runs[i, 1]) // 2, (runs[i + 1, 0] + runs[i + 1, 1]) // 2
        cost, best, cut = 0.0, 0.0, low
        for p in range(low + 1, high):
            cost += _square(xy, p, lines, i) - _square(xy, p, lines, i + 1)
            if cost < best:
                best, cut = cost, p
        runs[i, 1], runs[i + 1, 0] = cut, cut + 1


@njit(cache=True)
def _square(xy: Array, p: int, lines: Array, i: int) -> float:
    """Squared distance (m^2) of point p to line i."""
    distance = (xy[p, 0] - lines[i, 0]) * lines[i, 2] + (xy[p, 1] - lines[i, 1]) * lines[i, 3]
    return distance * distance
