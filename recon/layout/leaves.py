"""Open doors: leaves that stand in a room, hinged at an end of the gap that they close."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array, cross2
from recon.layout.evidence import FreeSpace
from recon.layout.line import PlanLine, subtract, union

WIDTH = (0.55, 1.4)
"""m, of one leaf."""
HINGE = 0.15
"""m along the wall between the end of a leaf and the end of its gap."""
THICKEST = 0.35
"""m across: the gap may be seen in the wall's other face only, and the leaf's line go on to there."""
MISFIT = 0.2
"""Share of its gap's width by which a leaf may be narrower or wider."""
TURNED = np.sin(np.radians(20.0))
"""Sine of the angle between a leaf and its wall, at least."""
SHADOW = 1.5
"""Lengths of a leaf along the wall that it may hide."""
PARALLEL = np.sin(np.radians(5.0))
PASSED = 0.6
"""Share of a gap that rays went through, at least."""


def without_leaves(lines: list[PlanLine], space: FreeSpace) -> list[PlanLine]:
    """Lines without the leaves of doors that stand open.

    A leaf is as wide as the gap in a wall at whose end it begins, and rays went through the gap.
    """
    owner, ends = _gaps(lines, space)
    if len(owner) == 0:
        return lines
    lines = list(lines)
    for k in range(len(lines)):
        for low, high in union(lines[k].support, HINGE):
            tips = lines[k].point(np.array([low, high]))
            gap = _closed_gap(lines[k], k, tips, owner, ends)
            if gap is not None:
                _hide(lines, lines[int(owner[gap])], ends[gap], tips)
                cut = np.array([[low, high]])
                line = lines[k]
                lines[k] = replace(line, front=subtract(line.front, cut), back=subtract(line.back, cut))
    return [line for line in lines if len(line.front) or len(line.back)]


def _hide(lines: list[PlanLine], wall: PlanLine, gap: Array, tips: Array) -> None:
    """Notes on the wall's faces that a leaf with ends `tips` (2, 2) m hides them beside its gap (2, 2)."""
    low, high = np.sort(wall.along(gap))
    place = wall.along(tips)
    reach = SHADOW * float(np.linalg.norm(tips[1] - tips[0]))
    at_low = np.abs(place - low).min() < np.abs(place - high).min()
    foot = wall.point(np.array([low - reach, low] if at_low else [high, high + reach]))
    for k, line in enumerate(lines):
        if abs(cross2(line.direction, wall.direction)) < PARALLEL and np.abs(line.offset(foot)).max() <= THICKEST:
            part = np.sort(line.along(foot))[None]
            lines[k] = replace(line, hidden=union(np.concatenate([line.hidden, part])))


def _gaps(lines: list[PlanLine], space: FreeSpace) -> tuple[NDArray[np.int64], Array]:
    """Gaps of a leaf's width that rays went through: their lines (G,) and ends (G, 2, 2) m."""
    owner, ends = [], []
    for k, line in enumerate(lines):
        support = union(line.support, HINGE)
        for (_, low), (high, _) in pairwise(support):
            if WIDTH[0] <= high - low <= WIDTH[1] + HINGE and _is_passed(line, low, high, space):
                owner.append(k)
                ends.append(line.point(np.array([low, high])))
    return np.array(owner, dtype=np.int64), np.array(ends).reshape(-1, 2, 2)


def _is_passed(line: PlanLine, low: float, high: float, space: FreeSpace) -> bool:
    margin = 0.15 * (high - low)
    foot = line.point(np.arange(low + margin, high - margin, space.resolution))
    return float(space.is_free(foot).mean()) >= PASSED


def _closed_gap(line: PlanLine, k: int, tips: Array, owner: NDArray[np.int64], ends: Array) -> int | None:
    """The gap, as wide as `tips` (2, 2) m of line `k` are apart, at whose end one of them is; None without."""
    length = float(np.linalg.norm(tips[1] - tips[0]))
    if not WIDTH[0] <= length <= WIDTH[1] + THICKEST:
        return None
    step = ends[:, 1] - ends[:, 0]
    width = np.linalg.norm(step, axis=1)
    along = step / width[:, None]
    turned = np.abs(along @ line.normal) > TURNED
    fits = (length >= (1 - MISFIT) * width) & (length <= (1 + MISFIT) * width + THICKEST)
    offset = tips[None] - ends[:, :1]  # (G, 2, 2), of both tips
    place = np.einsum("gti,gi->gt", offset, along)
    across = np.abs(cross2(along[:, None], offset))
    beside = np.minimum(np.abs(place), np.abs(place - width[:, None])) <= HINGE
    found = np.flatnonzero((owner != k) & turned & fits & (beside & (across <= THICKEST)).any(axis=1))
    return int(found[0]) if len(found) else None
