"""Where seen free space ends without a wall: lines that may close the outline there."""

from __future__ import annotations

from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array, cross2
from recon.layout.evidence import FreeSpace
from recon.layout.line import NONE, PlanLine, total, union
from recon.layout.stretches import Stretches

EXPLAINED = 0.15
"""m, a rim of free space this close to a wall is that wall's."""
TOLERANCE = 0.15
"""m, how far a straight piece of the rim may leave it."""
SHORTEST = 0.3
"""m of rim without wall worth a line."""
SPIKE = 0.1
"""m, half the width of slits of free space that make no rim."""
SMALLEST = 0.5
"""m^2, patches of free space smaller than this have no rim."""
SAME = 0.2
"""m, frontiers alongside a wall or a longer frontier that are closer than this add nothing."""
AT_CORNER = 0.5
"""m from the end of a wall to another one that makes a corner with it."""
ALIGNED = np.radians(10.0)
SIGMA_OFFSET = 0.5
SIGMA_ANGLE = 0.2
"""One standard deviation of a wall that nobody saw, m and rad: it may stand anywhere near."""


def frontier_lines(space: FreeSpace, walls: list[PlanLine]) -> list[PlanLine]:
    """Candidate lines along the rim of free space where no wall is.

    Each piece of rim gives the lines that touch it from outside: along its own straight parts, and along and across
    the walls that it ends at. Where a wall's support ends at no other wall, a line goes across it there. Of lines that
    all but coincide, the longest stays.
    """
    seen = Stretches(walls)
    found = [line for rim in _rims(space) for chain in _chains(rim, seen) for line in _lines(chain, walls, seen)]
    found += _across_ends(walls, seen)
    found.sort(key=lambda line: (line.oblique, -total(line.frontier)))
    near = Stretches([*walls, *found], frontiers=True).neighbours(2 * SAME)
    covering = np.arange(len(walls) + len(found)) < len(walls)  # walls, and the frontiers that stay
    for k, line in enumerate(found, start=len(walls)):
        others = [int(n) for n in near[k] if covering[n]]
        covering[k] = not any(_covers(walls[n] if n < len(walls) else found[n - len(walls)], line) for n in others)
    return [line for line, stays in zip(found, covering[len(walls) :], strict=True) if stays]


def _across_ends(walls: list[PlanLine], seen: Stretches) -> list[PlanLine]:
    """Lines across walls at the ends of what was seen of them, except at corners."""
    known = [k for k, wall in enumerate(walls) if len(wall.support)]
    feet = np.array([walls[k].point(walls[k].support[[0, -1], [0, 1]]) for k in known]).reshape(-1, 2)
    row, near = seen.around(feet, AT_CORNER)
    corner = np.isin(np.arange(len(feet)), row[near != np.repeat(known, 2)[row]])
    stub = np.array([[-AT_CORNER, AT_CORNER]])
    return [
        PlanLine(foot, walls[k].normal, NONE, NONE, SIGMA_OFFSET, SIGMA_ANGLE, "inferred", 0, stub, False)
        for foot, k, at_corner in zip(feet, np.repeat(known, 2), corner, strict=True)
        if not at_corner
    ]


def _covers(line: PlanLine, other: PlanLine) -> bool:
    """Whether all of `other` runs within `SAME` of `line`, alongside it."""
    if abs(cross2(line.direction, other.direction)) > np.sin(ALIGNED):
        return False
    ends = other.point(other.frontier.ravel())
    reach = union(np.concatenate([line.support, line.frontier]) + np.array([-EXPLAINED, EXPLAINED]))
    low, high = np.sort(line.along(ends))
    inside = np.any((reach[:, 0] <= low) & (high <= reach[:, 1]))
    return bool(inside and np.abs(line.offset(ends)).max() < SAME)


def _rims(space: FreeSpace) -> list[Array]:
    """Outer contours (n, 2) m, counter-clockwise, of the patches of free space, slits left out."""
    size = 2 * max(1, round(SPIKE / space.resolution)) + 1
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))
    mask = space.free.astype(np.uint8)
    mask = cv2.morphologyEx(cv2.morphologyEx(mask, cv2.MORPH_CLOSE, kernel), cv2.MORPH_OPEN, kernel)
    contours, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    rims = []
    for contour in contours:
        pixels = contour[:, 0, :].astype(np.float64)
        signed = cv2.contourArea(contour, oriented=True) * space.cell_area
        if abs(signed) >= SMALLEST:
            rims.append(space.origin + space.resolution * (pixels[:: 1 if signed > 0 else -1] + 0.5))
    return rims


def _chains(rim: Array, walls: Stretches) -> list[Array]:
    """The runs of a closed rim (n, 2) that no wall explains, each (m, 2) m and at least `SHORTEST` from end to end."""
    open_ = walls.distance(rim) > EXPLAINED
    if open_.all():
        return [np.concatenate([rim, rim[:1]])]
    start = int(np.argmin(open_))
    rim, open_ = np.roll(rim, -start, axis=0), np.roll(open_, -start)
    change = np.flatnonzero(np.diff(np.concatenate([[0], open_.astype(np.int8), [0]])))
    runs = [rim[a:b] for a, b in zip(change[::2], change[1::2], strict=True)]
    return [run for run in runs if np.ptp(run, axis=0).max() >= SHORTEST]


def _lines(chain: Array, walls: list[PlanLine], seen: Stretches) -> list[PlanLine]:
    """Lines touching a piece of rim (m, 2), which has the free space on its left, from outside."""
    directions = _wall_directions(chain, walls, seen)
    corner = cv2.approxPolyDP(chain.astype(np.float32)[:, None], TOLERANCE, False)[:, 0].astype(np.float64)
    at = [int(np.argmin(np.sum((chain - c) ** 2, axis=1))) for c in corner]
    at[0], at[-1] = 0, len(chain) - 1
    lines = [_touching(chain, d, False) for d in _facing(directions, chain[-1] - chain[0])]
    for a, b in pairwise(at):
        step = chain[b] - chain[a]
        length = float(np.linalg.norm(step))
        if b <= a or length < SHORTEST:
            continue
        turn = np.abs(cross2(directions, step / length)) if len(directions) else np.ones(1)
        if turn.min() < np.sin(ALIGNED):
            near = directions[int(np.argmin(turn))]
            lines.append(_touching(chain[a : b + 1], near if near @ step > 0 else -near, False))
        else:
            lines.append(_touching(chain[a : b + 1], step / length, True))
    return lines


def _wall_directions(chain: Array, walls: list[PlanLine], seen: Stretches) -> Array:
    """(D, 2) unit vectors along and across the walls next to the two ends of a piece of rim."""
    out: list[Array] = []
    for end in chain[[0, -1]]:
        k = seen.nearest(end)
        if k < 0:
            return NONE
        nearest = walls[k]
        for d in (nearest.direction, nearest.normal):
            if all(abs(cross2(d, other)) > np.sin(ALIGNED) for other in out):
                out.append(d)
    return np.array(out)


def _facing(directions: Array, step: Array) -> list[Array]:
    """Of the directions (D, 2) those that the rim goes along, turned its way (free space on the left)."""
    length = float(np.linalg.norm(step))
    if length < SHORTEST:
        return [d for one in directions for d in (one, -one)]
    cosine = directions @ step / length if len(directions) else np.zeros(0)
    return [d if c > 0 else -d for d, c in zip(directions, cosine, strict=True) if abs(c) > 0.3]


def _touching(points: Array, direction: Array, oblique: bool) -> PlanLine:
    """The line of a direction that has all points (n, 2) on its left or on it."""
    right = np.array([direction[1], -direction[0]])
    reach: NDArray[np.float64] = points @ right
    along = points @ direction
    origin = points.mean(axis=0) + (reach.max() - points.mean(axis=0) @ right) * right
    extent = np.array([[along.min(), along.max()]]) - origin @ direction
    return PlanLine(origin, direction, NONE, NONE, SIGMA_OFFSET, SIGMA_ANGLE, "inferred", 0, extent, oblique)
