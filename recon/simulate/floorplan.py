"""Random floor plans: a corridor with rooms off it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from recon.geometry import Array, rotation2
from recon.simulate.plan import PlanRoom

if TYPE_CHECKING:
    from shapely.geometry import Polygon

Angles = Literal["manhattan", "any"]


def random_rooms(rooms: int, angles: Angles, rng: np.random.Generator) -> tuple[list[PlanRoom], list[tuple[int, int]]]:
    """`rooms` rooms, the first a corridor (when there are two or more), and where the others hang.

    The second result names, for each room after the first, the edge of it (its base) that lies along the corridor.
    Manhattan plans have right angles only; the others have bends and walls at any angle.
    """
    if rooms == 1:
        size = rng.uniform(3.5, 7.0, 2)
        shape = _outline(float(size[0]), float(size[1]), angles, rng)
        return [_room("room", _moved(shape, np.zeros(2), 0.0))], []
    stretch = 1.0
    while True:
        corridor = _corridor(rooms, angles, stretch, rng)
        placed = _hang_rooms(corridor, rooms - 1, angles, rng)
        if len(placed) == rooms - 1:
            break
        stretch *= 1.1
    turn = rng.uniform(-np.pi, np.pi)
    names = ["corridor", *(f"room {i}" for i in range(1, rooms))]
    outlines = [_moved(p, np.zeros(2), turn) for p in (corridor, *placed)]
    return [_room(n, p) for n, p in zip(names, outlines, strict=True)], [(i, 0) for i in range(1, rooms)]


def _room(name: str, polygon: Array) -> PlanRoom:
    return PlanRoom(tuple((round(float(x), 4), round(float(y), 4)) for x, y in polygon), name)


def _moved(polygon: Array, shift: Array, turn: float) -> Array:
    return polygon @ rotation2(turn).T + shift


def _corridor(rooms: int, angles: Angles, stretch: float, rng: np.random.Generator) -> Array:
    """A counter-clockwise corridor: straight, bent, a T or a plus; long enough for its rooms when stretched enough."""
    from shapely import LineString, union_all

    total = max(5.0, 1.9 * (rooms - 1) + 2.0) * stretch
    kinds = ["I", "L"] if rooms < 4 else ["I", "L", "Z", "T", "plus"]
    kind = kinds[rng.integers(len(kinds))]
    bend = np.pi / 2 if angles == "manhattan" else rng.uniform(np.radians(30), np.radians(75))
    bend *= rng.choice([-1.0, 1.0])
    a, b, c = total * rng.dirichlet([6.0, 6.0, 6.0])
    east, turned = np.array([1.0, 0.0]), np.array([np.cos(bend), np.sin(bend)])
    origin = np.zeros(2)
    lines = {
        "I": [[origin, total * east]],
        "L": [[origin, (a + b / 2) * east, (a + b / 2) * east + (c + b / 2) * turned]],
        "Z": [[origin, a * east, a * east + b * turned, a * east + b * turned + c * east]],
        "T": [[origin, (a + b) * east], [a * east, a * east + c * turned]],
        "plus": [[origin, (a + b) * east], [a * east - c * turned / 2, a * east + c * turned / 2]],
    }[kind]
    half = rng.uniform(0.85, 1.25)
    shape = union_all([LineString(line).buffer(half, cap_style="flat", join_style="mitre") for line in lines])
    corners = np.asarray(shape.simplify(1e-6).exterior.coords)[:-1]
    area = np.sum(corners[:, 0] * np.roll(corners[:, 1], -1) - corners[:, 1] * np.roll(corners[:, 0], -1))
    return corners if area > 0 else corners[::-1]


def _hang_rooms(corridor: Array, count: int, angles: Angles, rng: np.random.Generator) -> list[Array]:
    """Up to `count` rooms along the corridor's edges, neighbours wall to wall where chance says so."""
    from shapely import Polygon

    thickness = float(rng.uniform(0.10, 0.25))
    taken: list[Polygon] = [Polygon(corridor)]
    out: list[Array] = []
    starts: list[tuple[int, float]] = [(e, 0.0) for e in range(len(corridor))]
    for _ in range(60 * count):
        if len(out) == count:
            break
        e, offset = starts[rng.integers(len(starts))]
        start, end = corridor[e], corridor[(e + 1) % len(corridor)]
        length = float(np.linalg.norm(end - start))
        width, depth = rng.uniform(2.7, 5.5), rng.uniform(2.8, 5.5)
        if length < 2.2 or min(offset + width, length) - offset < 2.0:
            continue
        along = (end - start) / length
        outward = np.array([along[1], -along[0]])
        corner = start + offset * along + thickness * outward
        local = _outline(width, depth, angles, rng)
        # the room's own frame has its base edge first, seen from the corridor it runs backwards
        shape = corner + (width - local[:, :1]) * along + local[:, 1:] * outward
        polygon = Polygon(shape)
        if min(polygon.distance(other) for other in taken) < thickness - 1e-6:
            continue
        taken.append(polygon)
        out.append(shape)
        starts.append((e, offset + width + thickness))
    return out


def _outline(width: float, depth: float, angles: Angles, rng: np.random.Generator) -> Array:
    """A counter-clockwise room within [0, width] x [0, depth] whose first edge is the whole base."""
    w, d = width, depth
    pick = rng.random()
    a, b = w * rng.uniform(0.3, 0.5), d * rng.uniform(0.3, 0.5)
    if angles == "manhattan":
        if pick < 0.7:
            return np.array([[0, 0], [w, 0], [w, d], [0, d]])
        if pick < 0.85:
            return np.array([[0, 0], [w, 0], [w, d], [a, d], [a, d - b], [0, d - b]])
        return np.array([[0, 0], [w, 0], [w, d - b], [w - a, d - b], [w - a, d], [0, d]])
    if pick < 0.25:
        return np.array([[0, 0], [w, 0], [w, d], [0, d]])
    if pick < 0.5:
        return np.array([[0, 0], [w, 0], [w, d - b], [w - a, d], [0, d]])
    if pick < 0.75:
        return np.array([[0, 0], [w, 0], [w, d], [0, d - b]])
    return np.array([[0, 0], [w, 0], [w - 0.5 * a, d], [0.3 * a, d - 0.5 * b]])
