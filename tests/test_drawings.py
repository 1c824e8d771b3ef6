"""Plans as DXF, SVG and PDF: read back by other readers, compared with the layout and with one another."""

from __future__ import annotations

import ctypes
import dataclasses
import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree as ET

import cv2
import ezdxf
import numpy as np
import pypdfium2
import pypdfium2.raw as pdfium
import pytest
import shapely
from click.testing import CliRunner
from two_rooms import two_rooms

from recon.cli.main import recon
from recon.errors import ConfigError
from recon.exporters import DRAWINGS, export, export_building
from recon.exporters.options import ExportOptions
from recon.geometry import Array, rotation2
from recon.model import Dimension, Layout, Model, Room, Wall
from recon.plan.draw import draw_plan, turned
from recon.plan.drawing import Text
from recon.plan.options import DrawingOptions
from recon.sequence.write import write_scans
from recon.simulate import random_plan, run_simulation
from recon.simulate.building import build_building
from recon.simulate.truth import true_layout
from recon.storeys import Storey, stack

SVG = "{http://www.w3.org/2000/svg}"
POINT = 25.4 / 72


def measured(layout: Layout) -> Layout:
    """With a dimension from the middle of every wall to the wall that faces it."""
    walls = {tuple(np.round(w.start, 6)): w for w in layout.walls}
    found: dict[frozenset[int], Dimension] = {}
    for room in layout.rooms:
        own = [walls[tuple(np.round(corner, 6))] for corner in room.polygon]
        for a in own:
            middle = (a.start + a.end) / 2
            way = shapely.LineString([middle + 0.01 * a.normal, middle + 100 * a.normal])
            hits = [(way.intersection(shapely.LineString([b.start, b.end])), b) for b in own if b is not a]
            seen = [(shapely.Point(middle).distance(hit), b) for hit, b in hits if not hit.is_empty]
            if seen:
                distance, b = min(seen, key=lambda pair: pair[0])
                if a.normal @ b.normal < -0.9999:
                    end = middle + distance * a.normal
                    found.setdefault(frozenset((a.id, b.id)), Dimension(room.id, (a.id, b.id), middle, end, 0.006))
    return dataclasses.replace(layout, dimensions=tuple(found.values()))


def random_model(seed: int, rooms: int, angles: str = "manhattan", turn: float = 0.4) -> Model:
    """The truth of a simulated building, askew in the map, with sigmas and one inferred wall."""
    plan = random_plan(seed, rooms, angles)  # type: ignore[arg-type]
    layout = true_layout(build_building(plan), np.array([3.0, -7.0, turn]))
    walls = [dataclasses.replace(w, sigma_offset=0.004, sigma_angle=0.0005, observations=9) for w in layout.walls]
    walls[-1] = dataclasses.replace(walls[-1], source="inferred")
    return Model(f"random {seed}", measured(dataclasses.replace(layout, walls=tuple(walls))), ())


@pytest.fixture(scope="module")
def building() -> Model:
    return random_model(11, 5)


def solid(layout: Layout) -> dict[int, shapely.Geometry]:
    """The part of every wall outside of its openings, computed from the layout alone."""
    out = {}
    for wall in layout.walls:
        line = shapely.LineString([wall.start, wall.end])
        for o in layout.openings:
            if o.wall == wall.id:
                line = line.difference(shapely.LineString([o.start, o.end]).buffer(1e-6, cap_style="flat"))
        out[wall.id] = line
    return out


def check_walls(segments: list[Array], layout: Layout) -> None:
    """Every wall is drawn within 1 mm, and longer gaps are not drawn over."""
    drawn = shapely.union_all([shapely.LineString(s) for s in segments]).buffer(0.001 + 1e-6)
    for wall_id, line in solid(layout).items():
        assert drawn.covers(line), wall_id


def dxf_lines(path: Path, layer: str = "A-WALL") -> list[Array]:
    """Lines of a layer and of what was inferred, drawing units."""
    out = []
    for e in ezdxf.readfile(path).modelspace():
        if e.dxf.layer not in (layer, "A-WALL-INFR"):
            continue
        if e.dxftype() == "LINE":
            out.append(np.array([tuple(e.dxf.start.vec2), tuple(e.dxf.end.vec2)]))
        elif e.dxftype() == "LWPOLYLINE":
            out.append(np.array(e.get_points("xy")))
    return out


@pytest.mark.parametrize(
    ("profile", "units", "unit"), [("cad", "m", 1), ("plain", "mm", 1000), ("cad", "ft", 1 / 0.0254)]
)
def test_dxf_has_the_walls_of_the_layout(
    building: Model, profile: str, units: str, unit: float, tmp_path: Path
) -> None:
    options = DrawingOptions(dxf_profile=profile, units=units)  # type: ignore[arg-type]
    export(building, tmp_path / "plan.dxf", ExportOptions(drawing=options))
    lines = dxf_lines(tmp_path / "plan.dxf")
    axes = ezdxf.readfile(tmp_path / "plan.dxf").ucs.get("MAP")
    to_map = np.array(
        [tuple(axes.dxf.xaxis.vec2), tuple(axes.dxf.yaxis.vec2)]
    )  # what the file itself says of its rotation
    check_walls([line @ to_map.T / unit for line in lines], building.layout)
    sides = np.abs(np.array([line[1] - line[0] for line in lines]))
    assert np.mean(sides.min(axis=1) < 1e-3 * sides.max(axis=1)) > 0.9  # along the axes


def test_svg_has_the_walls_of_the_layout(building: Model, tmp_path: Path) -> None:
    export(building, tmp_path / "plan.svg")
    lines = []
    for path in ET.parse(tmp_path / "plan.svg").getroot().iter(f"{SVG}path"):
        if str(path.get("id")).startswith("wall_"):
            for piece in str(path.get("d")).split("M")[1:]:
                lines.append(np.array(re.findall(r"-?[\d.]+", piece), float).reshape(-1, 2))
    check_walls(lines, building.layout)


def pdf_lines(path: Path) -> list[Array]:
    """Straight segments of all stroked paths, mm."""
    out = []
    x, y = ctypes.c_float(), ctypes.c_float()
    for item in pypdfium2.PdfDocument(path)[0].get_objects(filter=[pdfium.FPDF_PAGEOBJ_PATH]):
        last = None
        for k in range(pdfium.FPDFPath_CountSegments(item.raw)):
            segment = pdfium.FPDFPath_GetPathSegment(item.raw, k)
            pdfium.FPDFPathSegment_GetPoint(segment, x, y)
            point = np.array([x.value, y.value]) * POINT
            if last is not None and pdfium.FPDFPathSegment_GetType(segment) == pdfium.FPDF_SEGMENT_LINETO:
                out.append(np.stack([last, point]))
            last = point
    return out


def test_pdf_has_the_walls_of_the_layout(building: Model, tmp_path: Path) -> None:
    export(building, tmp_path / "plan.pdf")
    drawing = draw_plan(building)
    lines = [
        (line - drawing.offset) * drawing.scale / 1000 @ rotation2(drawing.angle).T
        for line in pdf_lines(tmp_path / "plan.pdf")
    ]
    check_walls(lines, building.layout)
    page = pypdfium2.PdfDocument(tmp_path / "plan.pdf")[0]
    assert np.array(page.get_size()) * POINT == pytest.approx(drawing.paper, abs=0.01)


def test_all_formats_say_the_same(building: Model, tmp_path: Path) -> None:
    for suffix in DRAWINGS:
        export(building, tmp_path / f"plan{suffix}")
    shown = sorted(e.text for e in draw_plan(building).elements() if isinstance(e, Text))
    svg = sorted(str(e.text) for e in ET.parse(tmp_path / "plan.svg").getroot().iter(f"{SVG}text"))
    document = ezdxf.readfile(tmp_path / "plan.dxf")
    dxf = [e.plain_text() for space in (document.modelspace(), document.layout("Plan")) for e in space.query("TEXT")]
    for dimension in document.modelspace().query("DIMENSION"):
        dxf += [e.text for e in document.blocks[dimension.dxf.geometry].query("MTEXT") if e.text.strip()]
    assert svg == shown == sorted(dxf)
    page = pypdfium2.PdfDocument(tmp_path / "plan.pdf")[0].get_textpage().get_text_bounded()
    words = set(page.split())
    assert {word for text in shown for word in text.split()} <= words
    picture = cv2.imread(str(tmp_path / "plan.png"))
    assert picture is not None
    width, height = draw_plan(building).paper
    assert picture.shape[1] / picture.shape[0] == pytest.approx(width / height, rel=0.01)
    assert 0.01 < np.mean(picture < 128) < 0.3  # something is drawn, and it is no black page


@pytest.mark.parametrize("seed", range(20))
def test_no_text_lies_over_another(seed: int) -> None:
    model = random_model(100 + seed, 1 + seed % 10, "any" if seed % 3 == 2 else "manhattan", 0.3 * seed)
    texts = [e for e in draw_plan(model).elements() if isinstance(e, Text)]
    boxes = np.array([shapely.Polygon(e.box) for e in texts])
    pairs = shapely.STRtree(boxes).query(boxes, predicate="intersects").T
    over = [(texts[a].text, texts[b].text) for a, b in pairs if a < b and boxes[a].intersection(boxes[b]).area > 1e-6]
    assert over == []
    names = {e.text for e in texts}
    assert {room.name for room in model.layout.rooms} <= names


def test_no_text_lies_over_another_on_paper(building: Model, tmp_path: Path) -> None:
    export(building, tmp_path / "plan.pdf")
    page = pypdfium2.PdfDocument(tmp_path / "plan.pdf")[0]
    items = page.get_objects(filter=[pdfium.FPDF_PAGEOBJ_TEXT])
    boxes = np.array([shapely.box(*item.get_bounds()) for item in items])
    assert len(boxes) == sum(isinstance(e, Text) for e in draw_plan(building).elements())
    pairs = shapely.STRtree(boxes).query(boxes, predicate="intersects").T
    assert [(a, b) for a, b in pairs if a < b and boxes[a].intersection(boxes[b]).area > 0.05] == []


def test_dimensions_measure_what_they_say(building: Model, tmp_path: Path) -> None:
    export(building, tmp_path / "plan.dxf")
    document = ezdxf.readfile(tmp_path / "plan.dxf")
    inside = outside = 0
    for dimension in document.modelspace().query("DIMENSION"):
        (text,) = [e.text for e in document.blocks[dimension.dxf.geometry].query("MTEXT")]
        if text.strip():
            assert float(re.findall(r"[\d.]+", text)[0]) == pytest.approx(dimension.get_measurement(), abs=6e-4)
            inside += text.endswith("± 0.006 m")
            outside += not text.endswith("m")
    assert inside >= 3 and outside >= 8
    assert not any(
        "±" in e.text for e in draw_plan(building, DrawingOptions(sigmas=False)).elements() if isinstance(e, Text)
    )


def test_plain_dxf_has_polylines_and_texts_only(building: Model, tmp_path: Path) -> None:
    export(building, tmp_path / "plan.dxf", ExportOptions(drawing=DrawingOptions(dxf_profile="plain")))
    document = ezdxf.readfile(tmp_path / "plan.dxf")
    assert document.dxfversion == "AC1015"
    assert {e.dxftype() for e in document.modelspace()} == {"LWPOLYLINE", "TEXT"}


def test_sheet_in_paper_space_is_to_scale(building: Model, tmp_path: Path) -> None:
    options = DrawingOptions(scale=200, paper="A1", units="mm", layers="iso")
    export(building, tmp_path / "plan.dxf", ExportOptions(drawing=options))
    document = ezdxf.readfile(tmp_path / "plan.dxf")
    assert not document.audit().errors
    view = next(v for v in document.layout("Plan").viewports() if v.dxf.id != 1)
    assert view.dxf.view_height / view.dxf.height == pytest.approx(200.0)
    assert sorted(document.layout("Plan").get_paper_limits()[1]) == pytest.approx([594.0, 841.0])
    used = {e.dxf.layer for e in document.modelspace()}
    assert used and all(re.fullmatch(r"A-[A-Z0-9-]{6}[A-Z]-", name) for name in used)


def test_what_does_not_fit_is_refused(building: Model, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="does not fit on A4"):
        export(building, tmp_path / "plan.pdf", ExportOptions(drawing=DrawingOptions(scale=10, paper="A4")))
    assert not (tmp_path / "plan.pdf").exists()


def grid(side: int) -> Model:
    """side x side square rooms of 4 m, 0.15 m apart."""
    rooms: list[Room] = []
    walls: list[Wall] = []
    for k in range(side * side):
        low = 4.15 * np.array(divmod(k, side)) - 2000.0
        polygon = low + np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]])
        rooms.append(Room(k, f"{k}", polygon))
        for a, b in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
            walls.append(Wall(len(walls), a, b, 0.004, 0.001, "lidar", 5, 0.15))
    return Model("grid", measured(Layout(tuple(walls), tuple(rooms))), ())


def keyhole() -> Model:
    """A room around a core, cut open to it, as no simple polygon says it; walls all round the core."""
    outer = np.array([[0.0, 0.0], [8.0, 0.0], [8.0, 6.0], [0.0, 6.0], [0.0, 3.0]])
    core = np.array([[3.0, 2.0], [3.0, 4.0], [5.0, 4.0], [5.0, 2.0]])
    polygon = np.concatenate([outer, core[:1], core[1:], core[:1], outer[-1:]])
    ends = [*zip(outer, np.roll(outer, -1, axis=0), strict=True), *zip(core, np.roll(core, -1, axis=0), strict=True)]
    walls = tuple(Wall(k, a, b, 0.01, 0.001, "lidar", 5) for k, (a, b) in enumerate(ends))
    return Model("keyhole", Layout(walls, (Room(0, "ring", polygon),)), ())


ONE_WALL = Layout((Wall(0, np.array([-5.0, -3.0]), np.array([-1.0, -2.0]), np.inf, np.inf, "image", 0),), ())
NAMES = (
    "会議室 ミーティング",
    "غرفة الاجتماعات",
    "🏢 café",
    "\x00\x07 \ud800 tab\there",
    "Ω" * 300,
    "",
    "  ",
    "^I %%c \\U+0041 \\P",
)


def odd_names() -> Model:
    """Two rooms under any name."""
    model, layout = two_rooms(), two_rooms().layout
    rooms = [dataclasses.replace(layout.rooms[k % 2], id=k, name=name) for k, name in enumerate(NAMES)]
    return dataclasses.replace(
        model, name=NAMES[3], layout=dataclasses.replace(layout, rooms=tuple(rooms)), notes=NAMES
    )


ODD: dict[str, Callable[[], Model]] = {
    "nothing": lambda: Model("", Layout((), ()), ()),
    "one wall": lambda: Model("wall", ONE_WALL, ()),
    "hole": keyhole,
    "names": odd_names,
    "far away": lambda: dataclasses.replace(two_rooms(), layout=turned(two_rooms().layout, 2.2)),
    "many": lambda: grid(4),
}


@pytest.mark.parametrize("name", ODD)
@pytest.mark.parametrize("profile", ["cad", "plain"])
def test_odd_layouts_give_valid_files(name: str, profile: str, tmp_path: Path) -> None:
    model, options = ODD[name](), DrawingOptions(dxf_profile=profile)  # type: ignore[arg-type]
    export(model, tmp_path / "plan.dxf", ExportOptions(drawing=options))
    audit = ezdxf.readfile(tmp_path / "plan.dxf").audit()
    assert (audit.errors, audit.fixes) == ([], [])
    if profile == "plain":
        return
    to_map = rotation2(draw_plan(model).angle)
    check_walls([line @ to_map.T for line in dxf_lines(tmp_path / "plan.dxf")] or [np.zeros((2, 2))], model.layout)
    for suffix in (".svg", ".pdf", ".png"):
        export(model, tmp_path / f"plan{suffix}")
    ET.parse(tmp_path / "plan.svg")
    assert len(pypdfium2.PdfDocument(tmp_path / "plan.pdf")) == 1
    assert cv2.imread(str(tmp_path / "plan.png")) is not None


def test_storeys_have_layers_sheets_and_heights_of_their_own(building: Model, tmp_path: Path) -> None:
    storeys = stack("house", [Storey("Étage 1", 3.2, two_rooms()), Storey("Ground", 0.0, building)])
    export_building(storeys, tmp_path / "house.dxf")
    document = ezdxf.readfile(tmp_path / "house.dxf")
    assert not document.audit().errors
    assert document.layouts.names() == ["Model", "Plan-GROUND", "Plan-ETAGE_1"]
    heights = {e.dxf.layer: e.dxf.start.z for e in document.modelspace().query("LINE") if "A-WALL" in e.dxf.layer}
    assert heights["A-WALL-GROUND"] == 0.0 and heights["A-WALL-ETAGE_1"] == pytest.approx(3.2)
    axes = document.ucs.get("MAP")
    to_map = np.array([tuple(axes.dxf.xaxis.vec2), tuple(axes.dxf.yaxis.vec2)])
    lines = list(document.modelspace().query('LINE[layer=="A-WALL-ETAGE_1"]'))
    check_walls(
        [np.array([tuple(e.dxf.start.vec2), tuple(e.dxf.end.vec2)]) @ to_map.T for e in lines], two_rooms().layout
    )


def test_same_model_same_bytes(tmp_path: Path) -> None:
    for suffix in DRAWINGS:
        for name in ("a", "b"):
            export(two_rooms(), tmp_path / f"{name}{suffix}")
        assert (tmp_path / f"a{suffix}").read_bytes() == (tmp_path / f"b{suffix}").read_bytes(), suffix


def test_the_same_bytes_in_whatever_order_sets_come(tmp_path: Path) -> None:
    imports = (
        "import sys; from pathlib import Path; from two_rooms import two_rooms; from recon.exporters import export"
    )
    script = f"{imports}; [export(two_rooms(), Path(name)) for name in sys.argv[1:]]"
    found = []
    for seed in ("1", "4", "7"):  # classes of a DXF file came in another order with one than with the others
        files = [tmp_path / f"{seed}{suffix}" for suffix in DRAWINGS]
        environment = {**os.environ, "PYTHONHASHSEED": seed}
        command = [sys.executable, "-c", script, *map(str, files)]
        subprocess.run(command, cwd=Path(__file__).parent, env=environment, check=True, timeout=120)
        found.append([file.read_bytes() for file in files])
    assert found[0] == found[1] == found[2]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("-o", "plan.pdf", "--scale", "1:x"), "'1:x' is no scale"),
        (("-o", "plan.pdf", "--dxf-profile", "plain"), "--dxf-profile is for .dxf"),
        (("-o", "plan.json", "--scale", "50"), "--scale is for .dxf .pdf .png .svg"),
        (("-o", "model.glb"), "model.glb: is no plan"),
    ],
)
def test_floorplan_refuses_in_one_line(arguments: tuple[str, ...], said: str, tmp_path: Path) -> None:
    places = [str(tmp_path / a) if a.startswith(("plan.", "model.")) else a for a in arguments]
    result = CliRunner().invoke(recon, ["floorplan", str(tmp_path), *places])
    assert result.exit_code == 2 and said in result.output
    assert list(tmp_path.iterdir()) == []


def test_floorplan_draws_the_plan_of_a_drive(tmp_path: Path) -> None:
    plan = random_plan(3, 1)
    simulation = run_simulation(dataclasses.replace(plan, camera=dataclasses.replace(plan.camera, rate=0.0)), 3)
    (tmp_path / "drive").mkdir()
    write_scans(tmp_path / "drive" / "scans.npz", simulation.scans)
    outputs = [str(tmp_path / name) for name in ("plan.pdf", "plan.json")]
    result = CliRunner().invoke(recon, ["floorplan", str(tmp_path / "drive"), "-q", "-o", outputs[0], "-o", outputs[1]])
    assert result.exit_code == 0, result.output
    assert len(json.loads((tmp_path / "plan.json").read_text())["rooms"]) == len(plan.rooms)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["drive", "plan.json", "plan.pdf"]
