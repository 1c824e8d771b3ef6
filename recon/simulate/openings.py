"""Doors, passages and windows of a plan: where they pierce which walls."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from recon.errors import InputError
from recon.geometry import Array
from recon.simulate.plan import Plan, PlanOpening, PlanRoom

THICKEST_WALL = 0.6
"""m; a room this close behind an opening is the room that it leads to."""
LEAF_THICKNESS = 0.04
RECESS = {"door": 0.06, "window": 0.05, "passage": 0.0}
"""m; how far the leaf or glass lies behind the wall where no room is behind it."""


@dataclass(frozen=True)
class Niche:
    """An opening as one wall shows it: a hole in the wall, reveals, and what closes it at the back.

    wall: the wall's id. front, back: (2, 2) m, plan frame: the jambs' corners on the wall and at the depth where this
    wall's part ends; first the one nearer the wall's start. closed: a leaf, glass or nothing.
    """

    opening: int
    type: Literal["door", "passage", "window"]
    room: int
    wall: int
    front: Array
    back: Array
    bottom: float
    top: float
    closed: Literal["leaf", "glass", "nothing"]


def first_wall_ids(plan: Plan) -> list[int]:
    """Wall id of edge 0 of every room; ids count through all rooms' edges in order."""
    counts = [len(room.polygon) for room in plan.rooms]
    return [int(n) for n in np.cumsum([0, *counts[:-1]])]


def edge(plan: Plan, room: int, wall: int) -> tuple[Array, Array]:
    """Start and end (2,) of edge `wall` of room `room`, plan frame, m."""
    polygon = plan.rooms[room].polygon
    return np.array(polygon[wall]), np.array(polygon[(wall + 1) % len(polygon)])


def near(room: PlanRoom, points: Array, margin: float) -> bool:
    """Whether the bounding boxes of a room and of points (n, 2) are at most `margin` m apart: a quick first look."""
    x, y = zip(*room.polygon, strict=True)
    (x0, y0), (x1, y1) = points.min(axis=0) - margin, points.max(axis=0) + margin
    return bool(min(x) <= x1 and max(x) >= x0 and min(y) <= y1 and max(y) >= y0)


def niches(plan: Plan) -> list[Niche]:
    """Every opening as its wall shows it and, where it leads to another room, as that room's wall shows it.

    Raises InputError where a passage or open door leads nowhere, a window into a room, or the wall behind is too short.
    """
    return [niche for index in range(len(plan.openings)) for niche in opening_niches(plan, index)]


def opening_niches(plan: Plan, index: int) -> list[Niche]:
    """`niches` of one opening."""
    opening = plan.openings[index]
    start, end = edge(plan, opening.room, opening.wall)
    along = (end - start) / np.linalg.norm(end - start)
    front = start + along * np.array([[opening.offset], [opening.offset + opening.width]])
    behind = _wall_behind(plan, opening, front, np.array([along[1], -along[0]]), f"openings[{index}]")
    if opening.type == "window" and behind is not None:
        raise InputError(f"openings[{index}]: this window looks into room {behind[0]}; windows need an outer wall")
    if behind is None:
        return [_recess(plan, index, front, np.array([along[1], -along[0]]))]
    room, wall, far = behind
    closed: Literal["leaf", "nothing"] = "leaf" if opening.type == "door" and not opening.open else "nothing"
    thickness = float(np.linalg.norm(far - front, axis=1).min())
    share = 0.5 - (min(LEAF_THICKNESS, 0.5 * thickness) / 2 / thickness if closed == "leaf" else 0.0)
    first = first_wall_ids(plan)
    near_back, far_back = front + share * (far - front), far + share * (front - far)
    z = (opening.bottom, opening.top)
    return [
        Niche(index, opening.type, opening.room, first[opening.room] + opening.wall, front, near_back, *z, closed),
        Niche(index, opening.type, room, first[room] + wall, far[::-1], far_back[::-1], *z, closed),
    ]


def _recess(plan: Plan, index: int, front: Array, outward: Array) -> Niche:
    opening = plan.openings[index]
    if opening.type == "passage" or opening.open:
        what = "passage" if opening.type == "passage" else "open door"
        raise InputError(
            f"openings[{index}]: this {what} leads nowhere; a wall of another room is expected"
            f" at most {THICKEST_WALL:g} m behind it"
        )
    wall = first_wall_ids(plan)[opening.room] + opening.wall
    back = front + RECESS[opening.type] * outward
    closed: Literal["leaf", "glass"] = "glass" if opening.type == "window" else "leaf"
    z = (opening.bottom, opening.top)
    return Niche(index, opening.type, opening.room, wall, front, back, *z, closed)


def _wall_behind(
    plan: Plan, opening: PlanOpening, front: Array, outward: Array, where: str
) -> tuple[int, int, Array] | None:
    """Room, edge and (2, 2) corners where the jambs meet the nearest wall behind that faces this one."""
    best: tuple[float, int, int, Array] | None = None
    for room, shape in enumerate(plan.rooms):
        if not near(shape, front, THICKEST_WALL + 0.01):
            continue
        for wall in range(len(shape.polygon)):
            start, end = edge(plan, room, wall)
            length = float(np.linalg.norm(end - start))
            along = (end - start) / length
            facing = along @ np.array([outward[1], -outward[0]])
            if facing < 0.95 or (room, wall) == (opening.room, opening.wall):
                continue
            normal = np.array([-along[1], along[0]])
            depth = ((start - front) @ normal) / (outward @ normal)
            far = front + depth[:, None] * outward
            position = (far - start) @ along
            inside = (position > -1e-6) & (position < length + 1e-6)
            if depth.min() <= 1e-6 or depth.max() > THICKEST_WALL or not _overlap(position, length):
                continue
            if not inside.all():
                raise InputError(f"{where}: the opening reaches past the end of wall {wall} of room {room} behind it")
            if best is None or depth.mean() < best[0]:
                best = (float(depth.mean()), room, wall, far)
    return None if best is None else best[1:]


def _overlap(position: Array, length: float) -> bool:
    return bool(position.max() > 1e-6 and position.min() < length - 1e-6)
