"""The drive through an office building: round every room of a corridor, then on to the next corridor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from recon.geometry import Array

ASIDE = 0.95
"""m from a room's side and far walls that the round through it keeps."""
INSIDE = 1.5
"""m from a room's door at which the round begins: an open door's leaf ends before."""
SHORTEST = 0.3
"""m: shorter legs are left out."""


@dataclass(frozen=True)
class Bay:
    """A room beside a corridor. left, right: m, x of its side walls; near, far: y of the walls at the corridor and
    opposite; door: x of its middle."""

    left: float
    right: float
    near: float
    far: float
    door: float


@dataclass(frozen=True)
class Wing:
    """A stretch of corridor between two cross corridors. axis: m, y of its middle; ends: x of the cross corridors'
    middles; bays: the rooms on either side."""

    axis: float
    ends: tuple[float, float]
    bays: tuple[tuple[Bay, ...], tuple[Bay, ...]]


def patrol(wings: list[list[Wing]], distance: float, rng: np.random.Generator) -> Array:
    """Way points (n, 2), m, of a drive of at least `distance` m; wings: by row and block.

    The first tour takes the corridors row by row, up one side of rooms and back along the other; the next ones take
    them in random order, some with both sides on one way.
    """
    cells = [(r, b) for r in range(len(wings)) for b in range(len(wings[0]))]
    at, row, way, length, tour = (wings[0][0].ends[0], wings[0][0].axis), 0, [], 0.0, 0
    way.append(at)
    while length < distance:
        order = [cells[i] for i in (rng.permutation(len(cells)) if tour else range(len(cells)))]
        for r, b in order:
            wing = wings[r][b]
            start = min(wing.ends, key=lambda x: abs(x - at[0]))
            legs = [(start, wings[row][0].axis), (start, wing.axis)]
            there = tour == 0 or rng.random() < 0.5
            legs += _both_ways(wing, start, rng) if there else _one_way(wing, start, rng)
            for leg in legs:
                length += float(np.hypot(leg[0] - way[-1][0], leg[1] - way[-1][1]))
                way.append(leg)
            at, row = way[-1], r
        tour += 1
    return _cut(np.array(way), distance)


def _both_ways(wing: Wing, start: float, rng: np.random.Generator) -> list[tuple[float, float]]:
    """Up along one side of the corridor and back along the other."""
    end = wing.ends[0] if start == wing.ends[1] else wing.ends[1]
    first, second = (wing.bays[k] for k in rng.permutation(2))
    out: list[tuple[float, float]] = []
    for bays, forth in ((first, end > start), (second, end < start)):
        for bay in sorted(bays, key=lambda bay: bay.door if forth else -bay.door):
            out += _round(bay, wing.axis, rng)
        out.append((end if bays is first else start, wing.axis))
    return out


def _one_way(wing: Wing, start: float, rng: np.random.Generator) -> list[tuple[float, float]]:
    """All rooms on both sides from one end of the corridor to the other."""
    end = wing.ends[0] if start == wing.ends[1] else wing.ends[1]
    out: list[tuple[float, float]] = []
    for bay in sorted((*wing.bays[0], *wing.bays[1]), key=lambda bay: abs(bay.door - start)):
        out += _round(bay, wing.axis, rng)
    return [*out, (end, wing.axis)]


def _round(bay: Bay, axis: float, rng: np.random.Generator) -> list[tuple[float, float]]:
    """From the corridor through the door, once round the room, and out."""
    inwards = 1.0 if bay.far > bay.near else -1.0
    y = (bay.near + inwards * INSIDE, bay.far - inwards * ASIDE)
    x = [bay.left + ASIDE, bay.right - ASIDE]
    if rng.random() < 0.5:
        x.reverse()
    ring = [(x[0], y[0]), (x[0], y[1]), (x[1], y[1]), (x[1], y[0])]
    door = [(bay.door, axis), (bay.door, y[0])]
    return [*door, *ring, *door[::-1]]


def _cut(points: Array, distance: float) -> Array:
    """The first `distance` m, without the shortest legs."""
    kept = [points[0]]
    for k, point in enumerate(points[1:], 1):
        if np.hypot(*(point - kept[-1])) >= SHORTEST or (
            k + 1 < len(points) and np.hypot(*(points[k + 1] - kept[-1])) < 1e-9
        ):
            kept.append(point)
    out = np.array(kept)
    driven = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(out, axis=0), axis=1))])
    return out[: int(np.searchsorted(driven, distance)) + 1]
