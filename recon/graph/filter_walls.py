"""What a filter remembers of its walls beside their state: which segments saw them, and where along them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recon.graph.estimate import WallLine
from recon.graph.filter_state import FilterState
from recon.graph.intervals import supported
from recon.graph.nearest import NONE
from recon.graph.observation import WallObservations
from recon.graph.result import LEAST_SIGHTINGS, wall_line
from recon.model import Source

Ints = NDArray[np.int64]


class FilterWalls:
    """Sightings of the walls of a `FilterState`, in the same rows, and of those that it gave up.

    labels (K,): number of the wall of every observation. Along (K,): where the observation's middle lies, m from where
    the wall's origin was at first.
    """

    def __init__(self, observations: WallObservations) -> None:
        self._observations = observations
        self._half = np.hypot(*(observations.endpoints[:, 1] - observations.endpoints[:, 0]).T) / 2
        self._labels = np.full(len(observations), NONE, dtype=np.int64)
        self._along = np.zeros(len(observations))
        self._number, self._origin, self._count = np.zeros(0, np.int64), np.zeros(0), 0
        self._scans, self._images, self.last = (np.zeros(0, np.int64) for _ in range(3))

    @property
    def confirmed(self) -> NDArray[np.bool_]:
        """(W,) walls that enough scans or images have seen."""
        need = min(LEAST_SIGHTINGS, int(self._observations.pose.max(initial=0)) + 1)
        return (self._scans >= need) | (self._images >= LEAST_SIGHTINGS)

    def add(self, rows: Ints, scan: int) -> None:
        """Every observation of `rows` (n,) starts a wall."""
        count = len(rows)
        new = self._count + np.arange(count)
        self._labels[rows], self._count = new, self._count + count
        image = self._observations.image[rows] >= 0
        self._number, self._origin = (
            np.concatenate([self._number, new]),
            np.concatenate([self._origin, np.zeros(count)]),
        )
        self._scans = np.concatenate([self._scans, ~image])
        self._images = np.concatenate([self._images, image])
        self.last = np.concatenate([self.last, np.full(count, scan)])

    def see(self, row: int, wall: int, along: float, scan: int) -> None:
        """Observation `row` saw the state's `wall`, its middle `along` m from the wall's origin."""
        self._labels[row], self._along[row] = self._number[wall], self._origin[wall] + along
        if self._observations.image[row] >= 0:
            self._images[wall] += 1
        elif self.last[wall] < scan:
            self._scans[wall] += 1
        self.last[wall] = scan

    def moved(self, wall: int, shift: float) -> None:
        """The origin of `wall` moved along it."""
        self._origin[wall] += shift

    def join(self, wall: int, other: int, along: float) -> None:
        """`other` is the same as `wall`, its origin `along` m from the wall's."""
        rows = self._labels == self._number[other]
        self._labels[rows] = self._number[wall]
        self._along[rows] += self._origin[wall] + along - self._origin[other]
        self._scans[wall] += self._scans[other]
        self._images[wall] += self._images[other]
        self.last[wall] = max(self.last[wall], self.last[other])

    def keep(self, kept: NDArray[np.bool_]) -> None:
        """Only the rows `kept` (W,)."""
        self._number, self._origin, self.last = self._number[kept], self._origin[kept], self.last[kept]
        self._scans, self._images = self._scans[kept], self._images[kept]

    def lines(self, state: FilterState, chosen: NDArray[np.bool_]) -> list[WallLine]:
        """The confirmed ones among the `chosen` walls (W,), with the stretches that observations support."""
        found, walls, need = [], state.walls, LEAST_SIGHTINGS
        for wall in np.flatnonzero(chosen & self.confirmed):
            rows = np.flatnonzero(self._labels == self._number[wall])
            along = self._along[rows] - self._origin[wall]
            intervals = supported(along, self._half[rows], self._observations.image[rows], need)
            if len(intervals):
                source: Source = "image" if self._images[wall] > self._scans[wall] else "lidar"
                seen = int(self._scans[wall] + self._images[wall])
                found.append(wall_line(state.frames[wall], walls.covariance[wall], intervals, source, seen))
        return found
