"""The stretches of lines that were seen, found by place."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
import shapely
from numpy.typing import NDArray

from recon.geometry import Array
from recon.layout.line import PlanLine

Ints = NDArray[np.int64]


class Stretches:
    """Supported stretches of lines in a search tree, so that what is near one costs the same in any building.

    owner: (S,) index of the line that each of the S stretches is on. frontiers: these count as stretches too.
    """

    def __init__(self, lines: Sequence[PlanLine], frontiers: bool = False) -> None:
        parts = [np.concatenate([line.support, line.frontier]) if frontiers else line.support for line in lines]
        self._lines = len(lines)
        self.owner: Ints = np.repeat(np.arange(len(lines)), [len(part) for part in parts])
        ends = [line.point(part) for line, part in zip(lines, parts, strict=True) if len(part)]
        self._segments = shapely.linestrings(np.concatenate(ends) if ends else np.zeros((0, 2, 2)))

    @cached_property
    def _tree(self) -> shapely.STRtree:
        return shapely.STRtree(self._segments)

    def distance(self, points: Array) -> Array:
        """(N,) m from points (N, 2) to the nearest stretch; inf where there is none."""
        out = np.full(len(points), np.inf)
        if len(self.owner) and len(points):
            (row, _), distance = self._tree.query_nearest(
                shapely.points(points), return_distance=True, all_matches=False
            )
            out[row] = distance
        return out

    def nearest(self, point: Array) -> int:
        """Index of the line whose stretch is nearest to a point (2,), the first of several; -1 without any."""
        if not len(self.owner):
            return -1
        return int(self.owner[self._tree.query_nearest(shapely.points(point))].min())

    def around(self, points: Array, reach: float) -> tuple[Ints, Ints]:
        """Pairs (row of `points` (N, 2), line) of all lines with a stretch within `reach` m of a point."""
        row, segment = self._tree.query(shapely.points(points), predicate="dwithin", distance=reach)
        return np.asarray(row), self.owner[segment]

    def neighbours(self, reach: float) -> list[Ints]:
        """For each line the others (sorted indices) that come within `reach` m of its stretches."""
        row, segment = self._tree.query(self._segments, predicate="dwithin", distance=reach)
        pairs = np.unique(np.stack([self.owner[row], self.owner[segment]], axis=1), axis=0)
        pairs = pairs[pairs[:, 0] != pairs[:, 1]]
        return np.split(pairs[:, 1], np.searchsorted(pairs[:, 0], np.arange(1, self._lines)))
