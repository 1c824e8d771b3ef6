"""Directions of a building: the Manhattan pair, and further ones where walls stand askew (paper 2.1)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from recon.geometry import Array

BINS_PER_DEGREE = 4
BANDWIDTH = np.radians(1.0)
"""rad, standard deviation of the histogram's kernel."""
TOLERANCE = np.radians(5.0)
"""rad within which a segment is of a direction."""
GROUP_TOLERANCE = np.radians(10.0)
"""rad within which a segment of a single scan is of a Manhattan direction."""
MIN_SHARE = 0.06
"""A further direction holds at least this part of all weight."""
MAX_DIRECTIONS = 8


@dataclass(frozen=True)
class Directions:
    """Undirected directions of a building: D lines through the origin.

    angles: (D,) rad in [0, pi). The first two are the Manhattan pair, at right angles, the better supported one
    first; the others follow by support. support: (D,) weight within `TOLERANCE` of each.
    """

    angles: Array
    support: Array

    def __len__(self) -> int:
        return len(self.angles)

    def assign(self, angles: ArrayLike, tolerance: float = TOLERANCE) -> NDArray[np.int64]:
        """(M,) index of the nearest direction of each angle (M,) rad, -1 where none is within `tolerance` rad."""
        given = np.atleast_1d(np.asarray(angles, dtype=np.float64))
        if len(self) == 0 or len(given) == 0:
            return np.full(len(given), -1, np.int64)
        apart = np.abs(_residual(given[:, None], self.angles, np.pi))
        nearest = np.argmin(apart, axis=1)
        return np.where(apart[np.arange(len(given)), nearest] <= tolerance, nearest, -1)


def principal_directions(angles: ArrayLike, weights: ArrayLike) -> Directions:
    """The directions of segments with `angles` (M,) rad and `weights` (M,), e.g. their lengths in m.

    The Manhattan pair is the peak of the weighted histogram of the angles modulo 90 degrees, smoothed by a kernel and
    refined by a robust mean. Peaks of what is then left, modulo 180 degrees, are the further directions. No segments
    give no directions.
    """
    a, w = np.asarray(angles, dtype=np.float64), np.asarray(weights, dtype=np.float64)
    if len(a) == 0 or w.sum() <= 0:
        return Directions(np.zeros(0), np.zeros(0))
    first = _peak(a, w, np.pi / 2)
    found = [first, (first + np.pi / 2) % np.pi]
    left = w.copy()
    for direction in found:
        left[np.abs(_residual(a, direction, np.pi)) <= TOLERANCE] = 0.0
    while len(found) < MAX_DIRECTIONS and left.sum() > MIN_SHARE * w.sum():
        direction = _peak(a, left, np.pi)
        near = np.abs(_residual(a, direction, np.pi)) <= TOLERANCE
        if left[near].sum() < MIN_SHARE * w.sum():
            break
        found.append(direction)
        left[near] = 0.0
    support = np.array([w[np.abs(_residual(a, d, np.pi)) <= TOLERANCE].sum() for d in found])
    order = np.concatenate([np.argsort(-support[:2], kind="stable"), 2 + np.argsort(-support[2:], kind="stable")])
    return Directions(np.array(found)[order], support[order])


def manhattan_groups(endpoints: Array) -> NDArray[np.int64]:
    """(M,) the two sets of the paper for segments (M, 2, 2) of one scan: 0 or 1, -1 for walls askew of both.

    Direction 0 is the better supported one.
    """
    delta = np.asarray(endpoints, dtype=np.float64).reshape(-1, 2, 2)
    delta = delta[:, 1] - delta[:, 0]
    angles = np.arctan2(delta[:, 1], delta[:, 0])
    pair = principal_directions(angles, np.hypot(delta[:, 0], delta[:, 1]))
    return Directions(pair.angles[:2], pair.support[:2]).assign(angles, GROUP_TOLERANCE)


def _residual(angles: ArrayLike, direction: ArrayLike, period: float) -> Array:
    """Signed difference angles - direction, rad, in [-period/2, period/2)."""
    return np.asarray(
        (np.asarray(angles, dtype=np.float64) - np.asarray(direction, dtype=np.float64) + period / 2) % period
        - period / 2
    )


def _peak(angles: Array, weights: Array, period: float) -> float:
    """The strongest direction modulo `period` rad, in [0, period)."""
    bins = round(np.degrees(period) * BINS_PER_DEGREE)
    index = np.floor((angles % period) / period * bins).astype(np.int64) % bins
    histogram = np.bincount(index, weights, bins)
    offsets = _residual(np.arange(bins) * period / bins, 0.0, period)
    kernel = np.exp(-0.5 * (offsets / BANDWIDTH) ** 2)
    smooth = np.fft.irfft(np.fft.rfft(histogram) * np.fft.rfft(kernel), bins)
    peak = (int(np.argmax(smooth)) + 0.5) * period / bins
    for _ in range(10):  # mean shift with a kernel that lets outliers go
        residual = _residual(angles, peak, period)
        robust = weights * np.exp(-0.5 * (residual / BANDWIDTH) ** 2)
        if robust.sum() <= 0:
            break
        peak += float((robust * residual).sum() / robust.sum())
    return float(peak % period)
