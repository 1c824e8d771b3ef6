"""Exposure of every image and shading of the lens, over the whole sequence at once, from what several images see."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array
from recon.texture.fixed import Fixed, Seen, find_fixed

SHRINK, SHRINK_HUE = 0.03, 0.3
"""Pull of gains towards 1, as a share of an image's samples: brightness, hue. Jumps from image to image are evened out,
slow changes stay, as cameras and eyes adapt to dark and bright rooms and one exposure for all would burn out."""
NOISE = 0.15
"""Standard deviation of one sample's logarithm: mixed pixels, shine, misalignment; samples are not independent."""
ITERATIONS = 12
FLAT = 0.002
"""Pull of the lens's shading to none, as a share of all samples."""
DARKEST, BRIGHTEST = 10, 248
"""Samples with a channel outside are clipped or noise."""
MOST_SAMPLES = 600_000
"""Held at a time, whatever the number of images: of more, those of every second point go, again and again."""


@dataclass(frozen=True)
class Exposure:
    """gains: (views, 3), factor on each image's channels that makes all images agree, 1 where nothing is known.

    shading: (2,), a and b of the lens's vignetting: exp(a r^2 + b r^4) times the light arrives at r, the distance from
    the middle of the image as a share of that of its corners.

    fixed: what lies over the same places of all images.
    """

    gains: Array
    shading: Array
    fixed: Fixed | None = None

    def light(self, radius: Array) -> Array:
        """Logarithm of the share of light at r, `radius` (...)."""
        square = np.asarray(radius) ** 2
        return np.asarray(self.shading[0] * square + self.shading[1] * square**2)


class ExposureSamples:
    """Colours of the same surface points in several images, MOST_SAMPLES at most."""

    def __init__(self) -> None:
        self._stride, self._held = 1, 0
        self._points: list[NDArray[np.int64]] = []
        self._views: list[NDArray[np.int64]] = []
        self._logs: list[NDArray[np.float32]] = []
        self._radii: list[NDArray[np.float32]] = []
        self._cells: list[NDArray[np.int16]] = []
        self._valid: list[NDArray[np.bool_]] = []

    def add(
        self,
        points: NDArray[np.int64],
        view: int,
        colours: NDArray[np.uint8],
        radius: Array,
        cells: NDArray[np.int64],
    ) -> None:
        """Points by number (n,), as image `view` sees them: colours (n, 3), clipped ones are left out, at distances
        `radius` (n,) from the middle of the image (1: its corners), in its `cells` (n,), `fixed.cell_of`."""
        use = (colours.max(axis=1) <= BRIGHTEST) & (_scattered(points) % self._stride == 0)
        self._points.append(points[use])
        self._views.append(np.full(int(use.sum()), view, np.int64))
        self._logs.append(np.log(np.maximum(colours[use], 1).astype(np.float32)))
        self._radii.append(radius[use].astype(np.float32))
        self._cells.append(cells[use].astype(np.int16))
        self._valid.append(colours[use].min(axis=1) >= DARKEST)
        self._held += len(self._points[-1])
        while self._held > MOST_SAMPLES:
            self._thin()

    def _thin(self) -> None:
        """Half of the points: all samples of one stay together, since what counts is how images differ there."""
        self._stride *= 2
        kept = [_scattered(points) % self._stride == 0 for points in self._points]
        self._points = [part[use] for part, use in zip(self._points, kept, strict=True)]
        self._views = [part[use] for part, use in zip(self._views, kept, strict=True)]
        self._logs = [part[use] for part, use in zip(self._logs, kept, strict=True)]
        self._radii = [part[use] for part, use in zip(self._radii, kept, strict=True)]
        self._cells = [part[use] for part, use in zip(self._cells, kept, strict=True)]
        self._valid = [part[use] for part, use in zip(self._valid, kept, strict=True)]
        self._held = sum(map(len, self._points))

    def solve(self, views: int) -> Exposure:
        """Of `views` images. What is dark tells nothing."""
        if not sum(int(part.sum()) for part in self._valid):
            return Exposure(np.ones((views, 3)), np.zeros(2))
        use = np.concatenate(self._valid)
        points, owners = np.concatenate(self._points)[use], np.concatenate(self._views)[use]
        logs, radii = (np.concatenate(parts)[use].astype(np.float64) for parts in (self._logs, self._radii))
        gains, shading = solve_log_gains(points, owners, logs, radii, views)
        return Exposure(np.exp(gains), shading)

    def fixed(self, exposure: Exposure) -> Fixed | None:
        """What lies over the same places of all images, by these samples with their exposure made up for."""
        if not self._held:
            return None
        points, views = np.concatenate(self._points), np.concatenate(self._views)
        cells = np.concatenate(self._cells)
        light = exposure.light(np.concatenate(self._radii).astype(np.float64))
        logs = np.concatenate(self._logs) + np.log(exposure.gains)[views] - light[:, None]
        numbers = np.unique(points, return_inverse=True)[1]
        return find_fixed(Seen(numbers, views, cells.astype(np.int64), logs, np.concatenate(self._valid)))


def _scattered(points: NDArray[np.int64]) -> NDArray[np.int64]:
    """Numbers of points without the order that they lie in (multiplicative hashing, Knuth vol. 3, section 6.4)."""
    return (points * 2654435761 & 0xFFFFFFFF) >> 8


def solve_log_gains(
    points: NDArray[np.int64], views: NDArray[np.int64], logs: Array, radii: Array, count: int
) -> tuple[Array, Array]:
    """Minimises sum rho(|logs - V(radii) + g[view] - c[point]| / NOISE) + pull of g and V to 0 over g, c and V.

    points, views, radii: (S,); logs: (S, 3). Returns g (count, 3) and (a, b) of V = a r^2 + b r^4. rho is
    Geman-McClure's (iteratively reweighted): shine and clutter in front of a point have no say. The colours c are
    eliminated (Schur complement), so the system has `count` unknowns. The mean of the channels (brightness) and what is
    left (hue) are solved for apart, and V in turn with them.
    """
    _, index = np.unique(points, return_inverse=True)
    n = int(index.max()) + 1
    powers = np.stack([radii**2, radii**4], axis=1)
    weights = np.ones(len(points))
    gains, shading = np.zeros((count, 3)), np.zeros(2)
    for _ in range(ITERATIONS):
        samples = _Samples(index, views, weights, n, count)
        even = logs - (powers @ shading)[:, None]
        brightness = np.tile(even.mean(axis=1, keepdims=True), 3)
        gains = samples.solve(brightness, SHRINK) + samples.solve(even - brightness, SHRINK_HUE)
        shading = samples.shading((logs + gains[views]).mean(axis=1), powers)
        moved = logs + gains[views] - (powers @ shading)[:, None]
        residual = np.abs(moved - samples.means(moved)[index]).max(axis=1)
        weights = 1 / (1 + (residual / NOISE) ** 2) ** 2
    return gains, shading


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

    def shading(self, values: Array, powers: Array) -> Array:
        """(2,) factors on `powers` (S, 2) that best explain why values (S,) of one point differ."""
        away = powers - self.means(powers)[self.index]
        left = values - self.means(values[:, None])[self.index, 0]
        normal = (away * self.weights[:, None]).T @ away + FLAT * self.weights.sum() * np.eye(2)
        return np.asarray(np.linalg.solve(normal, (away * self.weights[:, None]).T @ left))

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
