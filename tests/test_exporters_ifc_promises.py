"""What an IFC file promises to those who import it, stated as an IDS and checked by ifctester; and good manners."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import ifcopenshell
import ifcopenshell.util.element
import ifcopenshell.util.pset
import numpy as np
import pytest
from ifc_reading import ground, polyline, random_plan
from two_rooms import two_rooms
from walled_plans import odd_models

from recon.exporters import export
from recon.exporters.options import ExportOptions
from recon.model import Model
from recon.storeys import Storey, stack

MEASURED, SPACES, WALLS = "Recon_Measurement", "Qto_SpaceBaseQuantities", "Qto_WallBaseQuantities"
IFC4 = ExportOptions(ifc_schema="IFC4")


def promises() -> Any:
    """The Information Delivery Specification: what every wall, door, window and space carries."""
    ids = pytest.importorskip("ifctester.ids", reason="ifctester is not installed (pip install ifctester)")
    facet = pytest.importorskip("ifctester.facet")
    wanted = {
        "IFCWALL": [
            facet.Property(MEASURED, "Source", dataType="IFCLABEL"),
            facet.Property(MEASURED, "SigmaOffset", dataType="IFCLENGTHMEASURE"),
            facet.Property(MEASURED, "SigmaAngle", dataType="IFCPLANEANGLEMEASURE"),
            facet.Property(MEASURED, "ThicknessSource", dataType="IFCLABEL"),
            *(facet.Property(WALLS, name, dataType="IFCLENGTHMEASURE") for name in ("Length", "Width", "Height")),
            facet.Property(WALLS, "NetVolume", dataType="IFCVOLUMEMEASURE"),
            facet.Material(),
            facet.PartOf("IFCBUILDINGSTOREY", relation="IFCRELCONTAINEDINSPATIALSTRUCTURE"),
        ],
        "IFCDOOR": [
            facet.Attribute("OverallWidth"),
            facet.Attribute("OverallHeight"),
            facet.Attribute("OperationType"),
            facet.Property(MEASURED, "HeadSource", dataType="IFCLABEL"),
            facet.PartOf("IFCWALL", relation="IFCRELVOIDSELEMENT IFCRELFILLSELEMENT"),
            facet.PartOf("IFCBUILDINGSTOREY", relation="IFCRELCONTAINEDINSPATIALSTRUCTURE"),
        ],
        "IFCWINDOW": [
            facet.Attribute("OverallWidth"),
            facet.PartOf("IFCWALL", relation="IFCRELVOIDSELEMENT IFCRELFILLSELEMENT"),
        ],
        "IFCSPACE": [
            facet.Attribute("Name"),
            facet.Attribute("LongName"),
            facet.Property(SPACES, "NetFloorArea", dataType="IFCAREAMEASURE"),
            facet.Property(SPACES, "NetVolume", dataType="IFCVOLUMEMEASURE"),
            facet.Property(MEASURED, "CeilingSource", dataType="IFCLABEL"),
            facet.PartOf("IFCBUILDINGSTOREY", relation="IFCRELAGGREGATES"),
        ],
        "IFCBUILDINGSTOREY": [facet.Attribute("Elevation"), facet.PartOf("IFCBUILDING", relation="IFCRELAGGREGATES")],
    }
    out = ids.Ids(title="What recon promises")
    for entity, requirements in wanted.items():
        specification = ids.Specification(name=entity, ifcVersion=["IFC4"])
        specification.applicability.append(facet.Entity(entity))
        specification.requirements += requirements
        out.specifications.append(specification)
    return out


def models() -> dict[str, Model]:
    return {"two rooms": two_rooms(), "office": Model("office", random_plan(5), ())}


@pytest.fixture(params=models())
def file(request: pytest.FixtureRequest, tmp_path: Path) -> Any:
    export(models()[request.param], tmp_path / "a.ifc", IFC4)
    return ifcopenshell.open(str(tmp_path / "a.ifc"))


def test_the_delivery_specification_holds(file: Any) -> None:
    ids = promises()
    ids.validate(file)
    for specification in ids.specifications:
        assert len(specification.applicable_entities) == len(file.by_type(specification.name)) > 0 or (
            specification.name in ("IFCWINDOW", "IFCDOOR")
        )
        failed = {str(r): [str(f) for f in r.failures][:3] for r in specification.requirements if r.failures}
        assert failed == {}, specification.name


def test_standard_sets_hold_nothing_but_what_the_standard_knows(file: Any) -> None:
    templates = ifcopenshell.util.pset.get_template("IFC4")
    seen = set()
    for thing in file.by_type("IfcObject"):
        for name, values in ifcopenshell.util.element.get_psets(thing).items():
            if name.startswith(("Pset_", "Qto_")):
                template = templates.get_by_name(name)
                assert set(values) - {"id"} <= {known.Name for known in template.HasPropertyTemplates}, name
                assert name in templates.get_applicable_names(thing.is_a())
                seen.add(name)
    assert {"Qto_WallBaseQuantities", "Qto_SpaceBaseQuantities", "Qto_SlabBaseQuantities", "Pset_WallCommon"} <= seen


def test_walls_between_rooms_and_they_alone_are_said_to_be_inner(file: Any) -> None:
    for wall in file.by_type("IfcWall"):
        sets = ifcopenshell.util.element.get_psets(wall)
        rooms = {relation.RelatingSpace for relation in wall.ProvidesBoundaries}
        two_sided = sets[MEASURED]["ThicknessSource"] != "assumed"
        assert ("Pset_WallCommon" in sets) == two_sided == (len(rooms) > 1)
        assert sets.get("Pset_WallCommon", {}).get("IsExternal", False) is False


def test_types_agree_with_what_is_of_them(file: Any) -> None:
    types = file.by_type("IfcTypeProduct")
    assert {thing.is_a() for thing in types} >= {"IfcWallType", "IfcDoorType"}
    assert set(file.by_type("IfcRelDeclares")[0].RelatedDefinitions) == set(types)
    for wall in file.by_type("IfcWall"):
        kind = ifcopenshell.util.element.get_type(wall)
        (layer,) = kind.HasAssociations[0].RelatingMaterial.MaterialLayers
        usage = ifcopenshell.util.element.get_material(wall)
        width = ifcopenshell.util.element.get_psets(wall)[WALLS]["Width"]
        assert usage.ForLayerSet.MaterialLayers[0] == layer
        assert layer.LayerThickness == pytest.approx(width, abs=5.1e-4)
        assert usage.OffsetFromReferenceLine == -layer.LayerThickness / 2
        assert str(round(1000 * width)) in kind.Name
    for thing in (*file.by_type("IfcDoor"), *file.by_type("IfcWindow")):
        words = ifcopenshell.util.element.get_type(thing).Name.split()
        assert float(words[1]) == pytest.approx(thing.OverallWidth, abs=0.026)
        assert float(words[3]) == pytest.approx(thing.OverallHeight, abs=0.026)


@pytest.mark.parametrize("name", [*odd_models(), "two rooms"])
def test_curves_are_sound_and_nothing_lies_about(name: str, tmp_path: Path) -> None:
    export((odd_models() | models())[name], tmp_path / "a.ifc", IFC4)
    file = ifcopenshell.open(str(tmp_path / "a.ifc"))
    for curve in file.by_type("IfcPolyline"):
        steps = np.linalg.norm(np.diff(polyline(curve), axis=0), axis=1)
        assert (steps > 1e-6).all()
    for product in (*file.by_type("IfcWall"), *file.by_type("IfcSlab")):
        outline = ground(product)
        assert outline.is_valid
        assert outline.exterior.is_ccw
    for entity in file:
        free = any(map(entity.is_a, ("IfcRoot", "IfcStyledItem", "IfcGeometricRepresentationContext")))
        used = free or file.get_total_inverses(entity) > 0
        assert used, entity


def test_furniture_stands_as_high_as_it_is_known_to(tmp_path: Path) -> None:
    export(odd_models()["negative"], tmp_path / "a.ifc", IFC4)
    heights = {}
    file = ifcopenshell.open(str(tmp_path / "a.ifc"))  # entities do not keep it open
    for thing in file.by_type("IfcFurniture"):
        plan, solid = thing.Representation.Representations
        assert (plan.RepresentationIdentifier, plan.RepresentationType) == ("FootPrint", "Curve2D")
        source = ifcopenshell.util.element.get_psets(thing)["Recon_Measurement"]["HeightSource"]
        item = solid.Items[0]
        heights[thing.Name] = (source, item.Position.Location.Coordinates[2], item.Depth)
        assert polyline(item.SweptArea.OuterCurve).shape[1] == 2
    assert heights["object_000"] == ("image", 0.1, pytest.approx(0.6))
    assert heights["object_002"] == ("assumed", 0.0, 0.75)


def test_storeys_share_types_and_no_ids(tmp_path: Path) -> None:
    from recon.exporters import export_building

    floors = [Storey("Ground", 0.0, two_rooms()), Storey("First", 3.2, two_rooms())]
    export_building(stack("house", floors), tmp_path / "a.ifc", IFC4)
    file = ifcopenshell.open(str(tmp_path / "a.ifc"))
    ids = [root.GlobalId for root in file.by_type("IfcRoot")]
    assert len(ids) == len(set(ids))
    names = [kind.Name for kind in file.by_type("IfcTypeProduct")]
    assert len(names) == len(set(names))
    assert len(file.by_type("IfcWall")) == 2 * len({wall.Name for wall in file.by_type("IfcWall")})
    alone = Path(tmp_path / "b.ifc")
    export_building(stack("house", floors[:1]), alone, IFC4)
    assert {r.GlobalId for r in ifcopenshell.open(str(alone)).by_type("IfcProduct")} <= set(ids)
