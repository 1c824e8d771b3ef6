"""Whether the stated standard deviations are honest: errors of walls over their sigmas."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from recon.geometry import Array, wrap_angle
from recon.model import Layout, Wall

MAX_OFFSET = 0.1
"""m: a wall farther from every true wall is another thing (clutter), which no sigma speaks of."""
MAX_ANGLE = np.radians(5.0)
MIN_SHARED = 0.5
"""Share of the wall that lies along its counterpart."""


@dataclass(frozen=True)
class Calibration:
    """ratios: (K,) errors over their standard deviations. errors: (K,) m or rad, estimate minus truth."""

    ratios: Array
    errors: Array

    @staticmethod
    def joined(parts: Iterable[Calibration]) -> Calibration:
        """All of them as one."""
        some = list(parts)
        return Calibration(np.concatenate([p.ratios for p in some]), np.concatenate([p.errors for p in some]))

    def within(self, sigmas: float) -> float:
        """Share of errors of at most so many standard deviations; nan without errors. Gaussian: 0.683, 0.954."""
        return float(np.mean(np.abs(self.ratios) <= sigmas)) if len(self.ratios) else float("nan")

    def to_json(self) -> dict[str, float | int | None]:
        """Count, shares within one and two sigmas, the root mean square of the ratios and the median |error|."""
        if len(self.ratios) == 0:
            return {"compared": 0, "within_1_sigma": None, "within_2_sigma": None, "rms_ratio": None, "median": None}
        return {
            "compared": len(self.ratios),
            "within_1_sigma": self.within(1.0),
            "within_2_sigma": self.within(2.0),
            "rms_ratio": float(np.sqrt(np.mean(np.square(self.ratios)))),
            "median": float(np.median(np.abs(self.errors))),
        }


@dataclass(frozen=True)
class SigmaScores:
    """Of the walls that sensors saw: how far and how turned they are, over what they say; of distances between them."""

    offset: Calibration
    angle: Calibration
    dimension: Calibration

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        return {name: getattr(self, name).to_json() for name in ("offset", "angle", "dimension")}


def sigma_scores(estimate: Layout, truth: Layout) -> SigmaScores:
    """Walls that are not inferred and have finite sigmas, each with its `counterpart`."""
    offset, angle, sigmas = [], [], []
    for wall in estimate.walls:
        known = wall.source != "inferred" and np.isfinite([wall.sigma_offset, wall.sigma_angle]).all()
        other = counterpart(wall, truth.walls) if known and min(wall.sigma_offset, wall.sigma_angle) > 0 else None
        if other is not None:
            offset.append(float(((wall.start + wall.end) / 2 - other.start) @ other.normal))
            angle.append(turn(wall, other))
            sigmas.append((wall.sigma_offset, wall.sigma_angle))
    across, along = np.array(sigmas).reshape(-1, 2).T
    return SigmaScores(
        Calibration(np.array(offset) / across, np.array(offset)),
        Calibration(np.array(angle) / along, np.array(angle)),
        dimension_scores(estimate, truth),
    )


def dimension_scores(estimate: Layout, truth: Layout) -> Calibration:
    """Distances between facing walls that both have a `counterpart`, against these where they were measured."""
    walls = {wall.id: wall for wall in estimate.walls}
    errors, sigmas = [], []
    for dimension in estimate.dimensions:
        pair = [counterpart(walls[k], truth.walls) for k in dimension.walls]
        if dimension.sigma > 0 and pair[0] is not None and pair[1] is not None:
            way = (dimension.end - dimension.start) / dimension.distance
            near, far = (float((w.start - dimension.start) @ w.normal / (way @ w.normal)) for w in pair if w)
            errors.append(dimension.distance - (far - near))
            sigmas.append(dimension.sigma)
    return Calibration(np.array(errors) / np.array(sigmas), np.array(errors))


def counterpart(wall: Wall, others: tuple[Wall, ...]) -> Wall | None:
    """The nearest wall of `others` along which half of `wall` lies, turned by less than MAX_ANGLE and near it."""
    if not others:
        return None
    start, end = np.array([other.start for other in others]), np.array([other.end for other in others])
    length = np.maximum(np.linalg.norm(end - start, axis=1), 1e-12)
    along = (end - start) / length[:, None]
    cross = along[:, 0] * wall.direction[1] - along[:, 1] * wall.direction[0]
    turned = np.abs(np.arctan2(cross, along @ wall.direction))
    ends = np.sort([np.sum((point - start) * along, axis=1) for point in (wall.start, wall.end)], axis=0)
    shared = np.minimum(ends[1], length) - np.maximum(ends[0], 0.0)
    offset = (wall.start + wall.end) / 2 - start
    distance = np.abs(along[:, 0] * offset[:, 1] - along[:, 1] * offset[:, 0])
    ok = (turned <= MAX_ANGLE) & (shared >= MIN_SHARED * wall.length) & (distance <= MAX_OFFSET)
    return others[int(np.where(ok, distance, np.inf).argmin())] if ok.any() else None


def turn(wall: Wall, other: Wall) -> float:
    """Angle from `other` to `wall`, rad."""
    yaw = [np.arctan2(w.direction[1], w.direction[0]) for w in (wall, other)]
    return float(wrap_angle(yaw[0] - yaw[1]))
