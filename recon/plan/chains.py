"""Dimension chains outside of the building: its openings, its rooms and walls, and its whole length.

Chains run along the axes of the drawing frame. Each side of the building is turned to the bottom and looked at from
below: what is seen of walls square to the chain, and of openings in walls along it, is measured.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from recon.geometry import Array
from recon.model import Dimension as Distance
from recon.model import Layout, Wall
from recon.plan.drawing import Dimension, Text
from recon.plan.inner import CLEAR, figures
from recon.plan.layers import DIMENSIONS
from recon.plan.options import DrawingOptions
from recon.plan.placement import Taken, grown
from recon.plan.walls import opening_ends

FIRST, STEP = 9.0, 8.5
"""mm from the building to the first chain, and from chain to chain."""
BEYOND = 1.5
"""mm of an extension line on either side of the dimension line; they are short, so that texts lie clear of them."""
SQUARE = float(np.sin(np.radians(3.0)))
"""Walls may be turned this far against the chain."""
SAME = 0.0005
"""m; a distance along the chain that differs by less from that of two faces is that."""
LEAST = 0.4
"""Share of the side that chains measure, at least; else there are none."""
NEAREST = 0.03
"""m; faces nearer to one another are one stop."""
TURNS = (
    np.array([[1.0, 0.0], [0.0, 1.0]]),
    np.array([[0.0, -1.0], [1.0, 0.0]]),
    np.array([[-1.0, 0.0], [0.0, -1.0]]),
    np.array([[0.0, 1.0], [-1.0, 0.0]]),
)
"""From the drawing frame, to look at the bottom, the left, the top and the right side from below."""


@dataclass(frozen=True)
class Stop:
    """A place along a chain. point: (2,), m, what is measured. wall: whose face, None for the jamb of an opening.

    sigma: m, one standard deviation of a jamb's place, None where it is not known.
    """

    x: float
    point: Array
    wall: Wall | None
    sigma: float | None = None


@dataclass(frozen=True)
class Chains:
    """The chains of one side, from the building outwards. turn: (2, 2), from the drawing frame to the side's."""

    turn: Array
    rows: tuple[tuple[Stop, ...], ...]

    @property
    def depth(self) -> float:
        """mm that the chains take on paper."""
        return FIRST + STEP * (len(self.rows) - 1) + 5.0 if self.rows else 3.0


def find_chains(layout: Layout) -> tuple[Chains, ...]:
    """Chains of the bottom, the left, the top and the right; of the last two only what the first two do not say."""
    sides = [_side(layout, turn) for turn in TURNS]
    for k in (2, 3):
        known = sides[k - 2].rows
        rows = [row for row in sides[k].rows if not any(_mirrored(row, other) for other in known)]
        sides[k] = Chains(sides[k].turn, tuple(rows))
    return tuple(sides)


def draw_chains(
    chains: Chains, layout: Layout, low: float, options: DrawingOptions, scale: int, texts: Taken, lines: Taken
) -> Iterator[Dimension]:
    """The dimensions of one side; low: m, where the building ends on it, in the side's own frame."""
    mm = scale / 1000
    joint = {frozenset(d.walls): d for d in (*layout.dimensions, *layout.spans)}
    drawn = []
    for number, row in enumerate(chains.rows):
        y = low - (FIRST + STEP * number) * mm
        for a, b in pairwise(row):
            line = np.array([[a.x, y], [b.x, y]])
            reach = np.array([[0.0, BEYOND], [0.0, -BEYOND]]) * mm
            extensions = tuple((end + reach) @ chains.turn for end in line)
            drawn.append((a, b, line @ chains.turn, extensions))
            for taken in (drawn[-1][2], *extensions):
                lines.add(taken)
    for a, b, line, extensions in drawn:
        known = _known(a, b, joint)
        sigma = _sigma(a, b, known) if options.sigmas else None
        text = _text(a, b, line, sigma, options, mm, texts, lines)
        start, end = (stop.point @ chains.turn for stop in (a, b))
        walls = frozenset(known.walls) if known is not None else frozenset[int]()
        yield Dimension(DIMENSIONS, start, end, line, text, sigma, extensions, walls)


def _text(
    a: Stop, b: Stop, line: Array, sigma: float | None, options: DrawingOptions, mm: float, texts: Taken, lines: Taken
) -> Text | None:
    """The figures above or below the line, without sigma where that has no room; None where nothing has."""
    seen = all(stop.wall is None or stop.wall.source != "inferred" for stop in (a, b))
    for known in dict.fromkeys((sigma, None)):
        for below in (False, True):
            text = figures(line, 0.5, b.x - a.x, known, options, mm, below=below)
            if not seen:
                text = Text(text.layer, f"({text.text})", text.at, text.height, text.angle, text.anchor)
            box = grown(text.box, CLEAR * mm / 2)
            if texts.free(box) and lines.free(box):
                texts.add(text.box)
                return text
    return None


def _known(a: Stop, b: Stop, joint: dict[frozenset[int], Distance]) -> Distance | None:
    """The layout's own distance of the two faces, where it is the one along the chain."""
    if a.wall is None or b.wall is None:
        return None
    distance = joint.get(frozenset((a.wall.id, b.wall.id)))
    return distance if distance is not None and abs(distance.distance - (b.x - a.x)) < SAME else None


def _sigma(a: Stop, b: Stop, known: Distance | None) -> float | None:
    """One standard deviation of the distance, m: from the walls' joint covariance where the layout has it.

    Jambs are placed by beams of their own, independent of what places the other end. Of two faces without a joint
    covariance it is the sum of both, which it cannot exceed (Minkowski). None: not known.
    """
    one, other = _own(a), _own(b)
    if one is None or other is None:
        return None
    apart = one + other if a.wall is not None and b.wall is not None else float(np.hypot(one, other))
    sigma = known.sigma if known is not None else apart
    return sigma if np.isfinite(sigma) and sigma > 0 else None


def _own(stop: Stop) -> float | None:
    """Standard deviation of a jamb, or of a face at its ends, m; None where it is not known."""
    wall = stop.wall
    if wall is None or wall.source == "inferred":
        return stop.sigma if wall is None else None
    return float(np.hypot(wall.sigma_offset, wall.sigma_angle * wall.length / 2))


def _mirrored(row: tuple[Stop, ...], other: tuple[Stop, ...]) -> bool:
    """Whether two chains on opposite sides have the same stops."""
    if len(row) != len(other):
        return False
    return bool(np.all(np.abs(np.array([s.x for s in row]) + np.array([s.x for s in other])[::-1]) < NEAREST))


def _side(layout: Layout, turn: Array) -> Chains:
    """What is seen from below after the turn."""
    faces, jambs = _faces(layout, turn), _jambs(layout, turn)
    faces = _apart(faces)
    rows = []
    across = [float((turn @ end)[0]) for wall in layout.walls for end in (wall.start, wall.end)]
    if len(faces) < 2 or faces[-1].x - faces[0].x < LEAST * (max(across) - min(across)):
        return Chains(turn, ())
    if jambs:
        inside = [s for s in jambs if faces[0].x < s.x < faces[-1].x]
        rows.append(_apart([*faces, *inside]))
    if len(faces) > 2:
        rows.append(faces)
    rows.append([faces[0], faces[-1]])
    return Chains(turn, tuple(tuple(row) for row in rows))


def _faces(layout: Layout, turn: Array) -> list[Stop]:
    """Lower ends of walls that run up and down, where nothing lies below them."""
    found = []
    for wall in layout.walls:
        if abs(float((turn @ wall.direction)[0])) < SQUARE and wall.length > NEAREST:
            point = min((turn @ wall.start, turn @ wall.end), key=lambda p: float(p[1]))
            found.append(Stop(float(point[0]), point, wall))
    clear = np.zeros(len(found), bool)
    for beside in (-0.01, 0.01):
        clear |= _clear(layout, turn, np.array([s.point + np.array([beside, -0.01]) for s in found]).reshape(-1, 2))
    return [stop for stop, ok in zip(found, clear, strict=True) if ok]


def _jambs(layout: Layout, turn: Array) -> list[Stop]:
    """Both ends of openings in walls along the chain with the room above them and nothing below."""
    walls, found = {wall.id: wall for wall in layout.walls}, []
    for opening in layout.openings:
        wall = walls[opening.wall]
        if (turn @ wall.normal)[1] > np.sqrt(1 - SQUARE**2):
            found.append((opening_ends(opening, wall) @ turn.T, opening.sigma_jambs))
    middles = np.array([ends.mean(axis=0) for ends, _ in found]).reshape(-1, 2)
    clear = _clear(layout, turn, middles - [0.0, 0.02])
    seen = [both for both, ok in zip(found, clear, strict=True) if ok]
    return [Stop(float(p[0]), p, None, sigma) for ends, sigma in seen for p in ends]


def _clear(layout: Layout, turn: Array, points: Array) -> Array:
    """(N,) whether no room lies below points (N, 2) of the turned frame."""
    import shapely

    if len(points) == 0 or not layout.rooms:
        return np.ones(len(points), bool)
    rooms = [shapely.make_valid(shapely.Polygon(room.polygon @ turn.T)) for room in layout.rooms]
    floor = min(float(room.bounds[1]) for room in rooms) - 1.0
    rays = shapely.linestrings(np.stack([points, np.column_stack([points[:, 0], np.full(len(points), floor)])], axis=1))
    blocked = shapely.STRtree(rooms).query(rays, predicate="intersects")[0]
    clear = np.ones(len(points), bool)
    clear[blocked] = False
    return clear


def _apart(stops: list[Stop]) -> list[Stop]:
    """Sorted, without those too near to the one before; faces rather than jambs, seen ones rather than inferred."""
    out: list[Stop] = []
    for stop in sorted(stops, key=lambda s: s.x):
        if out and stop.x - out[-1].x < NEAREST:
            if _rank(stop) > _rank(out[-1]):
                out[-1] = stop
            continue
        out.append(stop)
    return out


def _rank(stop: Stop) -> int:
    return 0 if stop.wall is None else 1 if stop.wall.source == "inferred" else 2
