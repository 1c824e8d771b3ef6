"""Open doors: leaves that stand in a room, hinged at an end of the gap that they close."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array
from recon.layout.evidence import FreeSpace
from recon.layout.line import PlanLine, cross2, subtract, union

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
PASSED = 0.6
"""Share of a gap that rays went through, at least."""


def without_leaves(lines: list[PlanLine], space: FreeSpace) -> list[PlanLine]:
    """Lines without the leaves of doors that stand open.

    A leaf is as wide as the gap in a wall at whose end it begins, and rays went through the gap.
    """
    owner, ends = _gaps(lines, space)
    if len(owner) == 0:
        return lines
    out = []
    for k, line in enumerate(lines):
        front, back = line.front, line.back
        for low, high in union(line.support, HINGE):
            if WIDTH[0] <= high - low <= WIDTH[1] + THICKEST and _is_leaf(line, k, low, high, owner, ends):
                cut = np.array([[low, high]])
                front, back = subtract(front, cut), subtract(back, cut)
        if len(front) or len(back):
            out.append(replace(line, front=front, back=back))
    return out


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


def _is_leaf(line: PlanLine, k: int, low: float, high: float, owner: NDArray[np.int64], ends: Array) -> bool:
    """Whether a stretch of a line begins at an end of a gap in another wall that is as wide."""
    tips = line.point(np.array([low, high]))
    step = ends[:, 1] - ends[:, 0]
    width = np.linalg.norm(step, axis=1)
    along = step / width[:, None]
    turned = np.abs(along @ line.normal) > TURNED
    fits = (high - low >= (1 - MISFIT) * width) & (high - low <= (1 + MISFIT) * width + THICKEST)
    offset = tips[None] - ends[:, :1]  # (G, 2, 2), of both tips
    place = np.einsum("gti,gi->gt", offset, along)
    across = np.abs(cross2(along[:, None], offset))
    beside = np.minimum(np.abs(place), np.abs(place - width[:, None])) <= HINGE
    return bool(np.any((owner != k) & turned & fits & (beside & (across <= THICKEST)).any(axis=1)))
