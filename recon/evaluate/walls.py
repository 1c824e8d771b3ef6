"""Accuracy and completeness of walls against the true layout."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from recon.geometry import Array
from recon.model import Wall

THRESHOLDS = (0.02, 0.05, 0.10)  # m
SPACING = 0.01  # m between the points compared
MAX_ANGLE = np.radians(20.0)  # between a wall and its counterpart, which must face the same way


@dataclass(frozen=True)
class WallScores:
    """Shares of wall length within each threshold (m): of the estimate (accuracy), of the truth (completeness)."""

    thresholds: tuple[float, ...]
    accuracy: tuple[float, ...]
    completeness: tuple[float, ...]
    median_distance: float

    @property
    def f1(self) -> tuple[float, ...]:
        """Harmonic mean of accuracy and completeness."""
        return tuple(
            2 * a * c / (a + c) if a + c > 0 else 0.0 for a, c in zip(self.accuracy, self.completeness, strict=True)
        )


def wall_scores(estimate: tuple[Wall, ...], truth: tuple[Wall, ...]) -> WallScores:
    """Walls compared as points every centimetre, each with the nearest wall that faces the same way."""
    of_estimate = _distances(estimate, truth)
    of_truth = _distances(truth, estimate)
    finite = of_estimate[np.isfinite(of_estimate)]
    return WallScores(
        THRESHOLDS,
        tuple(_share(of_estimate, t) for t in THRESHOLDS),
        tuple(_share(of_truth, t) for t in THRESHOLDS),
        float(np.median(finite)) if len(finite) else float("nan"),
    )


def _share(distances: Array, threshold: float) -> float:
    return float(np.mean(distances <= threshold)) if len(distances) else 0.0


def _distances(walls: tuple[Wall, ...], others: tuple[Wall, ...]) -> Array:
    """(N,) m from points along `walls` to the nearest of `others`; inf where none faces the same way."""
    parts = [np.zeros(0)]
    for wall in walls:
        count = max(round(wall.length / SPACING), 1)
        along = (np.arange(count) + 0.5) / count
        points = wall.start + along[:, None] * (wall.end - wall.start)
        best = np.full(count, np.inf)
        for other in others:
            if other.direction @ wall.direction > np.cos(MAX_ANGLE):
                best = np.minimum(best, _to_segment(points, other))
        parts.append(best)
    return np.concatenate(parts)


def _to_segment(points: Array, wall: Wall) -> Array:
    relative = points - wall.start
    along = np.clip(relative @ wall.direction, 0.0, wall.length)
    return np.asarray(np.linalg.norm(relative - along[:, None] * wall.direction, axis=1))
