"""DXF: the plan for CAD programs, in metres and map coordinates; layers as the US National CAD Standard names them."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

import numpy as np

from recon.exporters.output import Output
from recon.geometry import Array
from recon.model import Dimension, Layout, Model, OpeningType, Wall
from recon.plan import drawn_dimensions, label_spot, opening_ends, sigma_text, solid_pieces

if TYPE_CHECKING:
    from ezdxf.document import Drawing
    from ezdxf.layouts import Modelspace

METRES = 6  # $INSUNITS
APPLICATION = "RECON"
"""Owner of the extended data on walls: name, sigma of the offset (m) and of the direction (rad), source."""

LAYERS: dict[str, tuple[int, int]] = {
    "A-WALL": (7, 50),
    "A-WALL-OPNG": (8, 18),
    "A-DOOR": (30, 25),
    "A-GLAZ": (4, 25),
    "A-AREA": (3, 13),
    "A-AREA-IDEN": (3, 18),
    "A-FURN": (8, 18),
    "A-ANNO-NOTE": (8, 18),
    "A-ANNO-DIMS": (5, 13),
}
"""Layer: AutoCAD colour number, line weight in 1/100 mm."""
OPENING_LAYERS: dict[OpeningType, str] = {"door": "A-DOOR", "passage": "A-WALL-OPNG", "window": "A-GLAZ"}


def write_dxf(model: Model, stem: str) -> Output:
    """Walls as lines broken at openings, openings as lines on their own layer, rooms as closed outlines with labels."""
    import ezdxf

    fixed = ezdxf.options.write_fixed_meta_data_for_testing
    ezdxf.options.write_fixed_meta_data_for_testing = True  # no time stamps and random ids: same model, same bytes
    try:
        document = ezdxf.new("R2010", setup=["linetypes"])
        _set_up(document, model)
        _draw(document.modelspace(), model)
        stream = io.StringIO()
        document.write(stream)
    finally:
        ezdxf.options.write_fixed_meta_data_for_testing = fixed
    return Output(document.encode(stream.getvalue()))


def _set_up(document: Drawing, model: Model) -> None:
    document.header["$INSUNITS"] = METRES
    document.header["$MEASUREMENT"] = 1
    document.header["$LUNITS"] = 2
    document.appids.add(APPLICATION)
    for name, (colour, weight) in LAYERS.items():
        document.layers.add(name, color=colour, lineweight=weight)
    document.layers.get("A-WALL-OPNG").dxf.linetype = "DASHED"
    document.styles.add("RECON", font="arial.ttf")
    points = _points(model.layout)
    low, high = points.min(axis=0), points.max(axis=0)
    document.header["$EXTMIN"], document.header["$EXTMAX"] = (*low.tolist(), 0.0), (*high.tolist(), 0.0)
    size = np.maximum(high - low, 1.0)
    height = float(max(size[1], size[0] / 1.6)) * 1.15
    document.set_modelspace_vport(height, center=tuple(((low + high) / 2).tolist()))


def _points(layout: Layout) -> Any:
    ends = [np.stack([w.start, w.end]) for w in layout.walls]
    points = ends + [room.polygon for room in layout.rooms]
    return np.concatenate(points) if points else np.zeros((1, 2))


def _draw(space: Modelspace, model: Model) -> None:
    """From the bottom up: what is drawn later lies on top."""
    layout = model.layout
    for room in layout.rooms:
        _draw_room(space, room.name, room.polygon)
    for item in layout.objects:
        space.add_lwpolyline(item.footprint.tolist(), close=True, dxfattribs={"layer": "A-FURN"})
    for wall in layout.walls:
        for piece in solid_pieces(layout, wall):
            line = space.add_line(*piece.tolist(), dxfattribs={"layer": "A-WALL"})
            line.set_xdata(APPLICATION, _wall_data(wall))
    for opening in layout.openings:
        ends = opening_ends(opening, layout.wall(opening.wall))
        line = space.add_line(*ends.tolist(), dxfattribs={"layer": OPENING_LAYERS[opening.type]})
        name = f"{opening.type}_{opening.id:03d}"
        line.set_xdata(APPLICATION, [(1000, name), (1040, float(opening.bottom)), (1040, float(opening.top))])
    for dimension in drawn_dimensions(layout):
        _draw_dimension(space, dimension)
    if model.notes:
        corner = _points(layout).min(axis=0) - [0.0, 0.5]
        style = {"layer": "A-ANNO-NOTE", "style": "RECON", "char_height": 0.15, "attachment_point": 1}
        space.add_mtext("\\P".join(_plain(n) for n in model.notes), style).set_location(corner.tolist())


def _draw_room(space: Modelspace, name: str, polygon: Array) -> None:
    import shapely

    space.add_lwpolyline(polygon.tolist(), close=True, dxfattribs={"layer": "A-AREA"})
    spot, _ = label_spot(polygon)
    style = {"layer": "A-AREA-IDEN", "style": "RECON", "char_height": 0.2, "attachment_point": 5}
    space.add_mtext(f"{_plain(name)}\\P{shapely.Polygon(polygon).area:.2f} m²", style).set_location(spot.tolist())


def _draw_dimension(space: Modelspace, dimension: Dimension) -> None:
    """Between the two walls, with the standard deviation behind the distance that the program measures itself."""
    ends = [tuple(point.tolist()) for point in (dimension.start, dimension.end)]
    sizes = {"dimtxt": 0.12, "dimasz": 0.08, "dimgap": 0.04, "dimdec": 3, "dimzin": 0, "dimexo": 0.0, "dimexe": 0.0}
    style = {"layer": "A-ANNO-DIMS"}
    text = f"<> {sigma_text(dimension.sigma)}"
    space.add_aligned_dim(*ends, 0.0, text=text, dimstyle="Standard", override=sizes, dxfattribs=style).render()


def _wall_data(wall: Wall) -> list[tuple[int, Any]]:
    sigmas = [(1040, float(s)) for s in (wall.sigma_offset, wall.sigma_angle) if np.isfinite(s)]
    return [(1000, f"wall_{wall.id:03d}"), *sigmas, (1000, wall.source)]


def _plain(text: str) -> str:
    """Text without what MTEXT would take for formatting."""
    return text.replace("\\", "\\\\").replace("{", "\\{").replace("}", "\\}").replace("\n", " ")
