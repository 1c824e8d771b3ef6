"""How the errors of walls hang together: covariances between the walls of a solved map, on demand."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array
from recon.graph.line import lever

Ints = NDArray[np.int64]


class Landmarks(Protocol):
    """A solution that knows covariances between its wall landmarks."""

    def between_walls(self, first: Ints, second: Ints) -> Array:
        """(P, 2, 2) covariance of the (offset, angle) of landmarks `first` with those of `second`, both (P,)."""
        ...


@dataclass(frozen=True)
class WallCovariance:
    """Covariances between W wall lines, each with its origin elsewhere along its landmark.

    number: (W,) the landmark of each. along: (W,) m from the landmark's origin to the wall line's.
    """

    landmarks: Landmarks
    number: Ints
    along: Array

    def between(self, first: Ints, second: Ints) -> Array:
        """(P, 2, 2) covariance of (offset m, angle rad) of walls `first` with those of walls `second`, both (P,).

        Offsets are at the walls' origins, across them towards their free space.
        """
        blocks = self.landmarks.between_walls(self.number[first], self.number[second])
        return np.asarray(lever(self.along[first]) @ blocks @ lever(self.along[second]).transpose(0, 2, 1))
