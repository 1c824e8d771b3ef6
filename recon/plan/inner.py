"""Dimension lines inside rooms, from wall to wall, with the standard deviation of the distance."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import TYPE_CHECKING

import numpy as np

from recon.geometry import Array, cross2
from recon.model import Dimension as Distance
from recon.model import Layout
from recon.plan.drawing import Dimension, Text
from recon.plan.layers import DIMENSIONS
from recon.plan.options import DrawingOptions
from recon.plan.placement import Taken, grown
from recon.plan.quantity import length_text, length_with_sigma

if TYPE_CHECKING:
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
    for distance in chosen(layout):
        shape = shapes.get(distance.room)
        if shape is None or frozenset(distance.walls) in said or distance.distance < SHORTEST * scale / 1000:
            continue
        shapely.prepare(shape)
        a, b = (walls[k] for k in distance.walls)
        span = np.sort([(end - a.start) @ a.direction for end in (b.start, b.end)])
        low, high = np.clip(span, 0.0, a.length) - (distance.start - a.start) @ a.direction
        most = _ASKEW / max(abs(float(cross2(a.direction, b.direction))), 1e-9)
        slides = [float(np.clip(low + share * (high - low), -most, most)) * a.direction for share in PLACES]
        placed = next((d for d in _placed(distance, slides, options, scale, shape, texts, lines)), None)
        if placed is not None and placed.text is not None:
            lines.add(placed.line)
            texts.add(placed.text.box)
            yield placed


def chosen(layout: Layout) -> list[Distance]:
    """Of every room the longest dimensions along each of its directions, none twice."""
    kept: list[Distance] = []
    for distance in sorted(layout.dimensions, key=lambda d: (d.room, -d.distance)):
        way = (distance.end - distance.start) / max(distance.distance, 1e-9)
        before = [d for d in kept if d.room == distance.room]
        before = [d for d in before if abs(float(way @ (d.end - d.start))) > _SAME_WAY * d.distance]
        if len(before) < MOST and all(abs(d.distance - distance.distance) > _SAME_LENGTH for d in before):
            kept.append(distance)
    return kept


def _placed(
    distance: Distance,
    slides: list[Array],
    options: DrawingOptions,
    scale: int,
    shape: BaseGeometry,
    texts: Taken,
    lines: Taken,
) -> Iterator[Dimension]:
    """Ways to draw a dimension over nothing else, with its sigma if there is room for that."""
    import shapely

    ends, mm = np.stack([distance.start, distance.end]), scale / 1000
    ways = [ends + slide for slide in slides]
    ways = [way for way in ways if texts.free(way) and shape.covers(shapely.LineString(_shrunk(way)))]
    sigma = distance.sigma if options.sigmas and np.isfinite(distance.sigma) and distance.sigma > 0 else None
    for known in dict.fromkeys((sigma, None)):
        for way in ways:
            for place in TEXT_PLACES:
                text = figures(way, place, distance.distance, known, options, mm, unit=True)
                box = grown(text.box, CLEAR * mm)
                if texts.free(box) and lines.free(box) and shape.covers(shapely.Polygon(box)):
                    yield Dimension(DIMENSIONS, distance.start, distance.end, way, text, known)


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


def _shrunk(line: Array) -> Array:
    """A line (2, 2) without its outer 2 %."""
    step = line[1] - line[0]
    return np.stack([line[0] + 0.02 * step, line[1] - 0.02 * step])
