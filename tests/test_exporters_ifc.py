from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import ifcopenshell
import ifcopenshell.geom
import ifcopenshell.util.element
import ifcopenshell.validate
import numpy as np
import pytest
from two_rooms import HEIGHT, two_rooms
from walled_plans import odd_models, row_of_rooms

from recon.exporters import export
from recon.exporters.options import ExportOptions, IfcSchema
from recon.model import Model


def written(model: Model, path: Path, schema: IfcSchema = "IFC4") -> Any:
    """The model's IFC file, opened."""
    export(model, path, ExportOptions(ifc_schema=schema))
    return ifcopenshell.open(str(path))


def complaints(path: Path) -> list[str]:
    """What the validator says, with the rules of the schema."""
    log = ifcopenshell.validate.json_logger()
    ifcopenshell.validate.validate(str(path), log, express_rules=True)
    return [str(statement) for statement in log.statements]


def meshes(file: Any) -> dict[str, tuple[Any, np.ndarray, float]]:
    """By GlobalId: entity, bounds (2, 3) and volume as IfcOpenShell's geometry kernel has them, openings cut."""
    settings = ifcopenshell.geom.settings()
    settings.set("use-world-coords", True)
    iterator = ifcopenshell.geom.iterator(settings, file, 1)
    out: dict[str, tuple[Any, np.ndarray, float]] = {}
    going = iterator.initialize()
    while going:
        shape = iterator.get()
        vertices = np.array(shape.geometry.verts).reshape(-1, 3)
        corners = vertices[np.array(shape.geometry.faces, dtype=np.int64).reshape(-1, 3)]
        if len(corners):
            origin = vertices.mean(axis=0)  # products of large coordinates lose digits
            volume = np.einsum(
                "ij,ij->i", corners[:, 0] - origin, np.cross(corners[:, 1] - origin, corners[:, 2] - origin)
            )
            bounds = np.stack([vertices.min(axis=0), vertices.max(axis=0)])
            out[shape.guid] = (file.by_guid(shape.guid), bounds, float(volume.sum() / 6))
        going = iterator.next()
    return out


@pytest.mark.parametrize("schema", ["IFC4", "IFC2X3"])
def test_valid_with_the_rules_of_the_schema(schema: IfcSchema, tmp_path: Path) -> None:
    file = written(two_rooms(), tmp_path / "a.ifc", schema)
    assert file.schema == schema
    assert complaints(tmp_path / "a.ifc") == []


@pytest.mark.parametrize("name", odd_models())
def test_odd_plans_give_valid_files(name: str, tmp_path: Path) -> None:
    model = odd_models()[name]
    file = written(model, tmp_path / "a.ifc")
    log = ifcopenshell.validate.json_logger()
    ifcopenshell.validate.validate(str(tmp_path / "a.ifc"), log, express_rules=name == "negative")
    assert [str(statement) for statement in log.statements] == []
    assert len(file.by_type("IfcSpace")) == sum(
        room.area > 0.01 or room.name in ("r", "keyed") for room in model.layout.rooms
    )


def test_names_survive(tmp_path: Path) -> None:
    model = row_of_rooms([3.0, 4.0], 4.0, 0.2)
    rooms = (replace(model.rooms[0], name="Zoë 漢字 🏠 \\X2\\ ' \" <&>"), replace(model.rooms[1], name="a\nb\x00c"))
    file = written(Model("Haus Ü", replace(model, rooms=rooms), ()), tmp_path / "a.ifc")
    assert [s.LongName for s in file.by_type("IfcSpace")] == ["Zoë 漢字 🏠 \\X2\\ ' \" <&>", "a b c"]
    assert file.by_type("IfcProject")[0].Name == "Haus Ü"


@pytest.mark.parametrize("schema", ["IFC4", "IFC2X3"])
def test_rooms_walls_and_doors_measure_what_the_layout_says(schema: IfcSchema, tmp_path: Path) -> None:
    layout = row_of_rooms([3.0, 4.0, 2.5], 4.0, 0.2, np.array([-40.0, 12.0, 0.3]))
    file = written(Model("row", layout, ()), tmp_path / "a.ifc", schema)
    shapes = meshes(file)
    spaces = {e.LongName: volume for e, _, volume in shapes.values() if e.is_a("IfcSpace")}
    for room in layout.rooms:
        assert spaces[room.name] == pytest.approx(room.area * 2.5, rel=1e-3)
    for space in file.by_type("IfcSpace"):
        sets = ifcopenshell.util.element.get_psets(space)
        sizes = sets.get("Qto_SpaceBaseQuantities") or sets["BaseQuantities"]
        room = layout.rooms[int(space.Name)]
        assert sizes["NetFloorArea"] == pytest.approx(room.area, rel=1e-3)
        assert sizes["GrossPerimeter"] == pytest.approx(room.perimeter, rel=1e-3)
        assert sets["Recon_Measurement"]["SigmaCeiling"] == pytest.approx(0.01)
    walls = [(e, volume) for e, _, volume in shapes.values() if e.is_a("IfcWall")]
    assert len(walls) == len(file.by_type("IfcWall")) == 12 - 2  # two pairs of faces are two walls
    for wall, volume in walls:
        sets = ifcopenshell.util.element.get_psets(wall)
        sizes = sets.get("Qto_WallBaseQuantities") or sets["BaseQuantities"]
        assert volume == pytest.approx(sizes["NetVolume"], rel=1e-4)
        known = sets["Recon_Measurement"]
        assert known["SigmaOffset"] == pytest.approx(0.004)
        two_faced = len(known["Faces"].split()) == 2
        assert known["ThicknessSource"] == ("measured" if two_faced else "assumed")
        assert known["Observations"] == (18 if two_faced else 9)
        if two_faced:
            assert volume == pytest.approx(0.2 * (sizes["GrossFootprintArea"] / 0.2 * 2.5 - 0.82 * 2.1), rel=1e-3)


def test_openings_lie_strictly_inside_their_walls(tmp_path: Path) -> None:
    model = two_rooms()
    file = written(model, tmp_path / "a.ifc")
    assert len(file.by_type("IfcOpeningElement")) == 3  # the passage is seen from both rooms
    assert len(file.by_type("IfcDoor")) == len(file.by_type("IfcWindow")) == 1
    settings = ifcopenshell.geom.settings()
    settings.set("disable-opening-subtractions", True)
    for void in file.by_type("IfcRelVoidsElement"):
        wall, hole = (
            np.array(ifcopenshell.geom.create_shape(settings, e).geometry.verts).reshape(-1, 3)
            for e in (void.RelatingBuildingElement, void.RelatedOpeningElement)
        )
        x, z = void.RelatedOpeningElement.ObjectPlacement.RelativePlacement.Location.Coordinates[::2]
        assert wall[:, 0].min() + 0.005 < x + hole[:, 0].min()
        assert x + hole[:, 0].max() < wall[:, 0].max() - 0.005
        assert -1e-9 <= z + hole[:, 2].min() < z + hole[:, 2].max() < HEIGHT - 0.005
        assert hole[:, 1].min() < wall[:, 1].min() < wall[:, 1].max() < hole[:, 1].max()
    window = file.by_type("IfcWindow")[0]
    assert (window.OverallWidth, window.OverallHeight) == pytest.approx((1.5, 1.1))


def test_slab_ceilings_and_boundaries_cover_the_rooms(tmp_path: Path) -> None:
    model = two_rooms()
    file = written(model, tmp_path / "a.ifc")
    shapes = meshes(file)
    (slab,) = [shape for shape in shapes.values() if shape[0].is_a("IfcSlab")]
    assert slab[1][:, 2].tolist() == pytest.approx([-0.2, 0.0])
    ceilings = [shape for shape in shapes.values() if shape[0].is_a("IfcCovering")]
    assert sorted(volume for _, _, volume in ceilings) == pytest.approx(
        sorted(0.02 * r.area for r in model.layout.rooms)
    )
    assert all(bounds[0, 2] == pytest.approx(HEIGHT) for _, bounds, _ in ceilings)
    around = dict.fromkeys(file.by_type("IfcSpace"), 0.0)
    for relation in file.by_type("IfcRelSpaceBoundary"):
        if relation.RelatedBuildingElement.is_a("IfcWall"):
            surface = relation.ConnectionGeometry.SurfaceOnRelatingElement
            a, b = (np.array(p.Coordinates) for p in surface.SweptCurve.Curve.Points)
            around[relation.RelatingSpace] += float(np.linalg.norm(b - a))
    assert list(around.values()) == pytest.approx([room.perimeter for room in model.layout.rooms])


def test_same_model_same_ids_in_both_schemas_and_no_time(tmp_path: Path) -> None:
    first, second = written(two_rooms(), tmp_path / "a.ifc"), written(two_rooms(), tmp_path / "b.ifc", "IFC2X3")
    ids = [e.GlobalId for e in first.by_type("IfcRoot")]
    assert len(set(ids)) == len(ids)
    assert {s.GlobalId for s in first.by_type("IfcSpace")} == {s.GlobalId for s in second.by_type("IfcSpace")}
    assert "1970-01-01T00:00:00" in (tmp_path / "a.ifc").read_text().splitlines()[3]
