"""A big office building: rows of rooms along corridors that cross, so that a long drive comes round in many loops."""

from __future__ import annotations

import numpy as np
from shapely import MultiLineString

from recon.errors import InputError
from recon.geometry import Array
from recon.simulate.furnish import furnish
from recon.simulate.openings import niches
from recon.simulate.patrol import Bay, Wing, patrol
from recon.simulate.plan import Plan, PlanCamera, PlanDrive, PlanLidar, PlanOpening, PlanRoom

WING = 12
"""Rooms along a stretch of corridor."""
WIDTH, NARROWEST = 4.0, 2.9
"""m, mean and least width of a room."""
DEPTH = (4.2, 5.8)
"""m from the corridor to a room's far wall."""
THICKNESS = 0.2
"""m, of every wall."""
DOOR = 1.0
"""m, width."""
FREE = 0.42
"""m on either side of the drive that stay free of furniture."""


def office_plan(seed: int, rooms: int = 200, distance: float = 1e3, variety: float = 1.0, clutter: float = 0.3) -> Plan:
    """An office building of `rooms` rooms (12 to 400), not counting corridors, and a patrol of `distance` m in it.

    Corridors run in rows between cross corridors; every room has a way to its corridor, some have one to the next room.
    The patrol goes round every room of a corridor before the next, and begins anew in another order until it is long
    enough. variety: 0 (all rooms alike) to 1. clutter: 0 (empty) to 1. No images. Raises InputError for numbers out of
    range.
    """
    if not (12 <= rooms <= 400 and 10 <= distance <= 1e5 and 0 <= variety <= 1 and 0 <= clutter <= 1):
        raise InputError(
            f"office_plan: rooms {rooms} (12 to 400), distance {distance:g} (10 to 100000), variety {variety:g} and "
            f"clutter {clutter:g} (0 to 1)"
        )
    rng = np.random.default_rng([seed, rooms, 41])
    wings, cross, height = _wings(rooms, variety, rng)
    shapes, openings = _rooms(wings, cross, height, variety, rng)
    way = patrol(wings, distance, np.random.default_rng([seed, rooms, 43]))
    path = tuple((round(float(x), 4), round(float(y), 4)) for x, y in way)
    plan = Plan(
        tuple(shapes), path, tuple(openings), name=f"office {seed}", drive=PlanDrive(speed=1.0, corner_radius=0.3),
        camera=PlanCamera(rate=0.0), lidar=PlanLidar(beams=360, fov_deg=360.0, range_max=20.0, rate=7.0),
    )  # fmt: skip
    legs = np.unique(np.sort(np.stack([way[:-1], way[1:]], axis=1).round(4), axis=1), axis=0)
    return furnish(plan, niches(plan), clutter, rng, MultiLineString(list(legs)).buffer(FREE))


def _wings(rooms: int, variety: float, rng: np.random.Generator) -> tuple[list[list[Wing]], Array, float]:
    """Wings by row and block, x (C, 2) of the cross corridors' walls, and the building's inner height (m, y)."""
    rows = max(2, round(np.sqrt(rooms / WING)))
    blocks = -(-rooms // (WING * rows))
    sides = 2 * rows * blocks
    counts = np.full(sides, rooms // sides) + (np.arange(sides) < rooms % sides)
    width = WIDTH * counts.max()
    half = 1.2
    left = (2 * half + 2 * THICKNESS + width) * np.arange(blocks + 1)
    cross = np.stack([left, left + 2 * half], axis=1)
    bottom, out = 0.0, []
    for r in range(rows):
        below, above = (float(d) for d in np.mean(DEPTH) + variety * (rng.uniform(*DEPTH, 2) - np.mean(DEPTH)))
        aisle = 2.0 + variety * float(rng.uniform(-0.2, 0.4))
        low = bottom + below + THICKNESS
        axis, top = low + aisle / 2, low + aisle + THICKNESS
        row = []
        for b in range(blocks):
            x0, x1 = cross[b, 1] + THICKNESS, cross[b + 1, 0] - THICKNESS
            number = counts[2 * (r * blocks + b) : 2 * (r * blocks + b) + 2]
            bays = (
                _bays(x0, x1, (low - THICKNESS, bottom), int(number[0]), variety, rng),
                _bays(x0, x1, (top, top + above), int(number[1]), variety, rng),
            )
            row.append(Wing(axis, (float(cross[b].mean()), float(cross[b + 1].mean())), bays))
        out.append(row)
        bottom = top + above + THICKNESS
    return out, cross, bottom - THICKNESS


def _bays(
    x0: float, x1: float, y: tuple[float, float], count: int, variety: float, rng: np.random.Generator
) -> tuple[Bay, ...]:
    """`count` rooms from x0 to x1; y: of the walls at the corridor and opposite."""
    free = x1 - x0 - (count - 1) * THICKNESS
    spare = free - count * NARROWEST
    share = (1.0 - variety) / count + variety * rng.dirichlet(np.full(count, 4.0))
    right = x0 + np.cumsum(NARROWEST + spare * share + THICKNESS) - THICKNESS
    left = np.concatenate([[x0], right[:-1] + THICKNESS])
    place = 0.5 + 0.5 * variety * rng.uniform(-1.0, 1.0, count)
    door = left + 0.95 + place * (right - left - 1.9)
    return tuple(Bay(float(a), float(b), y[0], y[1], float(d)) for a, b, d in zip(left, right, door, strict=True))


def _rooms(
    wings: list[list[Wing]], cross: Array, height: float, variety: float, rng: np.random.Generator
) -> tuple[list[PlanRoom], list[PlanOpening]]:
    """Cross corridors first, then every wing's corridor and its rooms."""
    shapes = [_box(f"cross {i}", a, b, 0.0, height) for i, (a, b) in enumerate(cross)]
    openings = []
    for r, row in enumerate(wings):
        for b, wing in enumerate(row):
            corridor = len(shapes)
            below, above = wing.bays
            low, high = below[0].near + THICKNESS, above[0].near - THICKNESS
            shapes.append(_box(f"corridor {r}.{b}", below[0].left, below[-1].right, low, high))
            width = round(high - low - 0.3, 4)
            openings += [PlanOpening("passage", corridor, wall, 0.15, width, 0.0, 2.3) for wall in (1, 3)]
            for side in wing.bays:
                for k, bay in enumerate(side):
                    room = len(shapes)
                    shapes.append(_box(f"room {room}", bay.left, bay.right, *sorted((bay.near, bay.far))))
                    openings.append(_door(room, bay, rng.random() < 0.3))
                    if k and rng.random() < 0.15 * variety:
                        openings.append(PlanOpening("passage", room, 3, 1.6, 0.9))
    return shapes, openings


def _box(name: str, x0: float, x1: float, y0: float, y1: float) -> PlanRoom:
    x0, x1, y0, y1 = (round(float(v), 4) for v in (x0, x1, y0, y1))
    return PlanRoom(((x0, y0), (x1, y0), (x1, y1), (x0, y1)), name)


def _door(room: int, bay: Bay, leaf: bool) -> PlanOpening:
    """A room's way to its corridor, with an open door's leaf or without."""
    above = bay.far > bay.near
    offset = (bay.door - bay.left if above else bay.right - bay.door) - DOOR / 2
    return PlanOpening("door" if leaf else "passage", room, 0 if above else 2, round(offset, 4), DOOR, open=leaf)
