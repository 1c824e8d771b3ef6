"""Faces of walls back to back: which stretches of two faces bound one physical wall."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from recon.geometry import Array
from recon.model import Wall

THICKEST = 0.6
"""m between the two faces of one wall, at most (as `Wall.thickness`)."""
FLATTEST = 0.01
"""m: faces nearer to each other have no wall between them."""
PARALLEL = float(np.cos(np.radians(5.0)))
SHORTEST = 0.02
"""m: shorter stretches join the one beside them."""
ALIKE = 0.03
"""m: stretches of one face whose thicknesses differ by no more are one wall."""


@dataclass(frozen=True)
class Strip:
    """A stretch of a wall's face, from `low` to `high` m from the face's start, and the face behind it, if any.

    face, behind: indices of walls. depth: m between them in the middle of the stretch, None without a face behind.
    """

    face: int
    low: float
    high: float
    behind: int | None = None
    depth: float | None = None

    @property
    def length(self) -> float:
        """m."""
        return self.high - self.low


def strips_of(walls: Sequence[Wall]) -> list[list[Strip]]:
    """Of every wall the strips along its face, from its start to its end, without gaps.

    A stretch with a face behind it appears in both walls. Where several faces lie behind, the nearest counts.
    """
    import shapely

    if not walls:
        return []
    lines = shapely.linestrings(np.array([[w.start, w.end] for w in walls]))
    near = shapely.STRtree(lines).query(lines, predicate="dwithin", distance=THICKEST)
    found: list[list[Strip]] = [[] for _ in walls]
    for i, k in zip(*near.tolist(), strict=True):
        strip = _pair(walls, i, k) if i != k else None
        if strip is not None:
            found[i].append(strip)
    kept = [_nearest(walls[i], strips) for i, strips in enumerate(found)]
    both = {(s.face, s.behind) for strips in kept for s in strips}
    mutual = [[s for s in strips if (s.behind, s.face) in both] for strips in kept]
    return [_filled(i, wall.length, strips) for i, (wall, strips) in enumerate(zip(walls, mutual, strict=True))]


def without_touching(walls: Sequence[Wall], rows: Sequence[Sequence[Strip]]) -> list[list[Strip]]:
    """Strips less those stretches at which two faces touch back to back, so that no ground is left between them."""
    import shapely

    if not walls:
        return []
    lines = shapely.linestrings(np.array([[w.start, w.end] for w in walls]))
    near = shapely.STRtree(lines).query(lines, predicate="dwithin", distance=FLATTEST)
    taken: list[list[tuple[float, float]]] = [[] for _ in walls]
    for i, k in zip(*near.tolist(), strict=True):
        shared = _shared(walls[i], walls[k]) if i != k else None
        if shared is not None and abs(shared[2]) < FLATTEST:
            taken[i].append(shared[:2])
    return [[part for strip in row for part in _less(strip, spans)] for row, spans in zip(rows, taken, strict=True)]


def _less(strip: Strip, spans: Iterable[tuple[float, float]]) -> list[Strip]:
    """What is left of a strip with nothing behind it beside some spans, m from the face's start."""
    rest = [(strip.low, strip.high)]
    for low, high in spans if strip.depth is None else ():
        cut = [(a, min(b, low)) for a, b in rest] + [(max(a, high), b) for a, b in rest]
        rest = [(a, b) for a, b in cut if b - a >= SHORTEST]
    return [Strip(strip.face, a, b, strip.behind, strip.depth) for a, b in sorted(rest)]


def _pair(walls: Sequence[Wall], i: int, k: int) -> Strip | None:
    """The stretch of face i that has face k behind it; None where they are not back to back."""
    shared = _shared(walls[i], walls[k])
    if shared is None or not FLATTEST <= shared[2] <= THICKEST:
        return None
    return Strip(i, shared[0], shared[1], k, shared[2])


def _shared(wall: Wall, other: Wall) -> tuple[float, float, float] | None:
    """Of two faces that look away from each other the stretch of the first beside the second, and how deep behind."""
    if wall.normal @ other.normal > -PARALLEL:
        return None
    low, high = sorted(float((end - wall.start) @ wall.direction) for end in (other.start, other.end))
    low, high = max(low, 0.0), min(high, wall.length)
    if high - low < SHORTEST:
        return None
    middle: Array = wall.start + 0.5 * (low + high) * wall.direction
    return low, high, float((other.start - middle) @ other.normal)


def _nearest(wall: Wall, strips: Iterable[Strip]) -> list[Strip]:
    """Strips that do not overlap: of those that do the one less deep keeps its stretch, the others what is left."""
    out: list[Strip] = []
    for strip in sorted(strips, key=lambda s: (s.depth or 0.0, s.low, s.behind or 0)):
        rest = [(strip.low, strip.high)]
        for taken in out:
            cut = [(a, min(b, taken.low)) for a, b in rest] + [(max(a, taken.high), b) for a, b in rest]
            rest = [(a, b) for a, b in cut if b - a >= SHORTEST]
        out += [Strip(strip.face, a, b, strip.behind, strip.depth) for a, b in rest]
    return sorted(out, key=lambda s: s.low)


def _filled(face: int, length: float, strips: list[Strip]) -> list[Strip]:
    """Strips with nothing behind in the gaps; gaps that are too short go to the strip before or after."""
    out: list[Strip] = []
    position = 0.0
    for strip in strips:
        gap = strip.low - position
        if gap >= SHORTEST:
            out.append(Strip(face, position, strip.low))
        low = strip.low if gap >= SHORTEST else position
        out.append(Strip(face, low, strip.high, strip.behind, strip.depth))
        position = strip.high
    if length - position >= SHORTEST or not out:
        out.append(Strip(face, position, length))
    elif position < length:
        last = out.pop()
        out.append(Strip(face, last.low, length, last.behind, last.depth))
    return out


def grouped_strips(rows: Sequence[Sequence[Strip]]) -> list[list[Strip]]:
    """Strips (those of every face) that belong to one physical wall, in the order of their first faces.

    The two faces of a stretch are one wall. Along a face neighbours are where their thicknesses are alike; a stretch
    with nothing behind joins the neighbour before it, else the one after.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    flat = [strip for row in rows for strip in row]
    firsts = np.cumsum([0, *map(len, rows)]).tolist()
    pairs = [(first + a, first + b) for first, row in zip(firsts, rows, strict=False) for a, b in _alike(row)]
    by_faces: dict[tuple[int, int], list[int]] = {}
    for n, strip in enumerate(flat):
        if strip.behind is not None:
            by_faces.setdefault((min(strip.face, strip.behind), max(strip.face, strip.behind)), []).append(n)
    pairs += [(members[0], other) for members in by_faces.values() for other in members[1:]]
    index = np.array(pairs, dtype=np.int64).reshape(-1, 2)
    graph = coo_array((np.ones(len(index)), (index[:, 0], index[:, 1])), shape=(len(flat), len(flat)))
    groups: dict[int, list[Strip]] = {}
    for strip, label in zip(flat, connected_components(graph, directed=False)[1].tolist(), strict=True):
        groups.setdefault(label, []).append(strip)
    return list(groups.values())


def _alike(row: Sequence[Strip]) -> list[tuple[int, int]]:
    """Pairs of strips of one face that are one wall."""
    pairs = []
    deep = [n for n, strip in enumerate(row) if strip.depth is not None]
    for n, strip in enumerate(row):
        if strip.depth is None and deep:
            pairs.append((max((k for k in deep if k < n), default=deep[0]), n))
    for a, b in pairwise(deep):
        first, second = row[a].depth, row[b].depth
        if first is not None and second is not None and abs(first - second) <= ALIKE:
            pairs.append((a, b))
    return pairs
