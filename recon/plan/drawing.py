"""The drawing: lines, fills, texts and dimensions with known places, which every writer renders alike.

Two spaces: the plan is in metres of the drawing frame (the map turned until the walls lie along the axes, same
origin), the sheet in millimetres of the paper from its lower left corner. y is up in both.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np

from recon.geometry import Array, rotation2
from recon.model import FloorObject, Opening, Room, Wall
from recon.plan.fonts import missing
from recon.plan.layers import Layer
from recon.plan.lettering import DESCENT, text_width

Anchor = Literal["start", "middle", "end"]
Source = Wall | Opening | Room | FloorObject
TICK = 0.9
"""mm; half the length of the strokes at the ends of a dimension line."""


@dataclass(frozen=True)
class Polyline:
    """points: (n, 2). source: what of the layout it shows. thin: drawn with the thinnest pen."""

    layer: Layer
    points: Array
    closed: bool = False
    source: Source | None = None
    thin: bool = False

    @property
    def pen(self) -> float:
        """Line width, mm."""
        return 0.13 if self.thin else self.layer.pen


@dataclass(frozen=True)
class Fill:
    """rings: outlines and holes (n, 2), inside by even-odd. rgb: on paper. colour: AutoCAD's number."""

    layer: Layer
    rings: tuple[Array, ...]
    rgb: tuple[int, int, int]
    colour: int


@dataclass(frozen=True)
class Text:
    """One line. at: (2,), on the base line, at its `anchor`. height: of capitals. angle: rad, of the base line."""

    layer: Layer
    text: str
    at: Array
    height: float
    angle: float = 0.0
    anchor: Anchor = "start"
    bold: bool = False

    @cached_property
    def width(self) -> float:
        """Of the line."""
        return text_width(self.text, self.height, self.bold)

    @cached_property
    def box(self) -> Array:
        """Corners (4, 2) of the rectangle that the text covers."""
        left = {"start": 0.0, "middle": -0.5, "end": -1.0}[self.anchor] * self.width
        low = -DESCENT * self.height
        local = [[left, low], [left + self.width, low], [left + self.width, self.height], [left, self.height]]
        return np.asarray(self.at + np.array(local) @ rotation2(self.angle).T)


@dataclass(frozen=True)
class Dimension:
    """The distance from `start` to `end` (2,), written at a `line` (2, 2) beside them, from foot to foot.

    text: None where there is no room for it. sigma: m, None where it is not known. extensions: lines (2, 2) across the
    ends of the dimension line, none where that runs from wall to wall. walls: ids of both,
    where this is the distance of two faces of a room.
    """

    layer: Layer
    start: Array
    end: Array
    line: Array
    text: Text | None
    sigma: float | None
    extensions: tuple[Array, ...] = ()
    walls: frozenset[int] = frozenset()

    @property
    def distance(self) -> float:
        """m, along the dimension line."""
        return float(np.linalg.norm(self.line[1] - self.line[0]))

    def ticks(self, scale: int) -> tuple[Array, ...]:
        """Oblique strokes (2, 2) over the line's ends."""
        step = (self.line[1] - self.line[0]) / max(self.distance, 1e-9)
        stroke = TICK * scale / 1000 * (step + np.array([-step[1], step[0]])) / np.sqrt(2)
        return tuple(np.stack([end - stroke, end + stroke]) for end in self.line)


Element = Polyline | Fill | Text | Dimension


@dataclass(frozen=True)
class Drawing:
    """A plan on a sheet. angle: rad, of the drawing frame's x axis in the map. paper: (width, height), mm.

    offset: (2,), mm, where the plan's origin lies on the sheet. window: (low, high) corners, m, what of the plan's
    space is on the sheet. title: of the building.
    """

    title: str
    plan: tuple[Element, ...]
    sheet: tuple[Element, ...]
    scale: int
    paper_name: str
    paper: tuple[float, float]
    angle: float
    offset: Array
    window: Array

    def on_paper(self, points: Array) -> Array:
        """Points (n, 2) of the plan, m, on the sheet, mm."""
        return np.asarray(points * (1000 / self.scale) + self.offset)

    def to_map(self, points: Array) -> Array:
        """Points (n, 2) of the plan, m, in the map frame."""
        return np.asarray(points @ rotation2(self.angle).T)

    def elements(self) -> Iterator[Polyline | Fill | Text]:
        """Everything on the sheet, from the bottom up, in mm; dimensions as their lines and texts."""
        for element in self.plan:
            yield from self.plain(element)
        for element in self.sheet:
            if not isinstance(element, Dimension):
                yield element

    def missing_letters(self) -> tuple[str, ...]:
        """A line for people where no font has some of the letters."""
        return missing({e.text: e.bold for e in self.elements() if isinstance(e, Text)})

    def plain(self, element: Element) -> Iterator[Polyline | Fill | Text]:
        """An element of the plan on the sheet, mm."""
        if isinstance(element, Polyline):
            yield replace(element, points=self.on_paper(element.points))
        elif isinstance(element, Fill):
            yield replace(element, rings=tuple(self.on_paper(ring) for ring in element.rings))
        elif isinstance(element, Text):
            yield replace(element, at=self.on_paper(element.at), height=element.height * 1000 / self.scale)
        else:
            for part in parts(element, self.scale):
                yield from self.plain(part)


def parts(dimension: Dimension, scale: int) -> Iterator[Polyline | Text]:
    """What a dimension is drawn of, m."""
    yield Polyline(dimension.layer, dimension.line)
    for extension in dimension.extensions:
        yield Polyline(dimension.layer, extension)
    for tick in dimension.ticks(scale):
        yield Polyline(dimension.layer, tick)
    if dimension.text is not None:
        yield dimension.text
