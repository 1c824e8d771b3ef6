"""Short steps in a wall that are no walls of their own: recessed doors and things that stand before it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from recon.geometry import Array, cross2
from recon.layout.line import PlanLine, carried, clip, coverage, subtract, total, union
from recon.layout.stretches import Stretches

DEPTH = (0.03, 0.30)
"""m behind the wall line: how deep a door leaf sits."""
WIDTH = (0.6, 2.2)
"""m along the wall: one or two leaves."""
JAMB = 0.25
"""m from the leaf to the wall beside it, at most."""
STANDING_DEPTH = 1.0
"""m before the wall line: cupboards, boards, radiators."""
STANDING_WIDTH = 2.2
CORNER_DEPTH, CORNER_WIDTH = 0.7, 2.2
"""m, of such a thing in a corner, where wall is seen on one side of it only."""
ASIDE = 0.1
"""m from faces and ends of walls: from there one sees along them."""
SHADOW = 0.7
"""m of wall that such a thing may hide on either side."""
PARALLEL = np.radians(5.0)
NEARBY = 4.0
"""m between a wall and its steps, by far."""
LEFT_FREE = 0.15
"""m between a leaf and the next wall, so that a leaf with wall on one side only is no niche or pillar's neighbour."""


def absorb_steps(lines: list[PlanLine]) -> list[PlanLine]:
    """Lines without the stretches that are steps of another line; a wall goes on through its recessed doors.

    A step is parallel to a line, a little behind (`DEPTH`, door width) or before it, with supported wall at both of
    its ends (for a leaf: at one end, if the other end stops short of the next wall).
    """
    lines = list(lines)
    near = Stretches(lines).neighbours(NEARBY)
    for i in range(len(lines)):
        for k in near[i]:
            lines[i], lines[k] = _absorbed(lines[i], lines[k], [lines[n] for n in near[k]])
    return [line for line in lines if len(line.front) or len(line.back)]


def _absorbed(wall: PlanLine, step: PlanLine, lines: list[PlanLine]) -> tuple[PlanLine, PlanLine]:
    """`wall` and `step` after the steps of `wall` are taken from `step`; lines: those around `step`."""
    forward = bool(step.direction @ wall.direction > 0)
    if abs(cross2(wall.direction, step.direction)) > np.sin(PARALLEL):
        return wall, step
    for front in (True, False):
        on_wall = front == forward
        stretches = step.front if front else step.back
        supported = wall.front if on_wall else wall.back
        if len(stretches) == 0 or len(supported) == 0:
            continue
        sign = 1.0 if on_wall else -1.0
        joined = union(stretches, JAMB)
        for stretch in joined:
            low, high = carried(stretch[None], step, wall)[0]
            depth = -sign * float(wall.offset(step.point(stretch.mean())))
            if DEPTH[0] <= depth <= DEPTH[1] and _is_leaf(supported, low, high, step, stretch, lines):
                supported = union(np.concatenate([supported, [[low, high]]]))
                stretches = subtract(stretches, stretch[None])
                if total(supported) < 2 * (high - low):
                    wall = _turned(wall, step, forward)
            elif DEPTH[0] <= -depth <= STANDING_DEPTH and _is_standing(
                wall, supported, low, high, sign * -depth, step, stretch, lines
            ):
                stretches = subtract(stretches, stretch[None])
                wall = replace(wall, hidden=union(np.concatenate([wall.hidden, [[low, high]]])))
        wall = replace(wall, front=supported) if on_wall else replace(wall, back=supported)
        step = replace(step, front=stretches) if front else replace(step, back=stretches)
    return wall, step


def _turned(wall: PlanLine, step: PlanLine, forward: bool) -> PlanLine:
    """`wall` turned about its origin to the mean direction of both: a closed leaf is parallel to its wall.

    A line's direction is known as the cube of its length: for stubs beside a wide door the leaf says more.
    """
    weight = step.supported_length**3 / (step.supported_length**3 + wall.supported_length**3)
    direction = (1 - weight) * wall.direction + weight * (step.direction if forward else -step.direction)
    return replace(wall, direction=direction / np.linalg.norm(direction))


def _is_leaf(supported: Array, low: float, high: float, step: PlanLine, stretch: Array, lines: list[PlanLine]) -> bool:
    """Whether [low, high] of a wall, supported beside it, is a gap of a door's width with wall at its ends."""
    if not WIDTH[0] <= high - low <= WIDTH[1] or not _is_gap(supported, low, high):
        return False
    left = total(clip(supported, low - JAMB - 0.3, low + 0.1)) > 0.1
    right = total(clip(supported, high - 0.1, high + JAMB + 0.3)) > 0.1
    left = left and bool(np.abs(supported[:, 1] - low).min() < JAMB)
    right = right and bool(np.abs(supported[:, 0] - high).min() < JAMB)
    if left and right:
        return True
    if not (left or right):
        return False
    ends = step.point(stretch)
    forward = step.along(ends)[1] > step.along(ends)[0]
    open_end = ends[1] if left == forward else ends[0]
    return _distance_to_walls(open_end, step, lines) > LEFT_FREE


def _is_standing(
    wall: PlanLine,
    supported: Array,
    low: float,
    high: float,
    depth: float,
    step: PlanLine,
    stretch: Array,
    lines: list[PlanLine],
) -> bool:
    """Whether wall is seen on both sides of [low, high], or on one and a corner is on the other, and not within it.

    depth: m from the wall to the step, positive to the left of the wall.
    """
    if high - low > STANDING_WIDTH or not _is_gap(supported, low, high):
        return False
    left = total(clip(supported, low - SHADOW, low)) > 0.1
    right = total(clip(supported, high, high + SHADOW)) > 0.1
    if left and right:
        return True
    if not DEPTH[1] < abs(depth) <= CORNER_DEPTH or high - low > CORNER_WIDTH or not (left or right):
        return False  # the stub between a corner and a recessed door, or one leg of an L-shaped room
    if min(_distance_to_walls(end, step, lines) for end in step.point(stretch)) >= SHADOW:
        return False
    seen = clip(supported, low - SHADOW, low)[-1] if left else clip(supported, high, high + SHADOW)[0]
    foot = wall.point(float(seen.mean())) + np.sign(depth) * ASIDE * wall.normal
    beside = wall.point(low - ASIDE if left else high + ASIDE) + (depth + np.sign(depth) * ASIDE) * wall.normal
    return not any(_crosses(line, foot, beside) for line in lines)


def _crosses(line: PlanLine, start: Array, end: Array) -> bool:
    """Whether a supported stretch of a line lies across the way from `start` to `end` (2,) m."""
    ends = np.stack([start, end])
    (a, b), (s, t) = line.offset(ends), line.along(ends)
    if a * b >= 0:
        return False
    place = s + a / (a - b) * (t - s)
    return bool(np.any((line.support[:, 0] <= place) & (place <= line.support[:, 1])))


def _is_gap(supported: Array, low: float, high: float) -> bool:
    return bool(coverage(supported, np.array([low]), np.array([high]))[0] < 0.25 * (high - low))


def _distance_to_walls(point: Array, step: PlanLine, lines: list[PlanLine]) -> float:
    """m from a point to the nearest supported stretch of a line that is not parallel to `step`."""
    best = np.inf
    for line in lines:
        if abs(cross2(line.direction, step.direction)) < np.sin(np.radians(30.0)):
            continue
        support = line.support
        if len(support):
            along = float(line.along(point[None])[0])
            beside = np.maximum(np.maximum(support[:, 0] - along, along - support[:, 1]), 0.0).min()
            best = min(best, float(np.hypot(beside, line.offset(point[None])[0])))
    return best
