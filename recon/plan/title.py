"""The title block: name, legend, notes, scale bar and the direction of the map. Millimetres on the sheet."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from recon.geometry import Array, rotation2
from recon.plan.drawing import Element, Fill, Polyline, Text
from recon.plan.layers import DOOR, FILL, FURNITURE, GLAZING, GREY, INK, TEXT, TITLE, Layer
from recon.plan.lettering import LINE, clean, shortened, text_width, wrapped
from recon.plan.options import DrawingOptions
from recon.plan.quantity import FOOT
from recon.plan.sheet import FRAME, WIDE, Sheet, scale_text
from recon.plan.solids import ASSUMED, MEASURED

PAD = 4.0
SMALL, NORMAL, LARGE = 1.8, 2.2, 4.0
SOFT = Layer(TITLE.aia, TITLE.iso, 8, GREY, 0.13)
"""Grey lines of the title block."""
MAIN, FACTS = 66.0, 62.0
"""mm; widths of the cells of the name and of the scale."""
SWATCH = 9.0


@dataclass(frozen=True)
class Facts:
    """What the title block says. legend: kinds of symbols that the plan has, of LEGEND's keys."""

    title: str
    summary: str
    notes: tuple[str, ...]
    legend: tuple[str, ...]
    angle: float


LEGEND = {
    "measured": "wall, both faces measured",
    "assumed": "wall, one face measured",
    "inferred": "inferred wall, not seen",
    "door": "door, swing not measured",
    "passage": "passage",
    "window": "window",
    "furniture": "object",
}


def draw_sheet(sheet: Sheet, facts: Facts, options: DrawingOptions) -> Iterator[Element]:
    """Frame and title block."""
    width, height = sheet.size
    left, right, low = FRAME, width - FRAME, FRAME
    yield Polyline(TITLE, _box(left, low, right, height - FRAME), True)
    top = low + sheet.strip
    yield Polyline(SOFT, np.array([[left, top], [right, top]]))
    main = min(MAIN if width < 400 else 100.0, (right - left) / 2)
    if width >= WIDE:
        edges = [left, left + main, left + main + 0.42 * (right - left - main - FACTS), right - FACTS, right]
        for x in edges[1:-1]:
            yield Polyline(SOFT, np.array([[x, low], [x, top]]))
        cells = [(a, low, b, top) for a, b in pairwise(edges)]
    else:
        middle, a, b = low + sheet.strip - 26.0, right - FACTS, left + 0.5 * (right - left)
        yield Polyline(SOFT, np.array([[left, middle], [right, middle]]))
        yield Polyline(SOFT, np.array([[a, middle], [a, top]]))
        yield Polyline(SOFT, np.array([[b, low], [b, middle]]))
        cells = [(left, middle, a, top), (left, low, b, middle), (b, low, right, middle), (a, middle, right, top)]
    yield from _name(cells[0], facts, sheet)
    yield from _legend(cells[1], facts)
    yield from _notes(cells[2], facts.notes)
    yield from _scale(cells[3], sheet, facts, options)


Cell = tuple[float, float, float, float]  # left, low, right, top, mm


def _name(cell: Cell, facts: Facts, sheet: Sheet) -> Iterator[Element]:
    """The building's name, in up to two lines, and what the plan shows."""
    left, _, right, top = cell
    wide, title = right - left - 2 * PAD, clean(facts.title)
    height = next((h for h in (LARGE, 3.2, 2.6) if text_width(title, h, True) <= wide), 2.6)
    lines = wrapped(title, height, wide, True)[:2]
    y = top - PAD - height
    for line in lines:
        yield Text(TITLE, shortened(line, height, wide, True), np.array([left + PAD, y]), height, bold=True)
        y -= LINE * height
    for text in ("Floor plan", facts.summary, f"{scale_text(sheet.scale)} on {sheet.paper}"):
        for line in wrapped(text, NORMAL, wide)[:1]:
            yield Text(TEXT, line, np.array([left + PAD, y]), NORMAL)
        y -= LINE * NORMAL


def _legend(cell: Cell, facts: Facts) -> Iterator[Element]:
    """A swatch and its meaning a line, in two columns where one is too short."""
    left, low, right, top = cell
    step = LINE * SMALL * 1.3
    rows = max(1, int((top - low - 2 * PAD) / step) + 1)
    columns = 1 if len(facts.legend) <= rows else 2
    width = (right - left - PAD) / columns
    for k, kind in enumerate(facts.legend[: rows * columns]):
        x, y = left + PAD + (k // rows) * width, top - PAD - SMALL - (k % rows) * step
        yield from _swatch(kind, x, y - 0.3)
        text = shortened(LEGEND[kind], SMALL, width - SWATCH - 2 - PAD)
        yield Text(TEXT, text, np.array([x + SWATCH + 2, y]), SMALL)


def _swatch(kind: str, x: float, y: float) -> Iterator[Element]:
    """The symbol as the plan draws it; dashes are drawn one by one, so that they are the same on every sheet."""
    low, high = np.array([[x, y], [x + SWATCH, y]]), np.array([[x, y + 2.2], [x + SWATCH, y + 2.2]])
    ring = np.concatenate([low, high[::-1]])
    if kind in ("measured", "assumed"):
        yield Fill(FILL, (ring,), *(MEASURED if kind == "measured" else ASSUMED))
        for line in (low, high) if kind == "measured" else (high,):
            yield Polyline(TITLE, line)
    elif kind in ("inferred", "passage"):
        layer = TITLE if kind == "inferred" else SOFT
        for line in (low, high) if kind == "passage" else (high - [0.0, 1.1],):
            yield from (Polyline(layer, dash) for dash in dashes(line))
    elif kind == "furniture":
        yield Polyline(Layer(TITLE.aia, TITLE.iso, 8, FURNITURE.rgb, FURNITURE.pen), ring, True)
    else:
        half, like = (0.45, DOOR) if kind == "door" else (0.3, GLAZING)
        pane = np.array([[x, y + 1.1 - half], [x + SWATCH, y + 1.1 - half]])
        pane = np.concatenate([pane, pane[::-1] + np.array([0.0, 2 * half])])
        yield from (Polyline(SOFT, line) for line in (low, high))
        if kind == "door":
            yield Fill(TITLE, (pane,), DOOR.rgb, DOOR.colour)
        yield Polyline(Layer(TITLE.aia, TITLE.iso, like.colour, like.rgb, like.pen), pane, True)


def dashes(line: Array, dash: float = 1.6, gap: float = 1.0) -> Iterator[Array]:
    """A line (2, 2) in strokes, mm."""
    length = float(np.linalg.norm(line[1] - line[0]))
    for start in np.arange(0.0, length, dash + gap):
        yield line[0] + np.array([[start], [min(start + dash, length)]]) / length * (line[1] - line[0])


def _notes(cell: Cell, notes: Sequence[str]) -> Iterator[Element]:
    """As many lines as there is room for."""
    left, low, right, top = cell
    y = top - PAD - SMALL
    for note in notes:
        for number, line in enumerate(wrapped(clean(note), SMALL, right - left - 2 * PAD - 2)):
            if y < low + PAD / 2:
                return
            if number == 0:
                yield Text(TEXT, "·", np.array([left + PAD, y]), SMALL, bold=True)
            yield Text(TEXT, line, np.array([left + PAD + 2, y]), SMALL)
            y -= LINE * SMALL
        y -= 0.25 * SMALL


def _scale(cell: Cell, sheet: Sheet, facts: Facts, options: DrawingOptions) -> Iterator[Element]:
    left, low, right, top = cell
    foot = options.units == "ft"
    x, y, unit = left + PAD, top - PAD - 9.0, FOOT if foot else 1.0
    parts = (0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000)
    part = max((p for p in parts if p * unit * 4000 / sheet.scale <= 40), default=parts[0])
    length = part * unit * 1000 / sheet.scale
    for i in range(4):
        ring = _box(x + i * length, y, x + (i + 1) * length, y + 1.4)
        if i % 2 == 0:
            yield Fill(TITLE, (ring,), INK, 7)
        yield Polyline(TITLE, ring, True, thin=True)
    for i in (0, 2, 4):
        label = f"{part * i:g}{(' ft' if foot else ' m') if i == 4 else ''}"
        yield Text(TEXT, label, np.array([x + i * length, y + 2.4]), SMALL, anchor="start" if i == 0 else "middle")
    yield Text(TITLE, scale_text(sheet.scale), np.array([x, y - 7.5]), 3.2, bold=True)
    yield from _arrow(np.array([right - PAD - 5.0, (top + max(low, top - 26.0)) / 2 - 0.5]), facts, options)


def _arrow(centre: Array, facts: Facts, options: DrawingOptions) -> Iterator[Element]:
    """To the north where it is known, else along the map's y axis, named so."""
    known = options.north is not None
    angle = (np.radians(options.north or 0.0) if known else np.pi / 2) - facts.angle
    turn = rotation2(angle - np.pi / 2)
    circle = 5.0 * np.stack([np.cos(t := np.linspace(0, 2 * np.pi, 49)[:-1]), np.sin(t)], axis=1)
    yield Polyline(SOFT, centre + circle, True)
    left, right = (np.array([[0.0, 5.0], [side * 2.6, -4.2], [0.0, -2.4]]) @ turn.T + centre for side in (-1, 1))
    yield Fill(TITLE, (left,), INK, 7)
    yield Polyline(TITLE, left, True, thin=True)
    yield Polyline(TITLE, right, True, thin=True)
    way = turn @ np.array([0.0, 1.0])
    at = centre + 7.4 * way - [0.0, SMALL / 2]
    yield Text(TITLE, "N" if known else "y", at, SMALL, anchor="middle", bold=True)


def _box(left: float, low: float, right: float, high: float) -> Array:
    return np.array([[left, low], [right, low], [right, high], [left, high]])
