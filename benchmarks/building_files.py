"""IFC, GeoJSON, maps and room graphs: time, size, validity, and how far walls read back lie from the layout.

    python benchmarks/building_files.py [RESULT.recon ...]

Without results: the true plans of simulated offices of 50 and 200 rooms, 2,500 rooms in a grid (10,000 walls), and
10,000 walls that cross at random. The validator takes two minutes for the last.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import ifcopenshell
import ifcopenshell.util.element
import ifcopenshell.util.placement
import ifcopenshell.validate
import numpy as np
import shapely

from recon.exporters import export
from recon.layout.thickness import with_thickness
from recon.model import Layout, Model, Room, Wall
from recon.results import load_model
from recon.simulate.building import build_building
from recon.simulate.office import office_plan
from recon.simulate.truth import true_layout

SUFFIXES = (".ifc", ".geojson", ".yaml", ".rooms.json")
STEP = 0.1  # m between points of faces that are compared


def models(names: list[str]) -> Iterator[Model]:
    for name in names:
        yield load_model(Path(name))
    for rooms in () if names else (50, 200):
        layout = true_layout(build_building(office_plan(1, rooms=rooms)), np.array([-3.0, 2.0, 0.3]))
        yield Model(f"office of {rooms}", replace(layout, walls=tuple(with_thickness(layout.walls))), ())
    if not names:
        yield grid(50)
        yield crossing(10_000)


def crossing(count: int) -> Model:
    rng = np.random.default_rng(0)
    starts, angles, lengths = (
        rng.uniform(0, 200, (count, 2)),
        rng.uniform(0, 2 * np.pi, count),
        rng.uniform(0.5, 8, count),
    )
    ends = starts + lengths[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    walls = tuple(Wall(i, a, b, 0.01, 0.001, "lidar", 3) for i, (a, b) in enumerate(zip(starts, ends, strict=True)))
    return Model(f"{count} walls at random", Layout(walls, ()), ())


def grid(side: int) -> Model:
    walls: list[Wall] = []
    rooms: list[Room] = []
    for i in range(side * side):
        low = np.array([3.2 * (i // side), 4.2 * (i % side)])
        ring = low + np.array([[0, 0], [3, 0], [3, 4], [0, 4]])
        for a, b in zip(ring, np.roll(ring, -1, axis=0), strict=True):
            walls.append(Wall(len(walls), a, b, 0.01, 0.001, "lidar", 3))
        rooms.append(Room(i, f"room {i}", ring))
    return Model(f"grid of {side * side}", Layout(tuple(walls), tuple(rooms)), ())


def wall_outline(wall: Any) -> Any:
    """A wall's ground in the map, from its profile and placement."""
    body = next(r for r in wall.Representation.Representations if r.RepresentationIdentifier == "Body")
    curve = body.Items[0].SweptArea.OuterCurve
    points = np.array([[*p.Coordinates, 0.0, 1.0] for p in curve.Points])
    placed = points @ ifcopenshell.util.placement.get_local_placement(wall.ObjectPlacement).T
    return shapely.Polygon(placed[:, :2])


def check(path: Path, layout: Layout) -> str:
    file = ifcopenshell.open(str(path))
    outlines = [wall_outline(wall) for wall in file.by_type("IfcWall")]
    tree = shapely.STRtree([outline.exterior for outline in outlines])
    far = []
    for face in layout.walls:
        along = np.arange(STEP, face.length - STEP, STEP)
        points = shapely.points(face.start + along[:, None] * face.direction)
        if len(along):
            far.append(tree.query_nearest(points, return_distance=True, all_matches=False)[1])
    areas = []
    for space in file.by_type("IfcSpace"):
        room = next(r for r in layout.rooms if r.id == int(space.Name))
        sizes = ifcopenshell.util.element.get_psets(space)["Qto_SpaceBaseQuantities"]
        areas.append(abs(sizes["NetFloorArea"] / room.area - 1))
    log = ifcopenshell.validate.json_logger()
    ifcopenshell.validate.validate(str(path), log, express_rules=True)
    off, area = np.concatenate([np.zeros(1), *far]), max(areas, default=0.0)
    faces = f"{100 * (off < 1e-3).mean():.1f} % of faces within 1 mm, all within {1000 * off.max():.2f} mm"
    return f"{len(outlines)} IfcWall, {faces}, areas within {100 * area:.4f} %, {len(log.statements)} complaints"


def main() -> None:
    for model in models(sys.argv[1:]):
        print(f"{model.name}: {len(model.layout.rooms)} rooms, {len(model.layout.walls)} faces of walls")
        with tempfile.TemporaryDirectory() as folder:
            for suffix in SUFFIXES:
                path = Path(folder) / f"building{suffix}"
                start = time.process_time()
                export(model, path)
                spent = time.process_time() - start
                size = sum(p.stat().st_size for p in Path(folder).glob(f"building{suffix}")) / 1e6
                print(f"  {suffix}: {spent:.2f} s of processor time, {size:.2f} MB")
            print(f"  {check(Path(folder) / 'building.ifc', model.layout)}")


if __name__ == "__main__":
    main()
