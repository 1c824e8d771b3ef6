"""Random furniture along the walls of a plan and in the middle of its rooms."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np

from recon.geometry import Array
from recon.simulate.building import room_height
from recon.simulate.check import footprint
from recon.simulate.openings import Niche, edge
from recon.simulate.plan import ObjectStyle, Plan, PlanObject

if TYPE_CHECKING:
    from shapely import Geometry

KINDS: tuple[tuple[ObjectStyle, tuple[float, float], tuple[float, float], tuple[float, float]], ...] = (
    ("cabinet", (0.6, 1.6), (0.4, 0.6), (0.8, 2.0)),
    ("cabinet", (0.4, 0.5), (0.4, 0.6), (0.6, 1.4)),
    ("carton", (0.3, 0.6), (0.3, 0.5), (0.25, 0.6)),
    ("fabric", (1.2, 2.0), (0.7, 0.9), (0.6, 0.8)),
    ("metal", (0.8, 1.2), (0.3, 0.4), (1.6, 2.1)),
    ("plastic", (0.25, 0.4), (0.25, 0.4), (0.3, 0.7)),
)
"""Style, and ranges of length, depth and height, m, of what stands along walls."""


def furnish(
    plan: Plan, found: list[Niche], clutter: float, rng: np.random.Generator, way: Geometry | None = None
) -> Plan:
    """The plan with `clutter` (0 none, 1 full) furniture; openings, `way` and one another stay clear."""
    from shapely import Polygon, union_all

    for r, room in enumerate(plan.rooms):
        shape = Polygon(room.polygon)
        closed = [Polygon(n.front[[0, 1, 1]]).buffer(0.35) for n in found if n.room == r and n.closed != "nothing"]
        ways = [Polygon(n.front[[0, 1, 1]]).buffer(1.2) for n in found if n.room == r and n.closed == "nothing"]
        blocked = union_all([*closed, *ways, *([] if way is None else [way.intersection(shape)])])
        for _ in range(rng.poisson(clutter * min(shape.area, 30.0) * 0.4)):
            group = _table(shape, rng) if rng.random() < 0.2 else [_along_wall(plan, r, rng)]
            outlines = [Polygon(footprint(item)) for item in group]
            if all(shape.covers(o) and o.distance(blocked) > 0.0 for o in outlines):
                plan = dataclasses.replace(plan, objects=(*plan.objects, *group))
                blocked = union_all([blocked, *(o.buffer(0.05) for o in outlines)])
    return plan


def _along_wall(plan: Plan, room: int, rng: np.random.Generator) -> PlanObject:
    start, end = edge(plan, room, int(rng.integers(len(plan.rooms[room].polygon))))
    length = float(np.linalg.norm(end - start))
    along = (end - start) / length
    style, *ranges = KINDS[rng.integers(len(KINDS))]
    size_u, size_v, height = (float(rng.uniform(*r)) for r in ranges)
    corridor_like = room_width(plan, room) < 3.0
    size_v = min(size_v, 0.4) if corridor_like else size_v
    position = start + along * rng.uniform(0.0, max(length - size_u, 0.01)) + along * size_u / 2
    center = position + np.array([-along[1], along[0]]) * (size_v / 2 + rng.uniform(0.01, 0.06))
    top = min(height, room_height(plan, room))
    at, yaw = _rounded(center), round(float(np.degrees(np.arctan2(along[1], along[0]))), 3)
    if style == "plastic" and rng.random() < 0.7:
        return PlanObject(at, (round(size_v, 3),) * 2, "cylinder", yaw, 0.0, round(top, 3), style)
    return PlanObject(at, (round(size_u, 3), round(size_v, 3)), "box", yaw, 0.0, round(top, 3), style)


def room_width(plan: Plan, room: int) -> float:
    """Twice the radius of the largest circle in a room, m."""
    from shapely import Polygon, maximum_inscribed_circle

    return 2.0 * float(maximum_inscribed_circle(Polygon(plan.rooms[room].polygon), tolerance=0.1).length)


def _table(shape: object, rng: np.random.Generator) -> list[PlanObject]:
    """A table on four legs, of which a LiDAR sees the legs only, anywhere in the room."""
    x0, y0, x1, y1 = shape.bounds  # type: ignore[attr-defined]
    center, yaw = np.array([rng.uniform(x0, x1), rng.uniform(y0, y1)]), rng.uniform(0, 180)
    w, d = rng.uniform(0.8, 1.5), rng.uniform(0.6, 0.8)
    turn = np.array(
        [[np.cos(np.radians(yaw)), -np.sin(np.radians(yaw))], [np.sin(np.radians(yaw)), np.cos(np.radians(yaw))]]
    )
    yaw_deg = round(float(yaw), 3)
    top = PlanObject(_rounded(center), (round(w, 3), round(d, 3)), "box", yaw_deg, 0.70, 0.74, "wood")
    legs = []
    for sx, sy in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
        at = center + turn @ np.array([sx * (w / 2 - 0.05), sy * (d / 2 - 0.05)])
        legs.append(PlanObject(_rounded(at), (0.05, 0.05), "box", yaw_deg, 0.0, 0.70, "metal"))
    return [top, *legs]


def _rounded(point: Array) -> tuple[float, float]:
    return round(float(point[0]), 4), round(float(point[1]), 4)
