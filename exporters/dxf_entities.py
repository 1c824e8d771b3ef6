"""Elements of a drawing as DXF entities."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from recon.geometry import Array, rotation2
from recon.model import Opening, Wall
from recon.plan.drawing import Dimension, Drawing, Element, Fill, Polyline, Source, Text, parts
from recon.plan.fonts import Han, han
from recon.plan.inner import reading_angle
from recon.plan.layers import Layer
from recon.plan.options import DrawingOptions
from recon.plan.quantity import length_text

if TYPE_CHECKING:
    from ezdxf.layouts import BaseLayout

APPLICATION, STYLE = "RECON", "RECON"
"""STYLE: name of the text style and of the dimension style."""
HAIRLINE = 13
"""1/100 mm."""


def layer_name(layer: Layer, options: DrawingOptions, suffix: str) -> str:
    """The layer's name in the chosen convention, with that of the storey."""
    return layer.named(options.layers) + suffix


def style_for(kind: Han | None) -> str:
    """The text style of lines with such letters."""
    return STYLE if kind is None else f"{STYLE}_{kind}"


@dataclass(frozen=True)
class Pencil:
    """Draws into one space of a DXF file. unit: drawing units in a metre of the plan (or millimetre of the sheet)."""

    space: BaseLayout
    options: DrawingOptions
    drawing: Drawing
    suffix: str
    unit: float

    def draw(self, element: Element, elevation: float = 0.0) -> None:
        """One element, at an elevation in m; the profile `plain` has polylines and texts only."""
        plain = self.options.dxf_profile == "plain"
        if isinstance(element, Dimension) and plain:
            drawn = [self._entity(part, plain) for part in parts(element, self.drawing.scale)]
        elif isinstance(element, Dimension):
            drawn = [self._dimension(element)]
        elif isinstance(element, Fill):
            drawn = [] if plain else [self._hatch(element)]
        else:
            drawn = [self._entity(element, plain)]
        for entity in drawn:
            if elevation and not plain:
                entity.translate(0.0, 0.0, elevation * self.unit)

    def _entity(self, element: Polyline | Text, plain: bool) -> Any:
        return self._text(element) if isinstance(element, Text) else self._line(element, plain)

    def _attributes(self, layer: Layer) -> dict[str, Any]:
        return {"layer": layer_name(layer, self.options, self.suffix)}

    def _line(self, line: Polyline, plain: bool) -> Any:
        attributes = self._attributes(line.layer)
        if line.thin and line.layer.pen * 100 > HAIRLINE:
            attributes["lineweight"] = HAIRLINE
        points = self._points(line.points)
        if len(points) == 2 and not plain:
            entity = self.space.add_line(*points, dxfattribs=attributes)
        else:
            entity = self.space.add_lwpolyline(points, close=line.closed, dxfattribs=attributes)
        if line.source is not None:
            entity.set_xdata(APPLICATION, extended_data(line.source))
        return entity

    def _hatch(self, fill: Fill) -> Any:
        hatch = self.space.add_hatch(color=fill.colour, dxfattribs=self._attributes(fill.layer))
        for number, ring in enumerate(fill.rings):
            hatch.paths.add_polyline_path(self._points(ring), is_closed=True, flags=16 if number else 1)
        return hatch

    def _text(self, text: Text) -> Any:
        from ezdxf.enums import TextEntityAlignment

        anchors = {"start": "LEFT", "middle": "CENTER", "end": "RIGHT"}
        attributes = self._attributes(text.layer) | {"style": style_for(han(text.text))}
        attributes |= {"height": text.height * self.unit, "rotation": float(np.degrees(text.angle))}
        entity = self.space.add_text(escaped(text.text), dxfattribs=attributes)
        return entity.set_placement(self._points(text.at[None])[0], align=TextEntityAlignment[anchors[text.anchor]])

    def _dimension(self, dimension: Dimension) -> Any:
        """A linear dimension; the program measures it itself and adds what is known of its accuracy."""
        start, end, base = self._points(np.stack([dimension.start, dimension.end, dimension.line[0]]))
        angle = reading_angle(dimension.line[1] - dimension.line[0])
        override = {} if dimension.extensions else {"dimse1": 1, "dimse2": 1}
        drawn = self.space.add_linear_dim(
            base=base,
            p1=start,
            p2=end,
            angle=float(np.degrees(angle)),
            text=self._figures(dimension),
            dimstyle=STYLE,
            override=override,
            dxfattribs=self._attributes(dimension.layer),
        )
        if dimension.text is not None:
            middle = dimension.text.at + rotation2(angle) @ np.array([0.0, dimension.text.height / 2])
            drawn.set_location(self._points(middle[None])[0])
        drawn.render()
        for part in drawn.dimension.get_geometry_block() or ():
            if part.dxf.layer == "0":
                part.dxf.layer = drawn.dimension.dxf.layer
        if drawn.dimension.dxf.get("text_midpoint") is None:
            drawn.dimension.dxf.discard("text_midpoint")  # left empty where there is no text; moves choke on it
        if dimension.sigma is not None:
            drawn.dimension.set_xdata(APPLICATION, [(1000, "sigma"), (1040, float(dimension.sigma))])
        return drawn.dimension

    def _figures(self, dimension: Dimension) -> str:
        """The text with `<>` for the length, where the program can write that as we do."""
        if dimension.text is None:
            return " "
        text, length = dimension.text.text, length_text(dimension.distance, self.options.units)
        return text if self.options.units == "ft" else text.replace(length, "<>", 1)

    def _points(self, points: Array) -> list[tuple[float, float]]:
        return [(float(x), float(y)) for x, y in points * self.unit]


def extended_data(source: Source) -> list[tuple[int, Any]]:
    """What the layout knows of a thing: its name, then numbers (m, rad) and words."""
    from recon.exporters.svg import source_name

    data: list[tuple[int, Any]] = [(1000, source_name(source))]
    if isinstance(source, Wall):
        data += [(1040, float(s)) for s in (source.sigma_offset, source.sigma_angle) if np.isfinite(s)]
        data.append((1000, source.source))
    elif isinstance(source, Opening):
        data += [(1040, float(source.bottom)), (1040, float(source.top))]
    return data


def escaped(text: str) -> str:
    """Text without what DXF takes for control codes: %%u, ^I, \\U+00e4."""
    return text.replace("^", "^ ").replace("%%", "%%%%%%").replace("\\U+", "\\ U+").replace("\\M+", "\\ M+")
