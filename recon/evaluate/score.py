"""Precision, recall and F1 from counts, and the matching of things one to one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array


@dataclass(frozen=True)
class Score:
    """How many things were found, how many there are, and how many found ones are right."""

    found: int
    true: int
    right: int

    @property
    def precision(self) -> float:
        """Share of the found that is right; 1 where nothing is there and nothing was found."""
        return self.right / self.found if self.found else float(self.true == 0)

    @property
    def recall(self) -> float:
        """Share of the true that was found; 1 where nothing is there and nothing was found."""
        return self.right / self.true if self.true else float(self.found == 0)

    @property
    def f1(self) -> float:
        """Harmonic mean of precision and recall."""
        total = self.found + self.true
        return 2 * self.right / total if total else 1.0

    def to_json(self) -> dict[str, float | int]:
        """Counts and shares."""
        counts = {"found": self.found, "true": self.true, "right": self.right}
        return counts | {"precision": self.precision, "recall": self.recall, "f1": self.f1}


def total(scores: list[Score]) -> Score:
    """The counts of several added up."""
    return Score(sum(s.found for s in scores), sum(s.true for s in scores), sum(s.right for s in scores))


def match(cost: Array, limit: float) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rows and columns of (M, N) costs matched one to one: as many as can be of cost <= limit, at the least cost."""
    from scipy.optimize import linear_sum_assignment

    if cost.size == 0:
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    beyond = (limit + 1.0) * (min(cost.shape) + 1)  # one pair more outweighs any sum of costs within the limit
    rows, columns = linear_sum_assignment(np.where(cost <= limit, cost, beyond))
    ok = cost[rows, columns] <= limit
    return rows[ok], columns[ok]
