"""Interpretation planes: what a line segment says about vanishing points, on the Gaussian sphere."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array, cross
from recon.sequence.camera import Camera
from recon.vision.rectify import stretch_at

MODEL_SIGMA = (
    0.3  # px of the image: edges of a building are not quite straight and parallel, nor is the lens model exact
)
TUKEY = 4.685  # standard deviations: 95 % efficient on Gaussian residuals


@dataclass(frozen=True)
class Planes:
    """The planes through the camera centre and N segments.

    A segment that points to the vanishing point of direction v fulfils normals[i] . v = 0. How far it misses, as the
    first-order (Sampson) distance of its two end points across the segment in pixels, is
    normals . v / hypot(across[:, 0] . v, across[:, 1] . v).

    normals: (N, 3), not of unit length; across: (N, 2, 3), the normal's change with each end point moving across;
    sigmas: (N,) standard deviation of an end point, px; weights: (N,) how much a line counts: its length, px, capped.
    """

    normals: Array
    across: Array
    sigmas: Array
    weights: Array

    def __len__(self) -> int:
        return len(self.normals)

    def __getitem__(self, index: NDArray[np.bool_] | NDArray[np.int64]) -> Planes:
        return Planes(self.normals[index], self.across[index], self.sigmas[index], self.weights[index])

    def residuals(self, directions: Array) -> Array:
        """(N, M) Sampson distances in standard deviations to the vanishing points of directions (M, 3)."""
        d = directions.T
        spread = np.sqrt((self.across[:, 0] @ d) ** 2 + (self.across[:, 1] @ d) ** 2)
        return np.asarray((self.normals @ d) / (self.sigmas[:, None] * np.maximum(spread, 1e-12)))

    def scaled_normals(self, direction: Array) -> Array:
        """(N, 3) rows a with residual a . v near the unit vector `direction` (3,)."""
        spread = np.hypot(self.across[:, 0] @ direction, self.across[:, 1] @ direction)
        return np.asarray(self.normals / (self.sigmas * np.maximum(spread, 1e-12))[:, None])


def planes_of(endpoints: Array, sigmas: Array, camera: Camera) -> Planes:
    """Planes of segments (N, 2, 2) in rectified pixels with standard deviations (N,), px."""
    homogeneous = np.concatenate([endpoints, np.ones((*endpoints.shape[:2], 1))], axis=2)
    a, b = homogeneous[:, 0], homogeneous[:, 1]
    step = b - a
    lengths = np.linalg.norm(step, axis=1)
    unit = np.stack([-step[:, 1], step[:, 0], np.zeros(len(step))], axis=1) / np.maximum(lengths, 1e-12)[:, None]
    k = camera.matrix
    normals = cross(a, b) @ k
    across = np.stack([cross(unit, b) @ k, cross(a, unit) @ k], axis=1)
    stretch = stretch_at(camera, endpoints.mean(axis=1))
    stretch = np.where(np.isfinite(stretch), stretch, 1.0)
    total = np.hypot(sigmas, MODEL_SIGMA * stretch)
    return Planes(normals, across, total, np.minimum(lengths / stretch, 150.0))


def join(parts: list[Planes]) -> Planes:
    """One after the other."""
    return Planes(
        np.concatenate([p.normals for p in parts]),
        np.concatenate([p.across for p in parts]),
        np.concatenate([p.sigmas for p in parts]),
        np.concatenate([p.weights for p in parts]),
    )


def tukey(residuals: Array, scale: float = 1.0) -> Array:
    """Weights of Tukey's biweight for residuals in standard deviations, times `scale`."""
    u = np.abs(residuals) / (TUKEY * scale)
    return np.asarray(np.where(u < 1, (1 - u * u) ** 2, 0.0))


def refine_direction(planes: Planes, direction: Array, scale: float = 1.0, iterations: int = 5) -> Array:
    """The unit vector near `direction` (3,) that minimises the Tukey loss of the residuals: reweighted least squares.

    Each step is the eigenvector of the weighted normals' least eigenvalue (least squares on the sphere).
    """
    for _ in range(iterations):
        rows = planes.scaled_normals(direction)
        w = tukey(rows @ direction, scale)
        if np.count_nonzero(w) < 2:
            break
        new = np.linalg.eigh((rows * w[:, None]).T @ rows)[1][:, 0]
        direction = new if new @ direction > 0 else -new
    return direction
