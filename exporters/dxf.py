"""DXF: the plan for CAD programs: true size in model space, a sheet to scale in paper space."""

from __future__ import annotations

import io
import re
import unicodedata
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from recon.exporters.dxf_entities import STYLE, Pencil, layer_name, style_for
from recon.exporters.options import DEFAULTS, ExportOptions
from recon.exporters.output import Output
from recon.model import Layout, Model
from recon.plan.draw import draw_plan
from recon.plan.drawing import Drawing, Text
from recon.plan.fonts import Han, han
from recon.plan.layers import LAYERS, VIEWPORT
from recon.plan.lettering import clean
from recon.plan.options import DrawingOptions, Units
from recon.plan.quantity import INCH
from recon.plan.walls import dominant_angle
from recon.storeys import Building

if TYPE_CHECKING:
    from ezdxf.document import Drawing as Document

APPLICATION = "RECON"
"""Owner of the extended data on entities: names, standard deviations (m, rad), sources."""
VERSIONS = {"cad": "R2018", "plain": "R2000"}
UNITS: dict[Units, tuple[float, int, int, int]] = {
    "m": (1.0, 6, 1, 2),
    "mm": (1000.0, 4, 1, 2),
    "ft": (1 / INCH, 1, 0, 4),
}
"""Drawing units in a metre; $INSUNITS, $MEASUREMENT and $LUNITS."""
DASH, GAP = 1.6, 1.0
"""mm on paper."""
DASHED = "RECON_DASHED"
"""Its lengths are drawing units; some programs put their own, for millimetres, in place of what is called DASHED."""
BY_LAYER = 256
HAN_FONTS: dict[Han, str] = {"SC": "simsun.ttc", "JP": "msgothic.ttc", "KR": "malgun.ttf"}
"""What Windows has for Chinese, Japanese and Korean; other scripts it finds fonts for by itself."""

Floor = tuple[str, float, Drawing]  # suffix of its layers, elevation in m, drawing


def write_dxf(model: Model, stem: str, options: ExportOptions = DEFAULTS) -> Output:
    """The plan on layers by their standard names."""
    return Output(_written([("", 0.0, draw_plan(model, options.drawing))], options.drawing))


def write_building_dxf(building: Building, stem: str, options: ExportOptions = DEFAULTS) -> Output:
    """All storeys at their true places, each on layers of its own (`A-WALL-FIRST`) and on a sheet of its own."""
    walls = tuple(wall for storey in building.storeys for wall in storey.model.layout.walls)
    angle = dominant_angle(Layout(walls, ()))
    floors, used = [], set[str]()
    for storey in building.storeys:
        letters = unicodedata.normalize("NFKD", clean(storey.name)).encode("ascii", "ignore").decode().upper()
        suffix = re.sub(r"[^A-Z0-9_]+", "_", letters).strip("_") or "STOREY"
        while suffix in used:
            suffix += "_"
        used.add(suffix)
        drawing = draw_plan(storey.model, options.drawing, angle)
        floors.append((f"-{suffix}" if len(building.storeys) > 1 else "", storey.elevation, drawing))
    return Output(_written(floors, options.drawing))


def _written(floors: Sequence[Floor], options: DrawingOptions) -> bytes:
    import ezdxf

    fixed = ezdxf.options.write_fixed_meta_data_for_testing
    ezdxf.options.write_fixed_meta_data_for_testing = True  # no time stamps and random ids: same model, same bytes
    try:
        document = ezdxf.new(VERSIONS[options.dxf_profile])
        _set_up(document, floors, options)
        for suffix, elevation, drawing in floors:
            pencil = Pencil(document.modelspace(), options, drawing, suffix, UNITS[options.units][0])
            for element in drawing.plan:
                pencil.draw(element, elevation)
            if options.dxf_profile == "cad":
                _sheet(document, floors, suffix, drawing, options)
        if options.dxf_profile == "cad" and len(floors) > 1:
            document.layouts.delete("Layout1")
        for kind in sorted(document.entitydb.dxf_types_in_use()):  # ezdxf takes them as they come out of a set
            document.classes.add_class(kind)
        stream = io.StringIO()
        document.write(stream)
    finally:
        ezdxf.options.write_fixed_meta_data_for_testing = fixed
    return bytes(document.encode(stream.getvalue()))


def _set_up(document: Document, floors: Sequence[Floor], options: DrawingOptions) -> None:
    """Units, layers, line type, styles, extents, and the map's axes as a coordinate system `MAP`."""
    unit, insunits, measurement, lunits = UNITS[options.units]
    first = floors[0][2]
    mm = first.scale / 1000 * unit
    header = document.header
    header["$INSUNITS"], header["$MEASUREMENT"], header["$LUNITS"] = insunits, measurement, lunits
    header["$LUPREC"], header["$PSLTSCALE"], header["$DIMSTYLE"] = 3, 0, STYLE
    document.appids.add(APPLICATION)
    document.linetypes.add(DASHED, [(DASH + GAP) * mm, DASH * mm, -GAP * mm], description="_ _ _ _")
    document.styles.add(STYLE, font="arial.ttf")
    for letters, font in HAN_FONTS.items():
        if any(isinstance(e, Text) and han(e.text) == letters for _, _, d in floors for e in (*d.plan, *d.sheet)):
            document.styles.add(style_for(letters), font=font)
    _dimension_style(document, mm, options)
    for suffix, _, _ in floors:
        for layer in LAYERS:
            name = layer_name(layer, options, suffix)
            if name not in document.layers:
                kind = {"linetype": DASHED} if layer.dashed else {}
                row = document.layers.add(name, color=layer.colour, lineweight=round(layer.pen * 100), **kind)
                row.dxf.plot = int(layer.plotted)
    turn = np.array([[np.cos(first.angle), -np.sin(first.angle)], [np.sin(first.angle), np.cos(first.angle)]])
    document.ucs.add("MAP", dxfattribs={"xaxis": (*turn[0], 0.0), "yaxis": (*turn[1], 0.0)})
    header.custom_vars.append("Rotation", f"{np.degrees(-first.angle):.6f} degrees, from the map to this drawing")
    header.custom_vars.append("Scale", f"1:{first.scale}")
    _views(document, floors, unit)


def _views(document: Document, floors: Sequence[Floor], unit: float) -> None:
    """Extents and the first view: all that is drawn."""
    low = np.min([drawing.window[0] for _, _, drawing in floors], axis=0) * unit
    high = np.max([drawing.window[1] for _, _, drawing in floors], axis=0) * unit
    corners = (*low.tolist(), 0.0), (*high.tolist(), 0.0)
    document.header["$EXTMIN"], document.header["$EXTMAX"] = corners
    space = document.modelspace()
    space.reset_extents(*corners)
    space.reset_limits(corners[0][:2], corners[1][:2])
    size = high - low
    height = float(max(size[1], size[0] / 1.6))
    document.set_modelspace_vport(height, center=tuple(((low + high) / 2).tolist()))


def _dimension_style(document: Document, mm: float, options: DrawingOptions) -> None:
    """Architectural: oblique strokes, short extension lines, figures above. mm: one on paper, drawing units."""
    from recon.plan.chains import BEYOND
    from recon.plan.drawing import TICK
    from recon.plan.inner import GAP as RISE
    from recon.plan.inner import HEIGHT

    style = document.dimstyles.new(STYLE)
    sizes = {"dimtxt": HEIGHT, "dimtsz": TICK, "dimasz": TICK, "dimgap": RISE / 2, "dimexe": BEYOND, "dimfxl": BEYOND}
    lengths = {name: value * mm for name, value in (sizes | {"dimexo": 0.5}).items()}
    decimals = {"m": 3, "mm": 0, "ft": 3}[options.units]
    fixed: dict[str, float] = {"dimdec": decimals, "dimzin": 0, "dimdsep": 46, "dimtad": 1, "dimtmove": 2, "dimtih": 0}
    colours = dict.fromkeys(("dimclrd", "dimclre", "dimclrt"), BY_LAYER)
    fixed |= {"dimtoh": 0, "dimscale": 1.0, "dimlfac": 1.0, "dimfxlon": 1, "dimlunit": 2}
    for name, value in (lengths | fixed | colours).items():
        style.set_dxf_attrib(name, value)
        document.header[f"${name.upper()}"] = value  # what programs go by that know no styles
    style.dxf.dimtxsty = STYLE


def _sheet(document: Document, floors: Sequence[Floor], suffix: str, drawing: Drawing, options: DrawingOptions) -> None:
    """Title block and a view of the plan to scale, in drawing units; of other storeys nothing is seen.

    Programs without paper space draw it beside the plan, and take the paper's limits for its size in drawing units.
    """
    unit = UNITS[options.units][0]
    mm = unit / 1000
    space = document.layouts.new(f"Plan{suffix}") if suffix else document.layouts.get("Layout1")
    if not suffix:
        document.layouts.rename("Layout1", "Plan")
    space.page_setup(size=drawing.paper, margins=(0, 0, 0, 0), units="mm", scale=(1 / mm, 1))
    space.dxf.limmin, space.dxf.limmax = (0.0, 0.0), tuple(side * mm for side in drawing.paper)
    pencil = Pencil(space, options, drawing, suffix, mm)
    for element in drawing.sheet:
        pencil.draw(element)
    low, high = drawing.on_paper(drawing.window) * mm
    view = space.add_viewport(
        center=tuple(((low + high) / 2).tolist()),
        size=tuple((high - low).tolist()),
        view_center_point=tuple((drawing.window.mean(axis=0) * unit).tolist()),
        view_height=float(drawing.window[1, 1] - drawing.window[0, 1]) * unit,
        status=2,
    )
    view.dxf.layer = layer_name(VIEWPORT, options, suffix)
    view.frozen_layers = [
        layer_name(layer, options, other) for other, _, _ in floors if other != suffix for layer in LAYERS
    ]
