"""Doors, passages and windows against the true layout."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from recon.evaluate.score import Score, match
from recon.geometry import Array
from recon.model import Layout, Opening, OpeningType

MAX_DISTANCE = 0.3
"""m between the middles, in plan, of an opening and its counterpart."""
TYPES: tuple[OpeningType, ...] = ("door", "passage", "window")


@dataclass(frozen=True)
class OpeningScores:
    """Openings of each type, and of any; the errors are of those that are right whatever their types, m.

    middle: median distance; width: median of |estimate - truth|; nan where none is right.
    """

    by_type: dict[OpeningType, Score]
    any_type: Score
    middle: float
    width: float

    def to_json(self) -> dict[str, Any]:
        """Plain values; None where nothing was right."""
        scores = {str(name): score.to_json() for name, score in self.by_type.items()}
        errors = {name: value if np.isfinite(value) else None for name, value in
                  (("middle", self.middle), ("width", self.width))}  # fmt: skip
        return scores | {"any": self.any_type.to_json() | errors}


def opening_scores(estimate: Layout, truth: Layout) -> OpeningScores:
    """Openings of each type as `matched_openings` pairs them, then of all types together.

    An opening between two rooms is one in a wall of each, and counts twice.
    """
    by_type = {}
    for name in TYPES:
        mine, theirs = ([o for o in layout.openings if o.type == name] for layout in (estimate, truth))
        right = len(matched_openings(estimate, mine, truth, theirs))
        by_type[name] = Score(len(mine), len(theirs), right)
    everything = list(estimate.openings), list(truth.openings)
    pairs = matched_openings(estimate, everything[0], truth, everything[1])
    middles = [float(np.linalg.norm(_middle(a) - _middle(b))) for a, b in pairs]
    widths = [abs(_width(a) - _width(b)) for a, b in pairs]
    any_type = Score(len(everything[0]), len(everything[1]), len(pairs))
    return OpeningScores(by_type, any_type, _median(middles), _median(widths))


def matched_openings(
    estimate: Layout, mine: list[Opening], truth: Layout, theirs: list[Opening]
) -> list[tuple[Opening, Opening]]:
    """Openings paired one to one: in walls that face the same way, their middles within MAX_DISTANCE in plan."""
    middles = [np.array([_middle(o) for o in which]).reshape(-1, 2) for which in (mine, theirs)]
    normals = [
        np.array([layout.wall(o.wall).normal for o in which]).reshape(-1, 2)
        for layout, which in ((estimate, mine), (truth, theirs))
    ]
    cost = np.linalg.norm(middles[0][:, None] - middles[1][None], axis=2)
    cost[normals[0] @ normals[1].T < 0.5] = np.inf
    rows, columns = match(cost, MAX_DISTANCE)
    return [(mine[i], theirs[j]) for i, j in zip(rows.tolist(), columns.tolist(), strict=True)]


def _middle(opening: Opening) -> Array:
    return np.asarray((opening.start + opening.end) / 2)


def _width(opening: Opening) -> float:
    return float(np.linalg.norm(opening.end - opening.start))


def _median(values: list[float]) -> float:
    return float(np.median(values)) if values else float("nan")
