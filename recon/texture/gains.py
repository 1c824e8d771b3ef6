"""Exposure of every image, from the points that several images see, over the whole sequence at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array

SHRINK, SHRINK_HUE = 0.03, 0.3
"""Pull of gains towards 1, as a share of an image's samples: brightness, hue. Jumps from image to image are evened out,
slow changes stay, as cameras and eyes adapt to dark and bright rooms and one exposure for all would burn out."""
NOISE = 0.15
"""Standard deviation of one sample's logarithm: mixed pixels, shine, misalignment; samples are not independent."""
ITERATIONS = 12
DARKEST, BRIGHTEST = 10, 248
"""Samples with a channel outside are clipped or noise."""


class ExposureSamples:
    """Colours of the same surface points in several images."""

    def __init__(self) -> None:
        self._points: list[NDArray[np.int64]] = []
        self._views: list[NDArray[np.int64]] = []
        self._logs: list[NDArray[np.float32]] = []

    def add(self, points: NDArray[np.int64], view: int, colours: NDArray[np.uint8]) -> None:
        """Points by number (n,), as image `view` sees them: colours (n, 3), clipped and dark ones are left out."""
        use = (colours.min(axis=1) >= DARKEST) & (colours.max(axis=1) <= BRIGHTEST)
        self._points.append(points[use])
        self._views.append(np.full(int(use.sum()), view, np.int64))
        self._logs.append(np.log(colours[use].astype(np.float32)))

    def gains(self, views: int) -> Array:
        """(views, 3): factor on each image's channels that makes all images agree; 1 where nothing is known."""
        if not self._points:
            return np.ones((views, 3))
        points, owners = np.concatenate(self._points), np.concatenate(self._views)
        if len(points) == 0:
            return np.ones((views, 3))
        return np.exp(solve_log_gains(points, owners, np.concatenate(self._logs).astype(np.float64), views))


def solve_log_gains(points: NDArray[np.int64], views: NDArray[np.int64], logs: Array, count: int) -> Array:
    """Minimises sum rho(|logs + g[view] - c[point]| / NOISE) + pull of g to 0 over gains g and colours c.

    points, views: (S,); logs: (S, 3). Returns g (count, 3). rho is Geman-McClure's (iteratively reweighted): shine and
    clutter in front of a point have no say. The colours are eliminated (Schur complement), so the system has `count`
    unknowns. The mean of the channels (brightness) and what is left (hue) are solved for apart.
    """
    _, index = np.unique(points, return_inverse=True)
    n = int(index.max()) + 1
    brightness = np.tile(logs.mean(axis=1, keepdims=True), 3)
    weights = np.ones(len(points))
    gains = np.zeros((count, 3))
    for _ in range(ITERATIONS):
        samples = _Samples(index, views, weights, n, count)
        gains = samples.solve(brightness, SHRINK) + samples.solve(logs - brightness, SHRINK_HUE)
        moved = logs + gains[views]
        residual = np.abs(moved - samples.means(moved)[index]).max(axis=1)
        weights = 1 / (1 + (residual / NOISE) ** 2) ** 2
    return gains


@dataclass(frozen=True)
class _Samples:
    """Weighted samples (S,) of `points` points in `count` views."""

    index: NDArray[np.int64]
    views: NDArray[np.int64]
    weights: Array
    points: int
    count: int

    def means(self, values: Array) -> Array:
        """Weighted mean (points, 3) of values (S, 3)."""
        total = np.maximum(np.bincount(self.index, self.weights, self.points), 1e-12)
        sums = [np.bincount(self.index, self.weights * column, self.points) for column in values.T]
        return np.stack(sums, axis=1) / total[:, None]

    def solve(self, values: Array, shrink: float) -> Array:
        """What to add (count, 3) to all values of a view so that views agree at every point."""
        from scipy import sparse
        from scipy.sparse.linalg import spsolve

        w = sparse.csr_matrix((self.weights, (self.views, self.index)), shape=(self.count, self.points))
        total = np.maximum(np.bincount(self.index, self.weights, self.points), 1e-12)
        per_view = np.bincount(self.views, self.weights, self.count)
        normal = sparse.diags(per_view * (1 + shrink) + 1e-6) - w @ sparse.diags(1 / total) @ w.T
        away = self.weights[:, None] * (self.means(values)[self.index] - values)
        right = np.stack([np.bincount(self.views, column, self.count) for column in away.T], axis=1)
        return np.asarray(spsolve(normal.tocsc(), right)).reshape(self.count, 3)
