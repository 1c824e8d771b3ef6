"""SVG: a floor plan to look at, to scale on paper; walls, doors, rooms with name and area, scale bar.

The group `plan` is in metres of the map frame; its transform turns the walls parallel to the page and scales to
millimetres on paper. Hinge and swing of a door are not measured: the arc is only the usual symbol.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from xml.etree import ElementTree as ET

import numpy as np

from recon.exporters.output import Output
from recon.geometry import Array, rotation2
from recon.model import Dimension, Layout, Model, Opening, Room, Wall
from recon.plan import (
    dominant_angle,
    drawn_dimensions,
    label_spot,
    opening_ends,
    sigma_text,
    solid_pieces,
    unseen_bodies,
    unseen_pieces,
    wall_bodies,
)

SCALES = (20, 50, 100, 200, 250, 500, 1000, 2000, 5000)
PAPER = (400.0, 277.0)
"""mm: the drawing is scaled to fit this (A3 less a margin)."""
MARGIN, HEAD, FOOT = 12.0, 16.0, 20.0  # mm around the plan, for the title and for the scale bar
SHORTEST_DIMENSION = 22.0
"""mm on paper, a shorter line has no room for its text."""
INK, GREY, DOOR, GLASS = "#23272e", "#8a8f98", "#a65a2a", "#3d8fc4"
ROOM_COLOURS = ("#f3efe6", "#e9f0f4", "#eef3e8", "#f5ebea", "#efecf5", "#f6f3df")


def write_svg(model: Model, stem: str) -> Output:
    """The plan of the model's layout as an SVG page whose size is in millimetres."""
    sheet = Sheet.fitting(model.layout)
    root = ET.Element("svg", {"xmlns": "http://www.w3.org/2000/svg", "version": "1.1"})
    width, height = _numbers(sheet.size).split()
    root.attrib |= {"width": f"{width}mm", "height": f"{height}mm", "viewBox": f"0 0 {width} {height}"}
    ET.SubElement(root, "title").text = model.name
    ET.SubElement(root, "desc").text = f"Floor plan, scale 1:{sheet.scale}, coordinates of #plan in metres"
    ET.SubElement(root, "rect", {"width": width, "height": height, "fill": "#ffffff"})
    _draw_plan(root, model.layout, sheet)
    texts = {"font-family": "Helvetica, Arial, sans-serif", "fill": INK}
    sizes = ET.SubElement(root, "g", {"id": "dimensions", "text-anchor": "middle"} | texts)
    for dimension in drawn_dimensions(model.layout):
        _draw_dimension(sizes, dimension, sheet)
    labels = ET.SubElement(root, "g", {"id": "labels", "text-anchor": "middle"} | texts)
    for room in model.layout.rooms:
        _draw_label(labels, room, sheet)
    _draw_head(ET.SubElement(root, "g", {"id": "head"} | texts), model, sheet)
    _draw_scale_bar(ET.SubElement(root, "g", {"id": "scale_bar"} | texts), model, sheet)
    ET.indent(root)
    return Output(ET.tostring(root, encoding="utf-8", xml_declaration=True) + b"\n")


@dataclass(frozen=True)
class Sheet:
    """How metres of the map come onto paper: mm = turn @ m * 1000 / scale, y down, then moved.

    size: (2,) mm. matrix: (2, 3) from map metres to mm on paper.
    """

    scale: int
    size: Array
    matrix: Array

    @staticmethod
    def fitting(layout: Layout) -> Sheet:
        """The largest of SCALES at which the plan fits PAPER, either way up."""
        points = [np.zeros((1, 2)), *(np.stack([w.start, w.end]) for w in layout.walls)]
        points += [room.polygon for room in layout.rooms]
        drawn = points[1:] if len(points) > 1 else points
        turn = np.diag([1.0, -1.0]) @ rotation2(-dominant_angle(layout))
        on_page = np.concatenate(drawn) @ turn.T
        low, high = on_page.min(axis=0) - 0.2, on_page.max(axis=0) + 0.2
        room_for = np.sort(np.array(PAPER) - [2 * MARGIN, 2 * MARGIN + HEAD + FOOT])
        extent = np.sort(high - low) * 1000
        scale = next((s for s in SCALES if np.all(extent / s <= room_for)), SCALES[-1])
        size = (high - low) * 1000 / scale + [2 * MARGIN, 2 * MARGIN + HEAD + FOOT]
        size[0] = max(size[0], 100.0)
        offset = np.array([MARGIN, MARGIN + HEAD]) - low * 1000 / scale
        return Sheet(scale, size, np.column_stack([turn * 1000 / scale, offset]))

    def metres(self, millimetres: float) -> float:
        """A length on paper in m of the map."""
        return millimetres * self.scale / 1000

    def place(self, point: Array) -> Array:
        """A point (2,) of the map on paper, mm."""
        return np.asarray(self.matrix[:, :2] @ point + self.matrix[:, 2])


def _draw_plan(root: ET.Element, layout: Layout, sheet: Sheet) -> None:
    m = sheet.matrix
    plan = ET.SubElement(
        root, "g", {"id": "plan", "transform": f"matrix({_numbers(m.T.ravel(), 6).replace(' ', ',')})"}
    )
    rooms = ET.SubElement(plan, "g", {"id": "rooms"})
    for room in layout.rooms:
        colour = ROOM_COLOURS[room.id % len(ROOM_COLOURS)]
        path = ET.SubElement(
            rooms, "path", {"id": f"room_{room.id:03d}", "d": _path(room.polygon, True), "fill": colour}
        )
        ET.SubElement(path, "title").text = room.name
    thin = {"stroke-width": _number(sheet.metres(0.18)), "fill": "none"}
    objects = ET.SubElement(plan, "g", {"id": "objects", "stroke": GREY} | thin | {"fill": "#d9dbde"})
    for item in layout.objects:
        ET.SubElement(objects, "path", {"id": f"object_{item.id:03d}", "d": _path(item.footprint, True)})
    bodies = _polygons_path(wall_bodies(layout).difference(unseen_bodies(layout)))
    ET.SubElement(plan, "path", {"id": "wall_bodies", "d": bodies, "fill": INK, "fill-rule": "evenodd"})
    openings = ET.SubElement(plan, "g", {"id": "openings"} | thin)
    for opening in layout.openings:
        _draw_opening(openings, opening, layout.wall(opening.wall))
    walls = ET.SubElement(plan, "g", {"id": "walls", "stroke": INK, "stroke-linecap": "square"} | thin)
    for wall in layout.walls:
        _draw_wall(walls, wall, layout, sheet)


def _draw_wall(parent: ET.Element, wall: Wall, layout: Layout, sheet: Sheet) -> None:
    data = " ".join(_path(piece, False) for piece in solid_pieces(layout, wall))
    path = ET.SubElement(parent, "path", {"id": f"wall_{wall.id:03d}", "d": data})
    dashes = _number(sheet.metres(1.0))
    if wall.source == "inferred":
        path.set("stroke-dasharray", dashes)
    for piece in unseen_pieces(wall) if wall.source != "inferred" else ():
        dashed = {"stroke": "#ffffff", "stroke-dasharray": dashes, "stroke-linecap": "butt"}
        ET.SubElement(parent, "path", {"class": "unseen", "d": _path(piece, False)} | dashed)
    ET.SubElement(
        path, "title"
    ).text = f"wall_{wall.id:03d}: {wall.length:.2f} m, ±{wall.sigma_offset * 1000:.0f} mm, {wall.source}"


def _draw_opening(parent: ET.Element, opening: Opening, wall: Wall) -> None:
    ends = opening_ends(opening, wall)
    group = ET.SubElement(parent, "g", {"id": f"{opening.type}_{opening.id:03d}"})
    ET.SubElement(group, "title").text = f"{opening.type}, {np.linalg.norm(ends[1] - ends[0]):.2f} m wide"
    if opening.type == "window":
        for depth in (0.0, 0.06, 0.12):
            ET.SubElement(group, "path", {"d": _path(ends - depth * wall.normal, False), "stroke": GLASS})
    elif opening.type == "passage":
        ET.SubElement(group, "path", {"d": _path(ends, False), "stroke": GREY, "stroke-dasharray": "0.08"})
    else:
        middle = ends.mean(axis=0)
        wide = np.linalg.norm(ends[1] - ends[0]) > 1.3  # two leaves
        for hinge, tip in [(ends[0], middle), (ends[1], middle)] if wide else [(ends[0], ends[1])]:
            _draw_leaf(group, hinge, tip, wall)


def _draw_leaf(parent: ET.Element, hinge: Array, tip: Array, wall: Wall) -> None:
    """A leaf that stands open into the free space, and the quarter circle to where it closes."""
    radius = float(np.linalg.norm(tip - hinge))
    open_tip = hinge + radius * wall.normal
    sweep = int(np.cross(np.append(open_tip - hinge, 0), np.append(tip - hinge, 0))[2] > 0)
    ET.SubElement(parent, "path", {"d": _path(np.stack([hinge, open_tip]), False), "stroke": DOOR})
    arc = f"M{_numbers(open_tip)} A{_numbers([radius, radius])} 0 0 {sweep} {_numbers(tip)}"
    ET.SubElement(parent, "path", {"d": arc, "stroke": DOOR, "stroke-opacity": "0.5"})
    ET.SubElement(parent, "path", {"d": _path(np.stack([hinge, tip]), False), "stroke": GREY})


def _draw_label(parent: ET.Element, room: Room, sheet: Sheet) -> None:
    """Name and area in the widest part of the room, as large as fits."""
    import shapely

    spot, radius = label_spot(room.polygon)
    width = 2000 / sheet.scale * radius
    x, y = sheet.place(spot)
    size = float(np.clip(width / (0.6 * max(len(room.name), 8)), 1.2, 4.0))
    _text(parent, room.name, x, y, size, {"font-weight": "bold"})
    _text(parent, f"{shapely.Polygon(room.polygon).area:.1f} m²", x, y + 1.3 * size, 0.85 * size, {"fill": "#5a6069"})


def _draw_dimension(parent: ET.Element, dimension: Dimension, sheet: Sheet) -> None:
    """A line from wall to wall with distance and standard deviation, out of the way of the room's name."""
    ends = np.stack([sheet.place(dimension.start), sheet.place(dimension.end)])
    if ends[0, 0] > ends[1, 0] + 1e-6 or (abs(ends[0, 0] - ends[1, 0]) <= 1e-6 and ends[0, 1] < ends[1, 1]):
        ends = ends[::-1]  # read from the left, or from below
    step = ends[1] - ends[0]
    length = float(np.linalg.norm(step))
    if length < SHORTEST_DIMENSION:
        return
    ET.SubElement(parent, "path", {"d": _path(ends, False), "stroke": GREY, "stroke-width": "0.13"})
    for end in ends:
        slash = 0.8 * (step + np.array([step[1], -step[0]])) / length
        tick = np.stack([end - slash, end + slash])
        ET.SubElement(parent, "path", {"d": _path(tick, False), "stroke": GREY, "stroke-width": "0.13"})
    x, y = ends[0] + 0.25 * step + 0.7 * np.array([step[1], -step[0]]) / length
    turned = {"transform": f"rotate({_number(np.degrees(np.arctan2(step[1], step[0])), 2)} {_number(x)} {_number(y)})"}
    text = f"{dimension.distance:.3f} {sigma_text(dimension.sigma)} m"
    _text(parent, text, float(x), float(y), 1.9, {"fill": "#5a6069"} | turned)


def _draw_head(parent: ET.Element, model: Model, sheet: Sheet) -> None:
    import shapely

    rooms, height = model.layout.rooms, model.layout.ceiling_height
    facts = [f"1:{sheet.scale}", f"{len(rooms)} room{'s' * (len(rooms) != 1)}"]
    facts.append(f"{sum(shapely.Polygon(r.polygon).area for r in rooms):.1f} m²")
    facts.append("ceiling not measured" if height is None else f"ceiling {height:.2f} m")
    _text(parent, model.name, MARGIN, MARGIN + 4, 5.5, {"font-weight": "bold"})
    _text(parent, " · ".join(facts), MARGIN, MARGIN + 10, 3.2, {"fill": "#5a6069"})


def _draw_scale_bar(parent: ET.Element, model: Model, sheet: Sheet) -> None:
    """Five equal parts, black and white, together at most 60 mm; the model's notes beside it."""
    part = max(p for p in (0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50) if p * 5000 / sheet.scale <= 60 or p == 0.1)
    length, x, y = part * 1000 / sheet.scale, MARGIN, float(sheet.size[1]) - MARGIN - 2
    for i in range(5):
        box = {"x": _number(x + i * length), "y": _number(y), "width": _number(length), "height": "1.6"}
        fill = {"fill": INK if i % 2 == 0 else "#ffffff", "stroke": INK, "stroke-width": "0.2"}
        ET.SubElement(parent, "rect", box | fill)
    for i in (0, 1, 5):
        end = " m" if i == 5 else ""
        _text(parent, f"{part * i:g}{end}", x + i * length, y - 1.2, 2.6, {"text-anchor": "middle"})
    for line, note in enumerate(reversed(model.notes[:3])):
        _text(parent, note, x + 5 * length + 10, y + 1.6 - 3.4 * line, 2.6, {"fill": "#5a6069"})


def _text(parent: ET.Element, text: str, x: float, y: float, size: float, more: dict[str, str]) -> None:
    place = {"x": _number(x), "y": _number(y), "font-size": _number(size)}
    ET.SubElement(parent, "text", place | more).text = text


def _number(value: float, decimals: int = 4) -> str:
    return f"{round(float(value), decimals) + 0.0:.{decimals}f}".rstrip("0").rstrip(".")


def _numbers(values: Iterable[float] | Array, decimals: int = 4) -> str:
    return " ".join(_number(v, decimals) for v in values)


def _path(points: Array, closed: bool) -> str:
    return "M" + " L".join(_numbers(p) for p in points) + (" Z" if closed else "")


def _polygons_path(geometry: object) -> str:
    import shapely

    parts = [p for p in shapely.get_parts(geometry) if p.geom_type == "Polygon"]
    rings = [ring for part in parts for ring in (part.exterior, *part.interiors)]
    return " ".join(_path(np.array(ring.coords)[:-1], True) for ring in rings)
