"""Walls are not flat: boards, frames and plaster move a line, however often they are scanned."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.special import gammaincinv  # scipy.stats takes a second to import

from recon.geometry import Array
from recon.layout.line import PlanLine
from recon.layout.returns import Returns

PATCH = 0.5
"""m along a wall that stand out together: boards, frames, radiators."""
DEPTH = 0.03
"""m before and behind a line; what is further off did not make it."""
END = 0.2
"""m at the ends of a stretch that say nothing: corners and jambs round off, beams hit them in part."""
MIN_RETURNS = 5
"""Returns on a patch before it counts."""
CHANCE = 0.01
"""How often a flat wall may pass for an uneven one."""


def with_surfaces(lines: Sequence[PlanLine], returns: Returns) -> list[PlanLine]:
    """Lines with what the unevenness of their walls adds to their covariances, where returns show any."""
    return [_with_surface(line, returns) if line.source == "lidar" else line for line in lines]


def _with_surface(line: PlanLine, returns: Returns) -> PlanLine:
    place, mean, count, within = _patches(line, returns)
    if len(place) < 4:
        return line
    lever = np.stack([np.ones(len(place)), place], axis=1)
    normal = np.linalg.inv((count * lever.T) @ lever)
    left = mean - lever @ (normal @ (lever.T @ (count * mean)))
    by_chance = within / count
    free = len(place) - 2
    if float(np.sum(left**2 / by_chance)) <= 2 * gammaincinv(free / 2, 1 - CHANCE):  # chi-square
        return line
    # the covariance of a fit whose errors hang together in clusters (Liang and Zeger 1986), as far as it is not counted
    # yet; what stands out may lie across two patches, so neighbours count too (Newey and West 1987)
    beside = np.abs(np.diff(place)) < 1.5 * PATCH
    shared = float(np.sum((left[1:] * left[:-1])[beside])) / max(int(beside.sum()), 1)
    uneven = float(np.mean(left**2)) * len(place) / free - float(np.mean(by_chance)) + 2 * max(shared, 0.0)
    uneven = max(uneven, 0.0)
    surface = uneven * normal @ ((count**2 * lever.T) @ lever) @ normal
    return replace(
        line,
        surface=surface,
        sigma_offset=float(np.hypot(line.sigma_offset, np.sqrt(surface[0, 0]))),
        sigma_angle=float(np.hypot(line.sigma_angle, np.sqrt(surface[1, 1]))),
        mixed=line.mixed + float(surface[0, 1]),
    )


def _patches(line: PlanLine, returns: Returns) -> tuple[Array, Array, Array, Array]:
    """Of every patch seen of a line (n,): middle along it, mean offset and number of returns; their common variance."""
    parts: list[tuple[Array, Array, Array, Array]] = []
    for stretches, side in ((line.front, 1.0), (line.back, -1.0)):
        for low, high in stretches[stretches[:, 1] - stretches[:, 0] > PATCH + 2 * END] + np.array([END, -END]):
            along, across, starts = returns.beside(line.point(low), line.point(high), DEPTH)
            seen = side * ((starts - line.origin) @ line.normal) > 0
            patch = np.floor(along[seen] / PATCH).astype(np.int64)
            count = np.bincount(patch).astype(np.float64)
            sums = [np.bincount(patch, values[seen]) for values in (along, across, across**2)]
            kept = count >= MIN_RETURNS
            number = count[kept]
            middle, mean, square = (total[kept] / number for total in sums)
            parts.append((low + middle, mean, number, (square - mean**2) * number))
    if not parts:
        return (np.zeros(0),) * 4
    place, mean, number, squares = (np.concatenate(column) for column in zip(*parts, strict=True))
    within = squares.sum() / max(number.sum() - len(number), 1.0)
    return place, mean, number, np.full(len(place), within)
