"""SVG: the plan to scale on paper, with the font in it.

The group `plan` is in metres of the map frame; its transform turns the walls parallel to the page and scales to
millimetres on paper. Everything else is in millimetres.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import groupby
from xml.etree import ElementTree as ET

import numpy as np

from recon.exporters.options import DEFAULTS, ExportOptions
from recon.exporters.output import Output
from recon.exporters.svg_fonts import FAMILY, family, font_rules
from recon.geometry import Array, rotation2
from recon.model import FloorObject, Model, Opening, Room, Wall
from recon.plan.draw import draw_plan
from recon.plan.drawing import Anchor, Dimension, Drawing, Element, Fill, Polyline, Source, Text, parts
from recon.plan.layers import INFERRED, Layer
from recon.plan.lettering import CAP_HEIGHT, CONDENSED, clean
from recon.plan.options import LayerNames
from recon.plan.shaping import from_right, is_plain

DASHES = "1.6 1"
"""mm."""
OPPOSITE: dict[Anchor, Anchor] = {"start": "end", "middle": "middle", "end": "start"}
"""A line of text that runs from right to left starts on the right."""


def write_svg(model: Model, stem: str, options: ExportOptions = DEFAULTS) -> Output:
    """A page whose size is in millimetres."""
    drawing = draw_plan(model, options.drawing)
    names = options.drawing.layers
    width, height = (_number(side) for side in drawing.paper)
    root = ET.Element("svg", {"xmlns": "http://www.w3.org/2000/svg", "version": "1.1"})
    root.attrib |= {"width": f"{width}mm", "height": f"{height}mm", "viewBox": f"0 0 {width} {height}"}
    ET.SubElement(root, "title").text = clean(drawing.title)
    ET.SubElement(root, "desc").text = f"Floor plan, scale 1:{drawing.scale}, coordinates of #plan in metres"
    ET.SubElement(root, "style").text = font_rules(drawing)
    ET.SubElement(root, "rect", {"width": width, "height": height, "fill": "#ffffff"})
    _draw_plan(root, drawing, names)
    texts = ET.SubElement(root, "g", {"id": "texts", "font-family": FAMILY})
    sheet = ET.SubElement(root, "g", {"id": "sheet", "font-family": FAMILY, "fill": "none"})
    for element in drawing.plan:
        for part in drawing.plain(element):
            if isinstance(part, Text):
                _write(texts, part, drawing)
    for item in drawing.sheet:
        _draw_on_sheet(sheet, item, drawing)
    ET.indent(root)
    return Output(ET.tostring(root, encoding="utf-8", xml_declaration=True) + b"\n", notes=drawing.missing_letters())


def _draw_plan(root: ET.Element, drawing: Drawing, names: LayerNames) -> None:
    """Lines and fills by layer, in metres of the map."""
    scale = 1000 / drawing.scale
    turn = np.diag([1.0, -1.0]) @ rotation2(-drawing.angle) * scale
    moved = [drawing.offset[0], drawing.paper[1] - drawing.offset[1]]
    matrix = ",".join(_number(v, 8) for v in [*turn.T.ravel(), *moved])
    plan = ET.SubElement(root, "g", {"id": "plan", "transform": f"matrix({matrix})", "fill": "none"})
    ids: set[str] = set()
    for layer, elements in groupby(drawing.plan, key=lambda element: element.layer):
        group = ET.SubElement(plan, "g", {"id": layer.named(names)} | _pen(layer, layer.pen, 1 / scale))
        lines = [line for element in elements for line in _lines(element, drawing.scale)]
        for key, run in groupby(lines, key=lambda line: isinstance(line, Polyline) and (id(line.source), line.thin)):
            if not key:
                for fill in run:
                    if isinstance(fill, Fill):
                        rings = " ".join(_path(drawing.to_map(ring), True) for ring in fill.rings)
                        colour = {"fill": _colour(fill.rgb), "fill-rule": "evenodd", "stroke": "none"}
                        ET.SubElement(group, "path", {"d": rings} | colour)
            else:
                _draw_lines(group, [line for line in run if isinstance(line, Polyline)], drawing, ids)


def _lines(element: Element, scale: int) -> list[Polyline | Fill]:
    """What of an element is no text."""
    pieces = parts(element, scale) if isinstance(element, Dimension) else [element]
    return [piece for piece in pieces if not isinstance(piece, Text)]


def _draw_lines(parent: ET.Element, lines: list[Polyline], drawing: Drawing, ids: set[str]) -> None:
    """Lines of one thing as one path, with its name and what is known of it."""
    first = lines[0]
    path = ET.SubElement(parent, "path", {"d": " ".join(_path(drawing.to_map(p.points), p.closed) for p in lines)})
    if first.thin:
        path.set("stroke-width", _number(first.pen * drawing.scale / 1000))
    if first.source is not None:
        name = source_name(first.source)
        if isinstance(first.source, Wall) and first.layer is INFERRED and first.source.source != "inferred":
            name += "_unseen"
        if name not in ids:
            path.set("id", name)
            ids.add(name)
        ET.SubElement(path, "title").text = _told(first.source)


def source_name(source: Source) -> str:
    """`wall_003`, `door_000`: the name of a thing in every format."""
    kind = source.type if isinstance(source, Opening) else KINDS[type(source)]
    return f"{kind}_{source.id:03d}"


KINDS: dict[type, str] = {Wall: "wall", Room: "room", FloorObject: "object"}


def _told(source: Source) -> str:
    if isinstance(source, Wall):
        sigma = f", ±{source.sigma_offset * 1000:.0f} mm" if np.isfinite(source.sigma_offset) else ""
        return f"{source_name(source)}: {source.length:.3f} m{sigma}, {source.source}"
    if isinstance(source, Opening):
        width = float(np.linalg.norm(source.end - source.start))
        return f"{source.type}: {width:.3f} m wide, {source.bottom:.2f} to {source.top:.2f} m high"
    if isinstance(source, Room):
        return clean(f"{source.name}: {source.area:.2f} m²")
    return source_name(source)


def _draw_on_sheet(parent: ET.Element, element: Element, drawing: Drawing) -> None:
    """Title block: y is up in the drawing and down in SVG."""
    flip = np.array([1.0, -1.0]), np.array([0.0, drawing.paper[1]])
    if isinstance(element, Text):
        _write(parent, element, drawing)
    elif isinstance(element, Fill):
        rings = " ".join(_path(ring * flip[0] + flip[1], True) for ring in element.rings)
        ET.SubElement(parent, "path", {"d": rings, "fill": _colour(element.rgb), "fill-rule": "evenodd"})
    elif isinstance(element, Polyline):
        data = _path(element.points * flip[0] + flip[1], element.closed)
        ET.SubElement(parent, "path", {"d": data} | _pen(element.layer, element.pen, 1.0))


def _write(parent: ET.Element, text: Text, drawing: Drawing) -> None:
    x, y = text.at * [1.0, -1.0] + [0.0, drawing.paper[1]]
    turned = f" rotate({_number(-np.degrees(text.angle), 3)})" if text.angle else ""
    place = {"transform": f"translate({_number(x)} {_number(y)}){turned} scale({CONDENSED} 1)"}
    look = {"font-size": _number(text.height / CAP_HEIGHT), "fill": _colour(text.layer.rgb)}
    anchor = text.anchor
    if from_right(text.text):
        look["direction"], anchor = "rtl", OPPOSITE[anchor]
    look |= {"text-anchor": anchor} if anchor != "start" else {}
    look |= {"font-weight": "bold"} if text.bold else {}
    if not is_plain(text.text, text.bold):
        look["font-family"] = family(text)
    ET.SubElement(parent, "text", place | look).text = text.text


def _pen(layer: Layer, pen: float, unit: float) -> dict[str, str]:
    """Stroke of a layer; unit: of the coordinates, in mm on paper."""
    if not layer.plotted:
        return {"stroke": "none", "pointer-events": "all"}
    stroke = {"stroke": _colour(layer.rgb), "stroke-width": _number(pen * unit), "stroke-linejoin": "round"}
    if layer.dashed:
        return stroke | {"stroke-dasharray": " ".join(_number(float(d) * unit) for d in DASHES.split())}
    return stroke | {"stroke-linecap": "square"}


def _colour(rgb: tuple[int, int, int]) -> str:
    return "#{:02x}{:02x}{:02x}".format(*rgb)


def _number(value: float, decimals: int = 5) -> str:
    return f"{round(float(value), decimals) + 0.0:.{decimals}f}".rstrip("0").rstrip(".")


def _numbers(values: Iterable[float]) -> str:
    return " ".join(_number(v) for v in values)


def _path(points: Array, closed: bool) -> str:
    return "M" + " L".join(_numbers(p) for p in points) + (" Z" if closed else "")
