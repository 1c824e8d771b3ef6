"""Outlines of rooms, and their names and areas where there is room for them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from recon.geometry import Array, rotation2
from recon.model import Layout, Room
from recon.plan.drawing import Polyline, Text
from recon.plan.layers import AREA, AREA_NAME, FURNITURE
from recon.plan.lettering import LINE, clean, shortened, text_width, wrapped
from recon.plan.options import DrawingOptions
from recon.plan.placement import Taken, grown
from recon.plan.quantity import area_text, length_text, length_with_sigma
from recon.plan.walls import label_spot

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

NAME, DETAIL = 2.5, 1.8
"""mm; heights of a room's name and of what is said below it."""
SIZES = (1.0, 0.85, 0.7, 0.55)
"""Of these heights, tried in turn."""
CLEAR = 0.8
"""mm around a label, free of everything."""
WIDEST = 42.0
"""mm; longer names are broken."""
MOST_LINES = 3
"""Of a name."""
_TRIED = 60  # places for a label


def draw_rooms(layout: Layout) -> Iterator[Polyline]:
    """Closed outlines of rooms, and of what stands in them."""
    for room in layout.rooms:
        yield Polyline(AREA, room.polygon, True, room)
    for item in layout.objects:
        yield Polyline(FURNITURE, item.footprint, True, item)
        for leg in item.legs:
            yield Polyline(FURNITURE, leg, True, item, thin=True)


def draw_labels(layout: Layout, options: DrawingOptions, scale: int, texts: Taken) -> Iterator[Text]:
    """Name, area and height of every room, inside it; what is drawn is added to `texts`."""
    import shapely

    furniture = Taken()
    for item in layout.objects:
        furniture.add(np.array(shapely.Polygon(item.footprint).minimum_rotated_rectangle.exterior.coords)[:4])
    for room in layout.rooms:
        for text in _label(room, layout, options, scale, texts, furniture):
            texts.add(grown(text.box, CLEAR * scale / 1000))
            yield text


Lines = Sequence[tuple[str, float, bool]]  # text, height in mm, bold


def _label(
    room: Room, layout: Layout, options: DrawingOptions, scale: int, texts: Taken, furniture: Taken
) -> list[Text]:
    import shapely

    mm, extent = scale / 1000, np.ptp(room.polygon, axis=0)
    shape, spots = shapely.Polygon(), list[Array]()
    for size in SIZES:
        for lines in _contents(room, layout, options, size):
            for angle in (0.0, np.pi / 2):
                wide = _size(lines) * mm
                if np.any((wide if angle == 0.0 else wide[::-1]) > extent):
                    continue
                if not spots:
                    shape = shapely.make_valid(shapely.Polygon(room.polygon)).buffer(-CLEAR * mm)
                    shapely.prepare(shape)
                    spots = _spots(room, shape)
                box, label = _set(lines, angle, mm)
                fits = shapely.covers(shape, shapely.polygons(box + np.array(spots)[:, None]))
                inside = [s for s, fit in zip(spots, fits, strict=True) if fit and texts.free(box + s)]
                spot = next((s for s in inside if furniture.free(box + s)), inside[0] if inside else None)
                if spot is not None:
                    return [replace(text, at=text.at + spot) for text in label]
    return _cramped(room, mm, texts)


def _contents(room: Room, layout: Layout, options: DrawingOptions, size: float) -> Iterator[Lines]:
    """What a label says, from much to little."""
    name = wrapped(clean(room.name), NAME, WIDEST, bold=True)
    if len(name) > MOST_LINES:
        name = [*name[: MOST_LINES - 1], shortened(" ".join(name[MOST_LINES - 1 :]), NAME, WIDEST, bold=True)]
    shown = [(line, NAME * size, True) for line in name]
    area = [(area_text(room.area, options.units), DETAIL * size, False)]
    height, sigma = room.ceiling_height, room.sigma_ceiling
    if height is None:
        height, sigma = layout.ceiling_height, layout.sigma_ceiling
    if height is not None:
        known = options.sigmas and sigma is not None and np.isfinite(sigma) and sigma > 0
        text = length_with_sigma(height, float(sigma or 0), options.units, True) if known else ""
        yield [*shown, *area, (f"h {text or length_text(height, options.units, True)}", DETAIL * size, False)]
    yield [*shown, *area]
    if size == SIZES[-1]:
        yield shown


def _cramped(room: Room, mm: float, texts: Taken) -> list[Text]:
    """As much of the name as the room is wide; nothing where that is nothing."""
    spot, radius = label_spot(room.polygon)
    height = NAME * SIZES[-1]
    name = shortened(clean(room.name), height, max(2 * radius / mm - 1, 0.0), bold=True)
    box, label = _set([(name, height, True)], 0.0, mm)
    return [replace(text, at=text.at + spot) for text in label] if name and texts.free(box + spot) else []


def _size(lines: Lines) -> Array:
    """Width and height (2,) of lines one below the other, mm, with half of the margin around them."""
    width = max(text_width(text, height, bold) for text, height, bold in lines)
    heights = [height for _, height, _ in lines]
    return np.array([width, heights[0] + LINE * sum(heights[1:])]) + CLEAR


def _set(lines: Lines, angle: float, mm: float) -> tuple[Array, list[Text]]:
    """Lines one below the other, centred on the origin; the box (4, 2) around them, and the texts."""
    turn, size = rotation2(angle), _size(lines)
    total = float(size[1] - CLEAR)
    down, texts = total / 2 - lines[0][1], []
    for i, (text, height, bold) in enumerate(lines):
        down -= LINE * height if i else 0.0
        at = turn @ np.array([0.0, down * mm])
        texts.append(Text(AREA_NAME, text, at, height * mm, angle, "middle", bold))
    corners = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]) * size / 2 * mm
    return corners @ turn.T, texts


def _spots(room: Room, shape: BaseGeometry) -> list[Array]:
    """Places to try (2,), the best known first, then those near it."""
    import shapely

    best, _ = label_spot(room.polygon)
    low, high = room.polygon.min(axis=0), room.polygon.max(axis=0)
    axes = [np.linspace(a, b, 15)[1:-1] for a, b in zip(low, high, strict=True)]
    grid = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
    grid = grid[shapely.contains_xy(shape, grid)]
    order = np.argsort(np.linalg.norm(grid - best, axis=1), kind="stable")
    return [best, *grid[order[:: max(1, len(order) // _TRIED)]]]
