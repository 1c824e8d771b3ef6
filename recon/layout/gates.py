"""Doorways between walls that lie on no line together: narrow places between two wider ones, in line with a wall."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import shapely
from numpy.typing import NDArray

from recon.geometry import Array
from recon.layout.evidence import FreeSpace
from recon.layout.frontier import SIGMA_ANGLE, SIGMA_OFFSET
from recon.layout.line import NONE, PlanLine, union

WIDEST = 1.4
"""m of a doorway; what is wider and has walls in line on both sides, `rooms.PASSAGE` wide at most, is found there."""
SLIT = 0.55
"""m; a gap between a wall and the next that is narrower than any door is one in what was seen."""
SHORTEST_WALL = 0.5
"""m of the wall that a doorway is in line with."""
ALIGNED = float(np.cos(np.radians(30.0)))
"""Cosine of the angle between a doorway and its wall, at least."""
ASIDE = 0.06
"""m off the line of the wall, where the other jamb is on it all the same."""
OWN = 0.1
"""m; a jamb this near to another one's doorway is that doorway's."""
PASSED = 0.7
"""Share of a doorway that rays went through, at least."""
BEFORE = (0.3, 0.45, 0.6, 0.8, 1.0)
"""m before and behind a doorway (walls are up to so thick), where it is wider ..."""
WIDER = 0.5
"""... by this, m, at one of these places at least, on both sides."""
FURTHEST = 4.0
"""m to either side that counts."""


def with_gates(lines: list[PlanLine], space: FreeSpace) -> list[PlanLine]:
    """Lines with the doorways at the ends of their walls (`gates`), and lines of those that lead aside.

    A doorway goes from the end of a wall on to the nearest other wall. One widens on both sides of it, so that a
    corridor's mouth, which only does on one, is none.
    """
    owner, spans, segments = _walls(lines)
    if len(owner) == 0:
        return lines
    tree = shapely.STRtree(segments)
    out, aside = list(lines), []
    jambs = [place for line in lines for place in _gaps(line)]
    for k, start, way in _ends(lines, owner, spans):
        end = _opposite(start, way, tree, segments)
        if end is None or not _is_doorway(start, end, tree, segments, space):
            continue
        line = out[k]
        if abs(float(line.offset(end[None])[0])) > ASIDE:
            aside.append((start, end))
            continue
        gate = np.sort(line.along(np.stack([start, end])))[None]
        out[k] = replace(line, gates=union(np.concatenate([line.gates, gate])))
        jambs += [start, end]
    return out + _aside(aside, np.array(jambs).reshape(-1, 2))


def _aside(ways: list[tuple[Array, Array]], jambs: Array) -> list[PlanLine]:
    """Lines of doorways (start, end) that are on no wall's line, but for those whose jambs have one of their own."""
    out: list[PlanLine] = []
    for start, end in ways:
        away = np.linalg.norm(np.stack([start, end])[:, None] - jambs, axis=2)
        if away.min(initial=np.inf) > OWN:
            out.append(_line(start, end))
            jambs = np.concatenate([jambs, [start, end]])
    return out


def _walls(lines: list[PlanLine]) -> tuple[NDArray[np.int64], Array, NDArray[np.object_]]:
    """Stretches of wall: their lines (S,), where on them (S, 2), and as line strings."""
    parts = [union(line.support, SLIT) if len(line.support) else NONE for line in lines]
    owner = np.repeat(np.arange(len(lines)), [len(part) for part in parts])
    ends = [line.point(part) for line, part in zip(lines, parts, strict=True) if len(part)]
    segments = shapely.linestrings(np.concatenate(ends) if ends else np.zeros((0, 2, 2)))
    return owner, np.concatenate([*parts, NONE]), np.atleast_1d(segments)


def _gaps(line: PlanLine) -> Array:
    """(n, 2) the jambs of gaps of a doorway's width between the stretches of a line."""
    part = union(line.support, SLIT)
    narrow = part[1:, 0] - part[:-1, 1] <= WIDEST
    return line.point(np.concatenate([part[:-1, 1][narrow], part[1:, 0][narrow]]))


def _ends(lines: list[PlanLine], owner: NDArray[np.int64], spans: Array) -> Iterator[tuple[int, Array, Array]]:
    """Line, place and unit vector onwards of both ends of every long enough stretch."""
    for k, (low, high) in zip(owner.tolist(), spans, strict=True):
        if high - low >= SHORTEST_WALL:
            yield k, lines[k].point(low), -lines[k].direction
            yield k, lines[k].point(high), lines[k].direction


def _opposite(start: Array, way: Array, tree: shapely.STRtree, segments: NDArray[np.object_]) -> Array | None:
    """The nearest place (2,) of a wall from `start` on, about along the unit vector `way`; None where it is far."""
    near = tree.query(shapely.Point(start), "dwithin", WIDEST)
    ahead = shapely.LineString([start + 0.01 * way, start + WIDEST * way])
    places = [np.asarray(p.coords)[0] for p in shapely.intersection(segments[near], ahead) if p.geom_type == "Point"]
    for segment in segments[near]:
        places += [np.asarray(segment.coords)[0], np.asarray(segment.coords)[1]]
    offsets = np.array(places).reshape(-1, 2) - start
    length = np.linalg.norm(offsets, axis=1)
    ok = (length > 0.01) & (length <= WIDEST) & (offsets @ way >= ALIGNED * length)
    return start + offsets[ok][np.argmin(length[ok])] if ok.any() else None


def _is_doorway(
    start: Array, end: Array, tree: shapely.STRtree, segments: NDArray[np.object_], space: FreeSpace
) -> bool:
    width = float(np.linalg.norm(end - start))
    if width <= SLIT:
        return True
    step = (end - start) / width
    foot = start + np.arange(space.resolution, width - space.resolution / 2, space.resolution)[:, None] * step
    if space.is_free(foot).mean() < PASSED:
        return False
    normal = np.array([-step[1], step[0]])
    middle = (start + end) / 2
    return all(
        any(_extent(middle, side * depth * normal, step, tree, segments) >= width + WIDER for depth in BEFORE)
        for side in (1.0, -1.0)
    )


def _extent(middle: Array, off: Array, step: Array, tree: shapely.STRtree, segments: NDArray[np.object_]) -> float:
    """m from wall to wall along `step` through the place `off` the middle of a doorway; 0 where a wall is before it."""
    if len(tree.query(shapely.LineString([middle + 0.05 * off, middle + off]), "intersects")):
        return 0.0
    reach = 0.0
    for way in (step, -step):
        ray = shapely.LineString([middle + off, middle + off + FURTHEST * way])
        hit = segments[tree.query(ray, "intersects")]
        place = shapely.Point(middle + off)
        reach += min((float(shapely.distance(p, place)) for p in shapely.intersection(hit, ray)), default=FURTHEST)
    return reach


def _line(start: Array, end: Array) -> PlanLine:
    """A doorway that is on no wall's line as a line of its own."""
    width = float(np.linalg.norm(end - start))
    span = np.array([[0.0, width]])
    direction = (end - start) / width
    return PlanLine(start, direction, NONE, NONE, SIGMA_OFFSET, SIGMA_ANGLE, "inferred", 0, frontier=span, gates=span)
