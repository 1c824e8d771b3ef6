"""Lines of the plan: wall lines of the estimate, merged, with the stretches that observations support."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from recon.geometry import Array, cross2
from recon.graph.estimate import WallLine
from recon.model import Source

MERGE_OFFSET = 0.035
"""m, two lines closer than this over their stretches are one wall (or the two sides of one)."""
FLATNESS = 0.003
"""m that one wall leaves its line ..."""
SIGMAS = 3.0
"""... and as many standard deviations of both pieces, and they are in line."""
MERGE_ANGLE = np.radians(3.0)
MERGE_GAP = 3.0
"""m along the wall; stretches further apart are told apart by their own lines."""

NONE = np.zeros((0, 2))


@dataclass(frozen=True)
class PlanLine:
    """A line that cuts the plan.

    origin (2,) m and direction (2,) unit, map frame; positions along it are metres from the origin.
    front, back: (K, 2) sorted disjoint stretches seen as a wall from the left and from the right of the direction.
    sigma_offset (m) at the origin and sigma_angle (rad), one standard deviation. frontier: (K, 2) stretches where
    seen space just ends, with no wall. oblique: a frontier neither along nor across the walls beside it. hidden:
    (K, 2) stretches that something before the wall hides. gates: (K, 2) doorways in it, which part rooms.

    parts: the walls of the estimate behind the line, each with how the line's (offset, angle) follow its own, (2, 2).
    mixed: covariance of offset and angle, m rad. surface: (2, 2) what the unevenness of its wall adds to a line's
    covariance of offset and angle.
    """

    origin: Array
    direction: Array
    front: Array
    back: Array
    sigma_offset: float
    sigma_angle: float
    source: Source
    observations: int
    frontier: Array = field(default_factory=lambda: NONE)
    oblique: bool = False
    hidden: Array = field(default_factory=lambda: NONE)
    gates: Array = field(default_factory=lambda: NONE)
    parts: tuple[tuple[int, Array], ...] = ()
    mixed: float = 0.0
    surface: Array = field(default_factory=lambda: np.zeros((2, 2)))

    @cached_property
    def normal(self) -> Array:
        """Unit vector (2,) to the left."""
        return np.array([-self.direction[1], self.direction[0]])

    @cached_property
    def support(self) -> Array:
        """(K, 2) sorted disjoint stretches seen from either side."""
        return union(np.concatenate([self.front, self.back]))

    @property
    def supported_length(self) -> float:
        """m."""
        return total(self.support)

    def along(self, points: Array) -> Array:
        """(N,) positions along the line of points (N, 2)."""
        return np.asarray((points - self.origin) @ self.direction)

    def offset(self, points: Array) -> Array:
        """(N,) m, signed distances of points (N, 2), positive to the left."""
        return np.asarray((points - self.origin) @ self.normal)

    def point(self, position: Array | float) -> Array:
        """Points (N, 2) or (2,) at positions along the line."""
        return self.origin + np.multiply.outer(position, self.direction)

    def sigma_at(self, position: float) -> float:
        """Standard deviation of the offset at a position along the line, m."""
        variance = self.sigma_offset**2 + 2 * position * self.mixed + (position * self.sigma_angle) ** 2
        return float(np.sqrt(max(variance, 0.0)))


def union(intervals: Array, gap: float = 0.0) -> Array:
    """Sorted disjoint (K, 2) union of intervals (N, 2); gaps up to `gap` are closed."""
    merged: list[list[float]] = []
    for a, b in intervals[np.argsort(intervals[:, 0], kind="stable")]:
        if merged and a <= merged[-1][1] + gap:
            merged[-1][1] = max(merged[-1][1], b)
        else:
            merged.append([a, b])
    return np.array(merged).reshape(-1, 2)


def total(intervals: Array) -> float:
    """Summed length of disjoint intervals (K, 2)."""
    return float(np.sum(intervals[:, 1] - intervals[:, 0]))


def clip(intervals: Array, low: float, high: float) -> Array:
    """The parts (K, 2) of disjoint intervals that lie between `low` and `high`."""
    cut = np.clip(intervals, low, high)
    return np.asarray(cut[cut[:, 1] > cut[:, 0]])


def subtract(intervals: Array, holes: Array) -> Array:
    """Disjoint intervals (K, 2) without the parts inside `holes` (M, 2)."""
    for low, high in holes:
        intervals = np.concatenate([clip(intervals, -np.inf, low), clip(intervals, high, np.inf)])
    return union(intervals)


def coverage(intervals: Array, low: Array, high: Array) -> Array:
    """(N,) m of each [low, high] (N,) that disjoint intervals (K, 2) cover."""
    if len(intervals) == 0:
        return np.zeros(len(low))
    overlap = np.minimum(high[:, None], intervals[:, 1]) - np.maximum(low[:, None], intervals[:, 0])
    return np.asarray(np.clip(overlap, 0.0, None).sum(axis=1))


def carried(intervals: Array, source: PlanLine, target: PlanLine) -> Array:
    """Intervals (K, 2) of one line as positions along another, nearly parallel (or opposite) one."""
    if len(intervals) == 0:
        return NONE
    ends = target.along(source.point(intervals.ravel())).reshape(-1, 2)
    return np.sort(ends, axis=1)


def merged_lines(walls: tuple[WallLine, ...]) -> list[PlanLine]:
    """Wall lines as plan lines, longest first; collinear ones become one, whichever side they were seen from."""
    lines = [_plan_line(wall, number) for number, wall in enumerate(walls) if len(wall.intervals)]
    lines.sort(key=lambda line: -line.supported_length)
    out: list[PlanLine] = []
    origin, normal = np.zeros((2, len(lines), 2))
    for line in lines:
        ends = line.point(line.support[[0, -1], [0, 1]])
        across = np.abs(np.einsum("eki,ki->ek", ends[:, None] - origin[None, : len(out)], normal[: len(out)]))
        near = np.flatnonzero((across <= MERGE_OFFSET).all(axis=0))
        k = next((int(k) for k in near if _same(line, out[k])), len(out))
        if k == len(out):
            out.append(line)
        else:
            out[k] = _joined(out[k], line) if _in_line(line, out[k]) else _extended(out[k], line)
        origin[k], normal[k] = out[k].origin, out[k].normal
    return out


def _plan_line(wall: WallLine, number: int) -> PlanLine:
    return PlanLine(
        wall.pose[:2],
        wall.direction,
        union(np.sort(wall.intervals, axis=1)),
        NONE,
        wall.sigma_offset,
        wall.sigma_angle,
        wall.source,
        wall.observations,
        parts=((number, np.eye(2)),),
    )


def _same(line: PlanLine, other: PlanLine) -> bool:
    """Whether `line` continues `other` or is its other face: close over the whole stretch, and near along it."""
    if abs(cross2(line.direction, other.direction)) > np.sin(MERGE_ANGLE):
        return False
    ends = line.support[[0, -1], [0, 1]]
    if np.abs(other.offset(line.point(ends))).max() > MERGE_OFFSET:
        return False
    low, high = np.sort(other.along(line.point(ends)))
    gap = np.maximum(low - other.support[:, 1], other.support[:, 0] - high).min()
    return bool(gap < MERGE_GAP)


def _in_line(line: PlanLine, other: PlanLine) -> bool:
    """Whether `line` lies no further off `other` than both are known; a door's leaf a little behind its wall does."""
    ends = line.support[[0, -1], [0, 1]]
    sigma = [
        np.hypot(line.sigma_at(s), other.sigma_at(t)) for s, t in zip(ends, other.along(line.point(ends)), strict=True)
    ]
    return bool(np.all(np.abs(other.offset(line.point(ends))) <= SIGMAS * np.hypot(sigma, FLATNESS)))


def _joined(line: PlanLine, other: PlanLine) -> PlanLine:
    """Both as one line: a total-least-squares fit to their stretches, weighted by the number of observations."""
    ends, weights = [], []
    for part in (line, other):
        s = part.support
        ends.append(part.point(s.ravel()))
        share = part.observations * np.repeat(s[:, 1] - s[:, 0], 2) / max(total(s), 1e-9)
        weights.append(np.maximum(share, 1e-6))
    points, weight = np.concatenate(ends), np.concatenate(weights)
    centre = weight @ points / weight.sum()
    moment = (points - centre).T @ (weight[:, None] * (points - centre))
    direction: Array = np.linalg.eigh(moment)[1][:, 1]
    direction = direction if direction @ line.direction > 0 else -direction
    best = line if line.sigma_offset <= other.sigma_offset else other
    joined = replace(
        line,
        origin=centre,
        direction=direction,
        parts=_followed(line, other, ends, weights, centre, direction),
        sigma_offset=best.sigma_offset,
        sigma_angle=min(line.sigma_angle, other.sigma_angle),
        source="lidar" if "lidar" in (line.source, other.source) else line.source,
        observations=line.observations + other.observations,
    )
    return replace(joined, **_carried_sides(joined, (line, other)))


def _extended(line: PlanLine, other: PlanLine) -> PlanLine:
    """`line` where it is, along the stretches of both: what is off it says nothing about where it is."""
    return replace(line, **_carried_sides(line, (line, other)), observations=line.observations + other.observations)


def _carried_sides(target: PlanLine, parts: tuple[PlanLine, PlanLine]) -> dict[str, Any]:
    """`front` and `back` of a line that has the stretches of others."""
    sides: dict[bool, list[Array]] = {True: [], False: []}
    for part in parts:
        forward = bool(part.direction @ target.direction > 0)
        sides[forward].append(carried(part.front, part, target))
        sides[not forward].append(carried(part.back, part, target))
    return {"front": union(np.concatenate(sides[True])), "back": union(np.concatenate(sides[False]))}


def _followed(
    line: PlanLine, other: PlanLine, ends: list[Array], weights: list[Array], centre: Array, direction: Array
) -> tuple[tuple[int, Array], ...]:
    """How the (offset, angle) of a fit to the ends (n, 2) of two lines' stretches follow those of all walls behind."""
    out = []
    along = [(points - centre) @ direction for points in ends]
    mass = sum(float(w.sum()) for w in weights)
    lever = sum(float(w @ s**2) for w, s in zip(weights, along, strict=True))
    for part, points, w, s in zip((line, other), ends, weights, along, strict=True):
        side = np.sign(part.direction @ direction)
        moved = np.stack([np.ones(len(points)), part.along(points)])  # how ends follow the part's offset and angle
        change = np.stack([side * moved @ w / mass, side * moved @ (w * s) / lever])
        out += [(number, change @ before) for number, before in part.parts]
    return tuple(out)


def crossings(lines: list[PlanLine]) -> tuple[Array, Array]:
    """(L, L) positions along line i of its crossing with line j, and the sine of their angle (>= 0, 0: they do not)."""
    origin = np.array([line.origin for line in lines]).reshape(-1, 2)
    direction = np.array([line.direction for line in lines]).reshape(-1, 2)
    sine = cross2(direction[:, None], direction[None])
    delta = origin[None, :, :] - origin[:, None, :]
    cross = cross2(delta, direction[None])
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(cross / sine), np.abs(sine)
