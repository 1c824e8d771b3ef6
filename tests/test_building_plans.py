"""Building files of random plans: walls, areas and ways between rooms against the plan that they were made from."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import ifcopenshell
import ifcopenshell.util.element
import networkx
import numpy as np
import pyogrio
import pytest
import shapely
from ifc_reading import ground
from walled_plans import box, odd_models, ring

from recon.exporters import export
from recon.layout.thickness import with_thickness
from recon.model import Layout, Model, Opening, Room
from recon.simulate.building import Building, build_building
from recon.simulate.random_building import random_plan
from recon.simulate.truth import true_layout

STEP = 0.1
"""m between points of faces that are compared."""
SEEDS = [1, 2, 3, 4]


@cache
def plan(seed: int) -> tuple[Building, Model]:
    """A random building of two to nine rooms, at any angle where the seed is even, and its true layout elsewhere."""
    building = build_building(random_plan(seed, 2 + seed % 8, "any" if seed % 2 == 0 else "manhattan"))
    layout = true_layout(building, np.array([-57.0, -11.0, 0.7]))
    return building, Model(f"plan {seed}", replace(layout, walls=tuple(with_thickness(layout.walls))), ())


@pytest.mark.parametrize("seed", SEEDS)
def test_walls_and_areas_of_ifc_are_those_of_the_layout(seed: int, tmp_path: Path) -> None:
    layout = plan(seed)[1].layout
    export(plan(seed)[1], tmp_path / "a.ifc")
    file = ifcopenshell.open(str(tmp_path / "a.ifc"))
    lines = shapely.STRtree([ground(wall).exterior for wall in file.by_type("IfcWall")])
    for face in layout.walls:
        along = np.arange(STEP, face.length - STEP, STEP)
        points = shapely.points(face.start + along[:, None] * face.direction)
        if len(along):
            assert lines.query_nearest(points, return_distance=True, all_matches=False)[1].max() < 1e-3
    rooms = {f"{room.id:03d}": room for room in layout.rooms}
    assert len(file.by_type("IfcSpace")) == len(rooms)
    for space in file.by_type("IfcSpace"):
        area = ifcopenshell.util.element.get_psets(space)["Qto_SpaceBaseQuantities"]["NetFloorArea"]
        assert area == pytest.approx(rooms[space.Name].area, rel=1e-3)
        assert ground(space).area == pytest.approx(rooms[space.Name].area, rel=1e-3)
    grounds = [ground(wall) for wall in file.by_type("IfcWall")]
    assert shapely.union_all(grounds).area == pytest.approx(sum(g.area for g in grounds), abs=2e-3)  # none twice


@pytest.mark.parametrize("seed", [1, 6])  # walls of the second form wedges
def test_nothing_is_left_standing_in_the_ways_between_rooms(seed: int, tmp_path: Path) -> None:
    building, model = plan(seed)
    sides: dict[int, list[Any]] = {}
    for niche, opening in zip(building.niches, model.layout.openings, strict=True):
        sides.setdefault(niche.opening, []).append(0.5 * (opening.start + opening.end))
    ways = [shapely.LineString(ends) for ends in sides.values() if len(ends) == 2]
    export(model, tmp_path / "a.ifc")
    file = ifcopenshell.open(str(tmp_path / "a.ifc"))
    walls = shapely.union_all([ground(wall) for wall in file.by_type("IfcWall")])
    voids = shapely.union_all([ground(void) for void in file.by_type("IfcOpeningElement")])
    assert ways
    for way in ways:
        assert walls.intersection(way).length > 0.5 * way.length
        assert walls.difference(voids).intersection(way).length < 1e-3
    filled = [relation.RelatedBuildingElement for relation in file.by_type("IfcRelFillsElement")]
    assert len(filled) == len(set(filled)) == len(file.by_type("IfcDoor")) + len(file.by_type("IfcWindow"))


@pytest.mark.parametrize("seed", SEEDS)
def test_every_way_between_rooms_is_an_edge_and_there_are_no_others(seed: int, tmp_path: Path) -> None:
    building, model = plan(seed)
    sides: dict[int, list[Any]] = {}
    for niche in building.niches:
        if niche.type != "window":
            sides.setdefault(niche.opening, []).append(niche.room)
    true = sorted(sorted(map(str, rooms if len(rooms) == 2 else [*rooms, "unknown"])) for rooms in sides.values())
    export(model, tmp_path / "a.rooms.json")
    data = json.loads((tmp_path / "a.rooms.json").read_text(encoding="utf-8"))
    graph = networkx.node_link_graph(data, edges="edges")
    assert sorted(sorted(map(str, ends)) for ends in graph.edges()) == true
    assert len(graph.edges()) > 0
    rooms = [shapely.Polygon(room.polygon) for room in model.layout.rooms]
    for first, second, edge in graph.edges(data=True):
        for end in {first, second} - {"unknown"}:
            assert rooms[end].distance(shapely.Point(edge["at"])) < 0.6


@pytest.mark.parametrize("seed", SEEDS)
def test_geojson_keeps_the_rules_and_opens_in_gdal(seed: int, tmp_path: Path) -> None:
    layout = plan(seed)[1].layout
    export(plan(seed)[1], tmp_path / "a.geojson")
    check_geojson(tmp_path / "a.geojson")
    table = pyogrio.raw.read(tmp_path / "a.geojson")
    names, columns = list(table[0]["fields"]), table[3]
    kinds = columns[names.index("kind")]
    shapes = shapely.from_wkb(table[2])
    rooms = [shape for shape, kind in zip(shapes, kinds, strict=True) if kind == "room"]
    assert [room.area for room in rooms] == pytest.approx([room.area for room in layout.rooms], rel=1e-5)
    low, high = np.min([r.bounds for r in rooms], axis=0)[:2], np.max([r.bounds for r in rooms], axis=0)[2:]
    corners = np.concatenate([room.polygon for room in layout.rooms])
    np.testing.assert_allclose([low, high], [corners.min(axis=0), corners.max(axis=0)], atol=1e-5)


@pytest.mark.parametrize("name", odd_models())
def test_odd_plans_keep_the_rules_of_geojson(name: str, tmp_path: Path) -> None:
    export(odd_models()[name], tmp_path / "a.geojson")
    check_geojson(tmp_path / "a.geojson")


def check_geojson(path: Path) -> None:
    """RFC 7946: closed rings, the outer one counter-clockwise and holes clockwise; and no crs, which it took out."""
    data = json.loads(path.read_text(encoding="utf-8"))
    assert "crs" not in data
    assert len({feature["id"] for feature in data["features"]}) == len(data["features"])
    for feature in data["features"]:
        if feature["geometry"] is None:
            assert feature["properties"].get("area", 0.0) <= 0.0  # it has no extent
            continue
        if feature["geometry"]["type"] == "LineString":
            assert len(feature["geometry"]["coordinates"]) == 2
            continue
        shape = shapely.from_geojson(json.dumps(feature["geometry"]))
        assert shape.is_valid, feature["id"]
        for part in shapely.get_parts(shape):
            assert part.exterior.is_ccw
            assert not any(hole.is_ccw for hole in part.interiors)


def test_two_doors_between_two_rooms_are_two_edges_and_none_leads_home(tmp_path: Path) -> None:
    left, right = box(0, 0, 4, 6), box(4.15, 0, 4, 6)
    pairs = []
    for n, y in enumerate((1.0, 4.0)):
        ends = np.array([4.0, y]), np.array([4.0, y + 0.9])
        back = np.array([4.15, y + 0.9]), np.array([4.15, y])
        pairs += [Opening(2 * n, "door", 1, *ends, 0.0, 2.0), Opening(2 * n + 1, "door", 7, *back, 0.0, 2.0)]
    layout = Layout(ring(left) + ring(right, 4), (Room(3, "a", left), Room(9, "b", right)), tuple(pairs))
    export(Model("m", layout, ()), tmp_path / "a.rooms.json")
    edges = json.loads((tmp_path / "a.rooms.json").read_text(encoding="utf-8"))["edges"]
    assert [(e["source"], e["target"], e["key"], e["openings"]) for e in edges] == [
        (3, 9, 0, [0, 1]),
        (3, 9, 2, [2, 3]),
    ]
