"""What stands on a footprint, as rays see it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from recon.geometry import Array


@dataclass(frozen=True)
class Column:
    """A convex, counter-clockwise outline (n, 2), m, map frame, and all that is above it."""

    outline: Array

    @property
    def centre(self) -> Array:
        """(2,), m."""
        return np.asarray(self.outline.mean(axis=0))

    @property
    def radius(self) -> float:
        """m, of a circle about the centre that holds the outline."""
        return float(np.linalg.norm(self.outline - self.centre, axis=1).max())

    def holds(self, point: Array) -> bool:
        """Whether a point (2,), m, is inside the outline or on it."""
        along = np.roll(self.outline, -1, axis=0) - self.outline
        off = point - self.outline
        return bool(np.all(along[:, 0] * off[:, 1] - along[:, 1] * off[:, 0] >= 0))

    def meet(self, origin: Array, directions: Array) -> tuple[Array, Array]:
        """Where rays from `origin` (3,) with directions (..., 3) pass through the column above the floor.

        Lowest height (...), m, in it: things that stand there and are higher than this stop the ray; inf for rays
        that miss. Distance (...) to where it enters, in units of |direction|.
        """
        from recon.segmentation.kernels import clip_rays  # numba takes a while to import

        along = np.roll(self.outline, -1, axis=0) - self.outline
        outward = np.ascontiguousarray(np.stack([along[:, 1], -along[:, 0]], axis=1))
        gaps = np.einsum("ij,ij->i", self.outline - origin[:2], outward)
        flat = np.ascontiguousarray(directions.reshape(-1, 3))
        lowest, enter = clip_rays(outward, gaps, float(origin[2]), flat)
        return lowest.reshape(directions.shape[:-1]), enter.reshape(directions.shape[:-1])
