"""Dimension lines inside rooms, from wall to wall, with the standard deviation of the distance."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array, cross2
from recon.model import Dimension as Distance
from recon.model import Layout
from recon.plan.drawing import Dimension, Text
from recon.plan.layers import DIMENSIONS
from recon.plan.options import DrawingOptions
from recon.plan.placement import Taken, grown
from recon.plan.quantity import length_text, length_with_sigma

if TYPE_CHECKING:
    from shapely import STRtree
    from shapely.geometry.base import BaseGeometry

HEIGHT = 1.8
"""mm; of the figures."""
GAP = 1.0
"""mm between the line and its figures."""
BELOW = 2.0
"""mm between the line and figures below it, clear of what sticks out below."""
CLEAR = 0.5
"""mm around figures."""
PLACES = (0.3, 0.7, 0.2, 0.8, 0.4, 0.6, 0.12, 0.88, 0.5)
"""Where along the walls the line may run; not through the middle, where the room's name is."""
TEXT_PLACES = (0.5, 0.35, 0.65, 0.2, 0.8)
"""Where along the line its figures may stand."""
SHORTEST = 8.0
"""mm; shorter lines have no room for figures."""
MOST = 3
"""Dimensions a room and direction."""
_SAME_WAY = np.cos(np.radians(20.0))
_SAME_LENGTH = 0.02  # m
_STEEPEST = np.radians(95.0)
_ASKEW = 0.005  # m by which the walls' distance may change to where the line runs


def draw_distances(
    layout: Layout, options: DrawingOptions, scale: int, texts: Taken, lines: Taken, said: Collection[frozenset[int]]
) -> Iterator[Dimension]:
    """The rooms' dimensions that find a place; what is drawn is added to `texts` and `lines`.

    said: pairs of walls that are dimensioned already.
    """
    import shapely

    shapes = {r.id: shapely.make_valid(shapely.Polygon(r.polygon)).buffer(1e-4) for r in layout.rooms}
    walls = {wall.id: wall for wall in layout.walls}
    furniture = shapely.STRtree([shapely.make_valid(shapely.Polygon(item.footprint)) for item in layout.objects])
    for distance in chosen(layout):
        shape = shapes.get(distance.room)
        if shape is None or frozenset(distance.walls) in said or distance.distance < SHORTEST * scale / 1000:
            continue
        shapely.prepare(shape)
        a, b = (walls[k] for k in distance.walls)
        span = np.sort([(end - a.start) @ a.direction for end in (b.start, b.end)])
        low, high = np.clip(span, 0.0, a.length) - (distance.start - a.start) @ a.direction
        most = _ASKEW / max(abs(float(cross2(a.direction, b.direction))), 1e-9)
        slides = np.array([np.clip(low + share * (high - low), -most, most) * a.direction for share in PLACES])
        placed = _placed(distance, slides, options, scale, shape, furniture, texts, lines)
        if placed is not None and placed.text is not None:
            lines.add(placed.line)
            texts.add(placed.text.box)
            yield placed


def chosen(layout: Layout) -> list[Distance]:
    """Of every room the longest dimensions along each of its directions, none twice."""
    kept: defaultdict[int, list[Distance]] = defaultdict(list)
    for distance in sorted(layout.dimensions, key=lambda d: (d.room, -d.distance)):
        way = (distance.end - distance.start) / max(distance.distance, 1e-9)
        before = [d for d in kept[distance.room] if abs(float(way @ (d.end - d.start))) > _SAME_WAY * d.distance]
        if len(before) < MOST and all(abs(d.distance - distance.distance) > _SAME_LENGTH for d in before):
            kept[distance.room].append(distance)
    return [distance for before in kept.values() for distance in before]


def _placed(
    distance: Distance,
    slides: Array,
    options: DrawingOptions,
    scale: int,
    shape: BaseGeometry,
    furniture: STRtree,
    texts: Taken,
    lines: Taken,
) -> Dimension | None:
    """A dimension over nothing else, with its sigma if there is room for that, and clear of furniture if it can be."""
    import shapely

    mm = scale / 1000
    ways = np.stack([distance.start, distance.end]) + slides[:, None]
    ways = ways[shapely.covers(shape, shapely.linestrings(_shrunk(ways)))]
    ways = np.array([way for way in ways if texts.free(way)]).reshape(-1, 2, 2)
    if len(ways) == 0:
        return None
    over = _hits(shapely.linestrings(ways), furniture)
    sigma = distance.sigma if options.sigmas and np.isfinite(distance.sigma) and distance.sigma > 0 else None
    for known in dict.fromkeys((sigma, None)):
        text = figures(ways[0], 0.0, distance.distance, known, options, mm, unit=True)
        box = grown(text.box, CLEAR * mm)
        if np.any(np.ptp(box, axis=0) > np.ptp(np.reshape(shape.bounds, (2, 2)), axis=0)):
            continue
        steps = np.array(TEXT_PLACES)[:, None] * (ways[0, 1] - ways[0, 0])
        moves = (ways[:, None, 0] - ways[0, 0] + steps).reshape(-1, 2)
        boxes = box + moves[:, None]
        outlines = shapely.polygons(boxes)
        cost = 2 * _hits(outlines, furniture) + np.repeat(over, len(steps))
        fitting = np.flatnonzero(shapely.covers(shape, outlines))
        for k in fitting[np.argsort(cost[fitting], kind="stable")]:
            if texts.free(boxes[k]) and lines.free(boxes[k]):
                placed, line = replace(text, at=text.at + moves[k]), ways[k // len(steps)]
                return Dimension(DIMENSIONS, distance.start, distance.end, line, placed, known)
    return None


def _hits(shapes: Array, furniture: STRtree) -> NDArray[np.int64]:
    """(N,) 1 where a shape touches something that stands in the room, else 0."""
    hit = np.zeros(len(shapes), dtype=np.int64)
    hit[furniture.query(shapes, predicate="intersects")[0]] = 1
    return hit


def figures(
    line: Array,
    place: float,
    metres: float,
    sigma: float | None,
    options: DrawingOptions,
    mm: float,
    unit: bool = False,
    below: bool = False,
) -> Text:
    """A length over (or below) a dimension line (2, 2), m, to be read from below or from the right."""
    angle = reading_angle(line[1] - line[0])
    up = np.array([-np.sin(angle), np.cos(angle)])
    rise = -(BELOW + HEIGHT) if below else GAP
    at = line[0] + place * (line[1] - line[0]) + rise * mm * up
    if sigma is None:
        text = length_text(metres, options.units, unit)
    else:
        text = length_with_sigma(metres, sigma, options.units, unit)
    return Text(DIMENSIONS, text, at, HEIGHT * mm, angle, "middle")


def reading_angle(step: Array) -> float:
    """Angle, rad, of a text along a line: from the left, or from below, as long as it is about upright."""
    angle = float(np.arctan2(step[1], step[0]))
    return float((angle - _STEEPEST + np.pi) % np.pi + _STEEPEST - np.pi)


def _shrunk(lines: Array) -> Array:
    """Lines (n, 2, 2) without their outer 2 %."""
    step = 0.02 * (lines[:, 1] - lines[:, 0])
    return np.stack([lines[:, 0] + step, lines[:, 1] - step], axis=1)
