"""Exposure of every image, from the points that several images see, over the whole sequence at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array

PRIOR = 0.25
"""Standard deviation of the logarithm of a gain: keeps what no overlap fixes, and slow drifts, near 1."""
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
    """Minimises sum rho(|logs + g[view] - c[point]| / NOISE) + sum |g / PRIOR|^2 over gains g and colours c.

    points, views: (S,); logs: (S, 3). Returns g (count, 3). rho is Geman-McClure's (iteratively reweighted): shine and
    clutter in front of a point have no say. The colours are eliminated (Schur complement), so the system has `count`
    unknowns.
    """
    from scipy import sparse
    from scipy.sparse.linalg import spsolve

    _, index = np.unique(points, return_inverse=True)
    n = int(index.max()) + 1
    weights = np.ones(len(points))
    gains = np.zeros((count, 3))
    for _ in range(ITERATIONS):
        w = sparse.csr_matrix((weights, (views, index)), shape=(count, n))
        total = np.maximum(np.asarray(w.sum(axis=0)).ravel(), 1e-12)
        means = np.stack([np.bincount(index, weights * logs[:, c], n) for c in range(3)], axis=1) / total[:, None]
        per_view = np.asarray(w.sum(axis=1)).ravel()
        normal = sparse.diags(per_view + (NOISE / PRIOR) ** 2) - w @ sparse.diags(1 / total) @ w.T
        away = weights[:, None] * (means[index] - logs)
        right = np.stack([np.bincount(views, away[:, c], count) for c in range(3)], axis=1)
        gains = np.asarray(spsolve(normal.tocsc(), right)).reshape(count, 3)
        moved = logs + gains[views]
        colours = np.stack([np.bincount(index, weights * moved[:, c], n) for c in range(3)], axis=1) / total[:, None]
        residual = np.abs(moved - colours[index]).max(axis=1)
        weights = 1 / (1 + (residual / NOISE) ** 2) ** 2
    return gains
