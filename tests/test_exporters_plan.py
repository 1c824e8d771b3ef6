from __future__ import annotations

import dataclasses
import re
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as ET

import ezdxf
import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from two_rooms import L_ROOM, SQUARE_ROOM, two_rooms

from recon.exporters import export
from recon.geometry import Array, rotation2
from recon.model import Layout, Model, Opening, Room, Wall
from recon.plan import DRAWN_THICKNESS, dominant_angle, opening_span, solid_pieces, wall_bodies
from recon.plan.solids import Solids

SVG = "{http://www.w3.org/2000/svg}"


def turned(model: Model, angle: float) -> Model:
    """The layout of the model turned about the origin, as a drive that starts askew sees it."""
    turn = rotation2(angle)
    layout = model.layout
    walls = tuple(dataclasses.replace(w, start=turn @ w.start, end=turn @ w.end) for w in layout.walls)
    rooms = tuple(dataclasses.replace(r, polygon=r.polygon @ turn.T) for r in layout.rooms)
    openings = tuple(dataclasses.replace(o, start=turn @ o.start, end=turn @ o.end) for o in layout.openings)
    return dataclasses.replace(model, layout=dataclasses.replace(layout, walls=walls, rooms=rooms, openings=openings))


def path_points(data: str) -> Array:
    numbers = [float(n) for n in re.findall(r"-?\d+\.?\d*(?:e-?\d+)?", data)]
    return np.array(numbers).reshape(-1, 2)


class Page:
    """An SVG plan as a reader without recon sees it."""

    def __init__(self, path: Path) -> None:
        self.root = ET.parse(path).getroot()
        self.ids = {e.get("id"): e for e in self.root.iter() if e.get("id")}
        numbers = re.findall(r"-?[\d.]+", str(self.ids["plan"].get("transform")))
        a, b, c, d, e, f = (float(n) for n in numbers)
        self.matrix = np.array([[a, c, e], [b, d, f]])

    def points(self, name: str) -> Array:
        """Points of a path, metres."""
        return path_points(str(self.ids[name].get("d")))


@pytest.mark.parametrize("angle", [0.0, 0.3, 2.0])
def test_svg_is_to_scale_and_parallel_to_the_page(angle: float, tmp_path: Path) -> None:
    model = turned(two_rooms(), angle)
    export(model, tmp_path / "plan.svg")
    page = Page(tmp_path / "plan.svg")
    width, height = (float(str(page.root.get(k)).removesuffix("mm")) for k in ("width", "height"))
    assert page.root.get("viewBox") == f"0 0 {page.root.get('width')} {page.root.get('height')}".replace("mm", "")
    assert (width, height) in ((297.0, 210.0), (420.0, 297.0))  # A4 or A3
    scale = int(re.findall(r"scale 1:(\d+)", str(page.root.findtext(f"{SVG}desc")))[0])
    turn = page.matrix[:, :2] * scale / 1000
    np.testing.assert_allclose(turn @ turn.T, np.eye(2), atol=1e-4)
    assert np.linalg.det(turn) < 0  # y up in the map, down on the page: not mirrored
    for room in model.layout.rooms:
        drawn = page.points(f"room_{room.id:03d}")
        np.testing.assert_allclose(drawn, room.polygon, atol=1e-4)
        on_page = np.column_stack([drawn, np.ones(len(drawn))]) @ page.matrix.T
        assert on_page.min() > 0 and on_page[:, 0].max() < width and on_page[:, 1].max() < height
        sides = np.abs(np.diff(on_page, axis=0))
        assert sides.min(axis=1).max() < 0.01  # mm: every wall is parallel to an edge of the page


def test_svg_says_names_areas_and_scale(tmp_path: Path) -> None:
    export(two_rooms(), tmp_path / "plan.svg")
    page = Page(tmp_path / "plan.svg")
    texts = [e.text for e in page.root.iter(f"{SVG}text")]
    for expected in ("Büro", "Büro 1", "18.00 m²", "Küche & Flur <2>", "10.64 m²", "The ceiling height is assumed."):
        assert expected in texts
    assert "1:50" in texts


def test_svg_walls_are_broken_at_openings(tmp_path: Path) -> None:
    model = two_rooms()
    export(model, tmp_path / "plan.svg")
    page = Page(tmp_path / "plan.svg")
    np.testing.assert_allclose(page.points("wall_000"), np.array([[0, 0], [1, 0], [1.9, 0], [6, 0]]), atol=1e-6)
    drawn = {name for name in page.ids if re.fullmatch(r"(door|passage|window)_\d+", str(name))}
    assert drawn == {"door_000", "passage_001", "window_003"}  # the passage once, through both walls


@pytest.mark.parametrize("angle", [0.0, 0.7])
def test_corners_of_measured_walls_are_measured(angle: float) -> None:
    """All that was seen of a room's walls is how thick they are: no corner is drawn as if it were assumed."""
    layout = turned(two_rooms(), angle).layout
    thick = replace(layout, walls=tuple(replace(w, thickness=0.2, unseen=np.zeros((0, 2))) for w in layout.walls))
    seen = Solids.of(thick)
    assert seen.assumed.area < 1e-6
    assert seen.measured.area == pytest.approx(seen.whole.area, rel=1e-6)
    one = replace(thick, walls=(replace(thick.walls[0], thickness=None), *thick.walls[1:]))
    depth = Solids.of(one).assumed.area / thick.walls[0].length
    assert depth > 0.5 * DRAWN_THICKNESS, "one that is not is not"


def test_bodies_of_walls_are_outside_of_rooms_and_behind_every_wall() -> None:
    layout = two_rooms().layout
    bodies, rooms = wall_bodies(layout), shapely.union_all([shapely.Polygon(p) for p in (L_ROOM, SQUARE_ROOM)])
    assert bodies.intersection(rooms).area < 1e-9
    for wall in layout.walls:
        for piece in solid_pieces(layout, wall):
            strip = shapely.LineString(piece).buffer(0.5 * DRAWN_THICKNESS, single_sided=True, cap_style="flat")
            assert strip.area > 0
            behind = shapely.LineString(piece - 0.02 * wall.normal)
            assert bodies.buffer(1e-9).contains(behind)
    for opening in layout.openings:
        middle = (opening.start + opening.end) / 2 - 0.05 * layout.wall(opening.wall).normal
        assert not bodies.contains(shapely.Point(middle))
    whole = wall_bodies(layout, cut=False)
    hull = shapely.box(-DRAWN_THICKNESS, -DRAWN_THICKNESS, 6 + DRAWN_THICKNESS, 5 + DRAWN_THICKNESS)
    assert whole.union(rooms).symmetric_difference(hull).area < 1e-6  # corners mitred, inner wall filled


@settings(max_examples=60, deadline=None)
@given(st.floats(-10, 10), st.lists(st.tuples(st.floats(-1, 9), st.floats(-1, 9)), max_size=4))
def test_pieces_and_openings_make_up_the_wall(angle: float, spans: list[tuple[float, float]]) -> None:
    wall = Wall(7, np.array([1.0, -2.0]), np.array([1.0, -2.0]) + 8 * rotation2(angle)[:, 0], 0.01, 0.01, "lidar", 3)
    ends = [(wall.start + a * wall.direction, wall.start + b * wall.direction) for a, b in spans]
    openings = tuple(Opening(i, "door", 7, a, b, 0.0, 2.0) for i, (a, b) in enumerate(ends))
    layout = Layout((wall,), (), openings)
    solid = [((p - wall.start) @ wall.direction).tolist() for p in solid_pieces(layout, wall)]
    inside = np.linspace(0.0, 8.0, 1601)[1:-1] + 1e-4
    in_opening = np.zeros(len(inside), bool)
    for opening in openings:
        low, high = opening_span(opening, wall)
        in_opening |= (inside >= low) & (inside <= high)
    in_solid = np.zeros(len(inside), bool)
    for low, high in solid:
        assert 0 <= low < high <= 8 + 1e-9
        assert not np.any(in_solid & (inside > low) & (inside < high))
        in_solid |= (inside > low) & (inside < high)
    assert np.mean(in_solid == ~in_opening) > 0.995  # all but ends and pieces under a millimetre


@settings(max_examples=60, deadline=None)
@given(st.floats(-0.78, 0.78), st.integers(0, 3))
def test_dominant_angle_of_a_turned_building(angle: float, quarters: int) -> None:
    layout = turned(two_rooms(), angle + quarters * np.pi / 2).layout
    assert dominant_angle(layout) == pytest.approx(angle, abs=1e-9)


@pytest.fixture
def drawing(tmp_path: Path) -> ezdxf.document.Drawing:
    export(two_rooms(), tmp_path / "plan.dxf")
    return ezdxf.readfile(tmp_path / "plan.dxf")


def test_dxf_is_sound_and_metric(drawing: ezdxf.document.Drawing) -> None:
    audit = drawing.audit()
    assert (audit.errors, audit.fixes) == ([], [])
    assert drawing.header["$INSUNITS"] == 6
    assert {layer.dxf.name for layer in drawing.layers} >= {"A-WALL", "A-DOOR", "A-GLAZ", "A-AREA"}
    used = {entity.dxf.layer for entity in drawing.modelspace()}
    assert "0" not in used and used <= {layer.dxf.name for layer in drawing.layers}


def test_dxf_has_walls_openings_and_rooms(drawing: ezdxf.document.Drawing) -> None:
    layout, space = two_rooms().layout, drawing.modelspace()
    lines = [e for e in space.query('LINE[layer=="A-WALL"]') if e.has_xdata("RECON")]
    length = sum((e.dxf.end - e.dxf.start).magnitude for e in lines)
    assert length == pytest.approx(sum(w.length for w in layout.walls) - 0.9 - 2.0 - 1.5)
    rooms = [np.array(e.get_points("xy")) for e in space.query('LWPOLYLINE[layer=="A-AREA"]')]
    for found, room in zip(rooms, layout.rooms, strict=True):
        np.testing.assert_allclose(found, room.polygon, atol=1e-9)
    texts = [e.plain_text() for e in space.query('TEXT[layer=="A-AREA-IDEN"]')]
    assert texts == ["Büro 1", "18.00 m²", "h 2.500 m", "Küche & Flur <2>", "10.64 m²", "h 2.500 m"]
    for layer in ("A-DOOR", "A-GLAZ", "A-WALL-OPNG", "A-FURN", "A-WALL-PATT", "A-ANNO-DIMS"):
        assert space.query(f'*[layer=="{layer}"]'), layer


def test_dxf_walls_carry_their_accuracy(drawing: ezdxf.document.Drawing) -> None:
    lines = drawing.modelspace().query('LINE[layer=="A-WALL"]')
    known = [line.get_xdata("RECON") for line in lines if line.has_xdata("RECON")]
    data = {tags[0].value: [tag.value for tag in tags] for tags in known}
    assert data["wall_003"] == ["wall_003", pytest.approx(0.013), pytest.approx(0.002), "lidar"]


def test_names_cannot_break_the_files(tmp_path: Path) -> None:
    model = two_rooms()
    nasty = 'a {\\C1;b} & <c> "d" %%u \n e'
    rooms = (Room(0, nasty, L_ROOM), model.layout.rooms[1])
    model = dataclasses.replace(model, name=nasty, layout=dataclasses.replace(model.layout, rooms=rooms))
    for suffix in (".svg", ".dxf", ".pdf", ".png", ".glb", ".usda", ".json", ".obj"):
        export(model, tmp_path / f"plan{suffix}")
    assert not ezdxf.readfile(tmp_path / "plan.dxf").audit().errors
    shown = [e.text for e in ET.parse(tmp_path / "plan.svg").getroot().iter(f"{SVG}text")]
    assert {'a {\\C1;b} & <c> "d"', "%%u e"} <= set(shown)  # one line each
    texts = [e.plain_text() for e in ezdxf.readfile(tmp_path / "plan.dxf").modelspace().query("TEXT")]
    assert {'a {\\C1;b} & <c> "d"', "%%u e"} <= set(texts)
