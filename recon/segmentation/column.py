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

    def meet(self, origin: Array, directions: Array) -> tuple[Array, Array]:
        """Where rays from `origin` (3,) with directions (..., 3) pass through the column above the floor.

        Lowest height (...), m, in it: things that stand there and are higher than this stop the ray; inf for rays
        that miss. Distance (...) to where it enters, in units of |direction|.
        """
        ends = np.roll(self.outline, -1, axis=0)
        along = ends - self.outline
        outward = np.stack([along[:, 1], -along[:, 0]], axis=1)
        enter, leave = np.zeros(directions.shape[:-1]), np.full(directions.shape[:-1], np.inf)
        for corner, normal in zip(self.outline, outward, strict=True):  # Cyrus and Beck 1978
            gap = float((corner - origin[:2]) @ normal)
            speed = directions[..., :2] @ normal
            with np.errstate(divide="ignore", invalid="ignore"):
                reach = gap / speed
            enter = np.where(speed < 0, np.maximum(enter, reach), enter)
            leave = np.where(speed > 0, np.minimum(leave, reach), leave)
            leave = np.where((speed == 0) & (gap < 0), -1.0, leave)
        first = origin[2] + enter * directions[..., 2]
        last = origin[2] + np.minimum(leave, 1e6) * directions[..., 2]
        missed = (enter >= leave) | (np.maximum(first, last) < 0) | (first < 0)
        return np.where(missed, np.inf, np.maximum(np.minimum(first, last), 0.0)), enter
