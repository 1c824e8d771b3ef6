"""Piers: the short pieces of wall between doors and passages, too short for lines of their own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from recon.geometry import Array, cross2
from recon.layout.evidence import FreeSpace
from recon.layout.line import PlanLine, clip, subtract, total, union
from recon.layout.returns import Returns
from recon.layout.stretches import Stretches

GAP = 2.2
"""m of a door or passage between two pieces of wall."""
FURTHEST = 4.5
"""m beyond what was seen of a line where piers are looked for."""
SHORTEST_WALL = 1.0
"""m of support, of a line that has piers."""
BIN = 0.05
"""m along the line."""
DEPTH = 0.04
"""m before and behind the line, of a pier's returns."""
MIN_RETURNS = 3
"""Returns in a bin before it says anything."""
WIDTH = (0.15, 0.55)
"""m; table legs are narrower, leaves of open doors wider."""
MEETING = 0.3
"""m from the end of a wall to the line that it meets ..."""
BESIDE = 0.1
"""... and beside it, where returns are its own."""
THROUGH = 0.7
"""Share of a gap that rays went through, at least."""
STEEP = float(np.sin(np.radians(15.0)))


def with_piers(lines: list[PlanLine], returns: Returns, space: FreeSpace) -> list[PlanLine]:
    """Lines that are supported along their piers, too.

    A pier stands in line with a longer wall. One after the other, with gaps of a door's width between them that rays
    went through, piers lead from one stretch of it to the next, or on to another wall.
    """
    if not lines:
        return lines
    out = []
    for line, near in zip(lines, Stretches(lines).neighbours(FURTHEST), strict=True):
        if line.source == "lidar" and line.supported_length >= SHORTEST_WALL:
            for low, high in _gaps(line, [lines[k] for k in near]):
                line = _bridged(line, low, high, returns, space)
        out.append(line)
    return out


def _gaps(line: PlanLine, near: list[PlanLine]) -> list[tuple[float, float]]:
    """Between the stretches of a line, and from its ends to the next walls."""
    met = _met(line, near)
    low, high = line.support[0, 0], line.support[-1, 1]
    before = met[(met > low - FURTHEST) & (met < low - BESIDE)][-1:] + BESIDE
    after = met[(met > high + BESIDE) & (met < high + FURTHEST)][:1] - BESIDE
    inner = zip(line.support[:-1, 1], line.support[1:, 0], strict=True)
    outer = [(float(m), float(low)) for m in before] + [(float(high), float(m)) for m in after]
    return [(float(a), float(b)) for a, b in inner] + outer


def _met(line: PlanLine, near: list[PlanLine]) -> Array:
    """Positions along a line, sorted, where others' stretches cross it or end at it."""
    at = []
    for other in near:
        sine = float(cross2(line.direction, other.direction))
        if abs(sine) > STEEP:
            to = other.origin - line.origin
            place = float(cross2(to, line.direction)) / sine
            if np.any((other.support[:, 0] - MEETING <= place) & (place <= other.support[:, 1] + MEETING)):
                at.append(float(cross2(to, other.direction)) / sine)
    return np.array(sorted(at))


def _bridged(line: PlanLine, low: float, high: float, returns: Returns, space: FreeSpace) -> PlanLine:
    """The line with the piers between two positions, if they lead from one to the other."""
    if high - low < WIDTH[0]:
        return line
    along, _, starts = returns.beside(line.point(low), line.point(high), DEPTH)
    count = np.bincount((along / BIN).astype(np.int64))
    filled = np.flatnonzero(count >= MIN_RETURNS)
    piers = union(low + BIN * np.stack([filled, filled + 1], axis=1).astype(np.float64), 1.5 * BIN)
    width = piers[:, 1] - piers[:, 0]
    piers = clip(piers[(width >= WIDTH[0]) & (width <= WIDTH[1])], low, high)
    steps = subtract(np.array([[low, high]]), piers)
    if len(piers) == 0 or np.any(steps[:, 1] - steps[:, 0] > GAP) or _passed(line, steps, space) < THROUGH:
        return line
    if bool(np.median((starts - line.origin) @ line.normal) > 0):
        return replace(line, front=union(np.concatenate([line.front, piers])))
    return replace(line, back=union(np.concatenate([line.back, piers])))


def _passed(line: PlanLine, steps: Array, space: FreeSpace) -> float:
    """Share of the gaps (K, 2) that rays went through."""
    if total(steps) < BIN:
        return 0.0
    places = np.concatenate([np.arange(a, b, BIN / 2) for a, b in steps])
    return float(space.is_free(line.point(places)).mean())
