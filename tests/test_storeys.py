from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import ifcopenshell
import ifcopenshell.util.element
import ifcopenshell.util.placement
import ifcopenshell.validate
import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from two_rooms import HEIGHT, two_rooms
from walled_plans import drive, odd_models, row_of_rooms

from recon.errors import InputError, OutputError
from recon.exporters import BUILDING_WRITERS, SUFFIXES, export_building
from recon.layout_json import layout_to_json
from recon.merge import merged, moved
from recon.model import Model
from recon.results.reader import load_model, load_survey
from recon.storeys import Storey, one_storey, stack


def three() -> list[Storey]:
    """Two drives on one floor, one above, in no order."""
    row = Model("row", row_of_rooms([3.0, 4.0], 4.0, 0.2), ())
    return [
        Storey("First floor é", 3.2, row),
        Storey("Ground", -0.5, two_rooms()),
        Storey("Ground", -0.5, moved(row, (10.0, 0.0, 0.5))),
    ]


@pytest.mark.parametrize("suffix", BUILDING_WRITERS)
def test_every_format_of_storeys_writes_them_the_same_twice(suffix: str, tmp_path: Path) -> None:
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        export_building(stack("house", three()), tmp_path / name / f"house{suffix}")
    first, second = ((tmp_path / name / f"house{suffix}").read_bytes() for name in ("a", "b"))
    assert first == second


@pytest.mark.parametrize("suffix", sorted(set(SUFFIXES) - set(BUILDING_WRITERS)))
def test_formats_of_one_storey_are_refused_in_one_line(suffix: str, tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="one storey only") as error:
        export_building(stack("house", three()), tmp_path / f"house{suffix}")
    assert "\n" not in str(error.value)
    assert not list(tmp_path.iterdir())


def test_ifc_has_every_storey_at_its_elevation(tmp_path: Path) -> None:
    export_building(stack("house", three()), tmp_path / "house.ifc")
    file = ifcopenshell.open(str(tmp_path / "house.ifc"))
    floors = file.by_type("IfcBuildingStorey")
    assert [(floor.Name, floor.Elevation) for floor in floors] == [("Ground", -0.5), ("First floor é", 3.2)]
    assert [len(floor.IsDecomposedBy[0].RelatedObjects) for floor in floors] == [4, 2]
    for space in file.by_type("IfcSpace"):
        floor = ifcopenshell.util.element.get_aggregate(space)
        height = ifcopenshell.util.placement.get_local_placement(space.ObjectPlacement)[2, 3]
        assert height == pytest.approx(floor.Elevation)
    assert {ifcopenshell.util.element.get_container(wall).Name for wall in file.by_type("IfcWall")} == {
        "Ground",
        "First floor é",
    }


def test_geojson_names_the_storey(tmp_path: Path) -> None:
    export_building(stack("house", three()), tmp_path / "house.geojson")
    features = json.loads((tmp_path / "house.geojson").read_text(encoding="utf-8"))["features"]
    rooms = [f["properties"] for f in features if f["properties"]["kind"] == "room"]
    assert [(room["storey"], room["elevation"]) for room in rooms] == [("Ground", -0.5)] * 4 + [
        ("First floor é", 3.2)
    ] * 2


def test_storeys_that_contradict_are_refused() -> None:
    model = two_rooms()
    with pytest.raises(InputError, match=r"'A'.*0 and 3 m"):
        stack("house", [Storey("A", 0.0, model), Storey("A", 3.0, model)])
    with pytest.raises(InputError, match=r"'A' and 'B'"):
        stack("house", [Storey("A", 0.0, model), Storey("B", 0.0, model)])
    for wrong, said in ((Storey("A", float("nan"), model), "nan m"), (Storey(" ", 1.0, model), "has no name")):
        with pytest.raises(InputError, match=said):
            stack("house", [wrong])
    assert one_storey(model).storeys[0].elevation == 0.0


@pytest.mark.parametrize(("elevation", "slab"), [(2.6, 0.08), (3.2, 0.2), (2.51, 0.02)])
def test_floors_are_as_thick_as_the_ceilings_below_leave(elevation: float, slab: float, tmp_path: Path) -> None:
    house = stack("house", [Storey("Ground", 0.0, two_rooms()), Storey("First", elevation, two_rooms())])
    assert house.notes == ()
    export_building(house, tmp_path / "a.ifc")
    file = ifcopenshell.open(str(tmp_path / "a.ifc"))
    log = ifcopenshell.validate.json_logger()
    ifcopenshell.validate.validate(str(tmp_path / "a.ifc"), log, express_rules=elevation == 2.6)
    assert [str(statement) for statement in log.statements] == []
    bodies: dict[tuple[str, str], list[Any]] = {}
    for thing in (*file.by_type("IfcSlab"), *file.by_type("IfcCovering")):
        floor = ifcopenshell.util.element.get_container(thing)
        solid = next(r for r in thing.Representation.Representations if r.RepresentationIdentifier == "Body").Items[0]
        bottom = floor.Elevation + solid.Position.Location.Coordinates[2]
        bodies.setdefault((floor.Name, thing.is_a()), []).append((bottom, bottom + solid.Depth))
    assert bodies["Ground", "IfcSlab"] == [pytest.approx((-0.2, 0.0))]
    assert bodies["First", "IfcSlab"] == [pytest.approx((elevation - slab, elevation))]
    if elevation >= HEIGHT + 0.04:
        assert bodies["First", "IfcSlab"][0][0] >= max(top for _, top in bodies["Ground", "IfcCovering"]) - 1e-6


def test_floors_below_ceilings_are_noted_where_rooms_lie_over_rooms() -> None:
    low = stack("house", [Storey("Ground", 0.0, two_rooms()), Storey("First", 1.0, two_rooms())])
    (note,) = low.notes
    assert "1.00 m" in note
    assert "2.50 m" in note
    beside = stack("house", [Storey("Ground", 0.0, two_rooms()), Storey("Half", 1.0, moved(two_rooms(), (50, 0, 0)))])
    assert beside.notes == ()


@settings(max_examples=25, deadline=None)
@given(st.floats(-100, 100), st.floats(-100, 100), st.floats(-3, 3))
def test_moving_keeps_lengths_and_sides(x: float, y: float, yaw: float) -> None:
    trajectory, sigmas, grid = drive()
    model = replace(two_rooms(), trajectory=trajectory, pose_sigmas=sigmas, occupancy=grid)
    there = moved(model, (x, y, yaw))
    c, s = np.cos(yaw), np.sin(yaw)
    turn = np.array([[c, -s], [s, c]])
    for before, after in zip(model.layout.walls, there.layout.walls, strict=True):
        np.testing.assert_allclose(after.start, turn @ before.start + [x, y], atol=1e-9)
        np.testing.assert_allclose(after.normal, turn @ before.normal, atol=1e-9)
    for room, other in zip(model.layout.rooms, there.layout.rooms, strict=True):
        assert other.area == pytest.approx(room.area)
    for face, other_face in zip(model.faces, there.faces, strict=True):
        np.testing.assert_allclose(other_face.vertices[:, :2], face.vertices[:, :2] @ turn.T + [x, y], atol=1e-9)
        assert (other_face.vertices[:, 2] == face.vertices[:, 2]).all()
    assert there.trajectory is None
    assert there.occupancy is None


def test_merged_ids_are_unique_and_refer_to_the_same_things() -> None:
    parts = [two_rooms(), odd_models()["negative"], two_rooms()]
    whole = merged(parts)
    layout_to_json(whole.layout)
    walls = {wall.id: wall for wall in whole.layout.walls}
    assert len(walls) == sum(len(part.layout.walls) for part in parts)
    assert len({face.name for face in whole.faces}) == len(whole.faces) == sum(len(part.faces) for part in parts)
    openings = iter(whole.layout.openings)
    for part in parts:
        for opening in part.layout.openings:
            np.testing.assert_array_equal(walls[next(openings).wall].start, part.layout.wall(opening.wall).start)
    for face in whole.faces:
        if face.kind == "wall" and face.opening is None:
            ends = np.stack([walls[face.ref].start, walls[face.ref].end])
            away = np.linalg.norm(face.vertices[:, None, :2] - ends, axis=2)
            assert away.min(axis=1).max() < 1e-9


@pytest.fixture
def results(tmp_path: Path) -> tuple[Path, Path]:
    """Two small result folders."""
    for name in ("a.recon", "b.recon"):
        folder = tmp_path / name
        folder.mkdir()
        (folder / "layout.json").write_text(json.dumps(layout_to_json(two_rooms().layout)), encoding="utf-8")
        (folder / "model.json").write_text(json.dumps({"version": 1, "name": name, "notes": [], "faces": []}))
    return tmp_path / "a.recon", tmp_path / "b.recon"


def test_command_line_puts_results_into_one_building(
    results: tuple[Path, Path], tmp_path: Path, run_recon: Callable[..., Any]
) -> None:
    named = ("--storey", "Ground", "--elevation", 0, "--storey", "First", "--elevation", "3.2")
    done = run_recon("export", *results, *named, "-o", tmp_path / "house.ifc")
    assert done.status == 0, done.errors
    file = ifcopenshell.open(str(tmp_path / "house.ifc"))
    assert [floor.Name for floor in file.by_type("IfcBuildingStorey")] == ["Ground", "First"]
    placed = (*named, "--place", 0, 0, 0, "--place", 100, 0, 90)
    assert run_recon("export", *results, *placed, "-o", tmp_path / "house.geojson").status == 0
    features = json.loads((tmp_path / "house.geojson").read_text(encoding="utf-8"))["features"]
    first = next(f for f in features if f["id"] == "First/room_000")["geometry"]["coordinates"][0]
    assert first[:2] == [[100.0, 0.0], [100.0, 6.0]]
    for wrong, reason in (
        ((), "--storey"),
        (named[:6], "--elevation"),
        ((*named, "--place", 0, 0, 0), "--place"),
        ((*named[:6], "--elevation", "nan"), "nan"),
        ((*named[:4], "--storey", " ", "--elevation", 3), "--storey"),
    ):
        refused = run_recon("export", *results, *wrong, "-o", tmp_path / "no.ifc")
        assert refused.status == 2
        assert reason in " ".join(refused.errors)
    refused = run_recon("export", *results, *named, "-o", tmp_path / "no.svg")
    assert (refused.status, len(refused.errors)) == (2, 1)
    assert not list(tmp_path.glob("no.*"))


def test_results_of_one_survey_lie_in_its_frame(
    results: tuple[Path, Path], tmp_path: Path, run_recon: Callable[..., Any]
) -> None:
    for folder, x in zip(results, (100.0, 200.0), strict=True):
        metrics = {"control": {"survey_from_map": [x, 5.0, 0.0], "sigma": [0, 0, 0], "points": []}}
        (folder / "metrics.json").write_text(json.dumps(metrics))
        assert load_survey(folder) == (x, 5.0, 0.0)
    named = ("--storey", "Ground", "--elevation", 0, "--storey", "First", "--elevation", 3.2)
    assert run_recon("export", *results, *named, "-o", tmp_path / "house.geojson").status == 0
    features = json.loads((tmp_path / "house.geojson").read_text(encoding="utf-8"))["features"]
    firsts = [f["geometry"]["coordinates"][0][0] for f in features if f["id"].endswith("room_000")]
    assert firsts == [[100.0, 5.0], [200.0, 5.0]]
    (results[0] / "metrics.json").unlink()
    refused = run_recon("export", *results, *named, "-o", tmp_path / "no.ifc")
    assert (refused.status, len(refused.errors)) == (2, 1)
    assert "--place" in refused.errors[0]
    assert load_model(results[0]).trajectory is None


def test_gltf_has_a_node_a_storey(tmp_path: Path) -> None:
    model = two_rooms()
    building = stack("Haus", [Storey("1. Stock", 3.2, model), Storey("Erdgeschoß", 0.0, model)])
    for suffix in (".glb", ".gltf"):
        export_building(building, tmp_path / f"haus{suffix}")
        scene = trimesh.load_scene(tmp_path / f"haus{suffix}")
        for level, elevation in (("Erdgescho", 0.0), ("storey_1_Stock", 3.2)):
            faces = [scene.geometry[f"{level}_{face.name}"] for face in model.faces]
            assert len(faces) == len(model.faces)
            placed = [scene.graph[node] for node in scene.graph.nodes_geometry if node.startswith(level)]
            points = np.concatenate([trimesh.transform_points(scene.geometry[g].vertices, at) for at, g in placed])
            span = points[:, 1].min(), points[:, 1].max()
            np.testing.assert_allclose(span, [elevation, elevation + HEIGHT], atol=1e-6)
    content = json.loads((tmp_path / "haus.gltf").read_text())
    names = [node["name"] for node in content["nodes"]]
    assert len(set(names)) == len(names), "engines tell nodes by their names"
    levels = [n["extras"] for n in content["nodes"] if n.get("extras", {}).get("kind") == "storey"]
    storeys = {level["name"]: level["elevation"] for level in levels}
    assert storeys == {"Erdgeschoß": 0.0, "1. Stock": 3.2}
    assert all((tmp_path / unquote(image["uri"])).is_file() for image in content["images"])
    light = [a["TEXCOORD_1"] for m in content["meshes"] for a in [m["primitives"][0]["attributes"]]]
    assert len(set(light)) == len(content["meshes"])
