"""Space boundaries of IFC files against the geometry of rooms and walls on random plans."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import ifcopenshell
import numpy as np
import pytest
import shapely
from ifc_reading import ground, placed, random_plan, rectangle

from recon.exporters import export
from recon.model import Model

OFF = 1e-3
"""m that a boundary may lie off."""


@pytest.fixture(params=[1, 7, 23])
def file(request: pytest.FixtureRequest, tmp_path: Path) -> Any:
    export(Model("plan", random_plan(request.param), ()), tmp_path / "a.ifc")
    return ifcopenshell.open(str(tmp_path / "a.ifc"))


def test_walls_close_every_room_once_and_on_their_faces(file: Any) -> None:
    assert file.by_type("IfcSpace")
    for space in file.by_type("IfcSpace"):
        room = ground(space)
        relations = [b for b in space.BoundedBy if b.RelatedBuildingElement.is_a("IfcWall")]
        feet = []
        for relation in relations:
            foot, low, height = rectangle(relation)
            line = shapely.LineString(placed(space, foot))
            assert low == 0.0
            assert height == pytest.approx(space.Representation.Representations[-1].Items[0].Depth)
            assert room.exterior.buffer(OFF).covers(line)
            assert ground(relation.RelatedBuildingElement).exterior.buffer(OFF).intersection(line).length > 0.0
            on_body = ground(relation.RelatedBuildingElement).buffer(OFF).intersection(line).length
            assert on_body > line.length - 0.35  # at its ends the body of a neighbour may stand
            feet.append(line)
        assert sum(foot.length for foot in feet) == pytest.approx(room.length, abs=0.02)
        assert shapely.union_all(feet).length == pytest.approx(room.length, abs=0.02)


def test_doors_lie_in_the_boundary_of_their_wall(file: Any) -> None:
    doors = [b for b in file.by_type("IfcRelSpaceBoundary1stLevel") if b.RelatedBuildingElement.is_a("IfcDoor")]
    assert doors
    for relation in doors:
        (foot, low, height), (wall, bottom, top) = rectangle(relation), rectangle(relation.ParentBoundary)
        door, filled = relation.RelatedBuildingElement, relation.ParentBoundary.RelatedBuildingElement
        assert door.FillsVoids[0].RelatingOpeningElement.VoidsElements[0].RelatingBuildingElement == filled
        assert shapely.LineString(wall).buffer(OFF).covers(shapely.LineString(foot))
        assert bottom <= low < low + height <= top
        assert np.linalg.norm(foot[1] - foot[0]) == pytest.approx(door.OverallWidth, abs=0.03)
        assert height == pytest.approx(door.OverallHeight, abs=0.02)


def test_floors_and_ceilings_are_the_rooms(file: Any) -> None:
    for space in file.by_type("IfcSpace"):
        level = [b for b in space.BoundedBy if b.RelatedBuildingElement.is_a() in ("IfcSlab", "IfcCovering")]
        assert len(level) == 2
        for relation in level:
            surface = relation.ConnectionGeometry.SurfaceOnRelatingElement
            outline = shapely.Polygon([p.Coordinates for p in surface.OuterBoundary.Points])
            assert outline.area == pytest.approx(ground(space).area, rel=1e-6)
