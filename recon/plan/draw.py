"""A model as a drawing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from recon.geometry import Array, rotation2
from recon.model import Layout, Model
from recon.plan.chains import draw_chains, find_chains
from recon.plan.drawing import Dimension, Drawing, Element
from recon.plan.inner import draw_distances
from recon.plan.layers import LAYERS
from recon.plan.openings import draw_openings
from recon.plan.options import DEFAULT, DrawingOptions
from recon.plan.placement import Taken
from recon.plan.quantity import area_text, length_text
from recon.plan.rooms import draw_labels, draw_rooms
from recon.plan.sheet import choose_sheet
from recon.plan.solids import Solids, draw_walls
from recon.plan.title import LEGEND, Facts, draw_sheet
from recon.plan.walls import DRAWN_THICKNESS, dominant_angle, unseen_pieces


def draw_plan(model: Model, options: DrawingOptions = DEFAULT, angle: float | None = None) -> Drawing:
    """The floor plan of a model, parallel to its main direction or to `angle`, rad in the map.

    Raises ConfigError where it does not fit the paper.
    """
    angle = dominant_angle(model.layout) if angle is None else angle
    layout = turned(model.layout, -angle)
    solids, chains = Solids.of(layout), find_chains(layout)
    low, high = _extent(layout, solids)
    left, bottom, right, top = (chains[k].depth for k in (1, 0, 3, 2))
    sheet = choose_sheet(high - low, np.array([left + right, bottom + top]), options)
    scale = sheet.scale
    plan: list[Element] = [*draw_rooms(layout), *draw_walls(layout, solids), *draw_openings(layout)]
    texts, lines = Taken(), Taken()
    plan += draw_labels(layout, options, scale, texts)
    outside: list[Dimension] = []
    for side in chains:
        edge = float(min((side.turn @ low)[1], (side.turn @ high)[1]))
        outside += draw_chains(side, layout, edge, options, scale, texts, lines)
    said = {dimension.walls for dimension in outside if dimension.text is not None}
    plan += [*outside, *draw_distances(layout, options, scale, texts, lines, said)]
    plan.sort(key=lambda element: LAYERS.index(element.layer))
    free = np.ptp(sheet.space, axis=0) - (high - low) * 1000 / scale - [left + right, bottom + top]
    offset = sheet.space[0] + [left, bottom] + free / 2 - low * 1000 / scale
    facts = Facts(
        model.name, _summary(layout, options), _notes(model, layout, options, angle), _legend(layout, solids), angle
    )
    window = (sheet.space - offset) * scale / 1000
    frame = tuple(draw_sheet(sheet, facts, options))
    return Drawing(model.name, tuple(plan), frame, scale, sheet.paper, sheet.size, angle, offset, window)


def turned(layout: Layout, angle: float) -> Layout:
    """The layout turned about the origin by `angle`, rad."""
    turn = rotation2(angle).T
    return replace(
        layout,
        walls=tuple(replace(w, start=w.start @ turn, end=w.end @ turn) for w in layout.walls),
        rooms=tuple(replace(r, polygon=r.polygon @ turn) for r in layout.rooms),
        openings=tuple(replace(o, start=o.start @ turn, end=o.end @ turn) for o in layout.openings),
        objects=tuple(
            replace(o, footprint=o.footprint @ turn, legs=tuple(leg @ turn for leg in o.legs)) for o in layout.objects
        ),
        dimensions=tuple(replace(d, start=d.start @ turn, end=d.end @ turn) for d in layout.dimensions),
        spans=tuple(replace(d, start=d.start @ turn, end=d.end @ turn) for d in layout.spans),
    )


def _extent(layout: Layout, solids: Solids) -> Array:
    """Low and high corner (2, 2) of all that stands, m; a square metre around the origin where nothing does."""
    points = [room.polygon for room in layout.rooms]
    points += [np.stack([w.start, w.end]) for w in layout.walls] + [item.footprint for item in layout.objects]
    if not solids.whole.is_empty:
        points.append(np.array(solids.whole.bounds).reshape(2, 2))
    every = np.concatenate(points) if points else np.array([[-0.5, -0.5], [0.5, 0.5]])
    return np.stack([every.min(axis=0), every.max(axis=0)])


def _summary(layout: Layout, options: DrawingOptions) -> str:
    count, height = len(layout.rooms), layout.ceiling_height
    facts = [f"{count} room{'s' * (count != 1)}", area_text(sum(room.area for room in layout.rooms), options.units)]
    if height is not None:
        facts.append(f"ceiling {length_text(height, options.units, True)}")
    return " · ".join(facts)


def _notes(model: Model, layout: Layout, options: DrawingOptions, angle: float) -> tuple[str, ...]:
    """What a reader must know, the plan's own notes first."""
    unit = {"m": "metres", "mm": "millimetres", "ft": "feet and inches"}[options.units]
    notes = [f"Dimensions are clear distances between faces of walls, in {unit}."]
    if options.sigmas:
        notes.append("±: one standard deviation.")
    if any(wall.thickness is None for wall in layout.walls):
        thickness = length_text(DRAWN_THICKNESS, options.units, True)
        notes.append(f"Walls seen from one side only are drawn {thickness} thick.")
    if any(wall.source == "inferred" for wall in layout.walls):
        notes.append("(Dimensions in brackets) reach to a wall that no sensor saw.")
    turn = f"The plan is turned by {np.degrees(-angle):.3f}° against the map; arrow: "
    notes.append(turn + ("north." if options.north is not None else "its y axis, north is not known."))
    return (*notes, *model.notes)


def _legend(layout: Layout, solids: Solids) -> tuple[str, ...]:
    kinds = {opening.type for opening in layout.openings}
    there = {
        "measured": not solids.measured.is_empty,
        "assumed": not solids.assumed.is_empty,
        "inferred": any(len(unseen_pieces(wall)) for wall in layout.walls),
        "door": "door" in kinds,
        "passage": "passage" in kinds,
        "window": "window" in kinds,
        "furniture": bool(layout.objects),
    }
    return tuple(kind for kind in LEGEND if there[kind])
