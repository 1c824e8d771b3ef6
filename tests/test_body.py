"""The building as a solid: closed, with the rooms that the layout says, and openings that one passes."""

from __future__ import annotations

import io
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from open_house import open_house
from walled_plans import odd_models, ring, row_of_rooms

from recon.backs import back_faces
from recon.body import SLAB, building_body
from recon.exporters.options import ExportOptions
from recon.exporters.stl import write_stl
from recon.faces import extrude
from recon.geometry import Array
from recon.model import Layout, Model, Room
from recon.raycast import RayScene
from recon.simulate import random_plan
from recon.simulate.building import build_building
from recon.simulate.truth import true_layout


def printed(layout: Layout, ceiling: bool = True) -> trimesh.Trimesh:
    """What a reader of the STL file has."""
    content = write_stl(Model("m", layout, extrude(layout)), "m", ExportOptions(ceiling=ceiling)).content
    return trimesh.load_mesh(io.BytesIO(content), file_type="stl")


@pytest.mark.parametrize("ceiling", [True, False])
@pytest.mark.parametrize("seed", range(10))
def test_simulated_buildings_are_watertight_volumes(seed: int, ceiling: bool) -> None:
    plan = random_plan(seed, rooms=3 + seed % 3, angles="any" if seed % 2 else "manhattan")
    layout = true_layout(build_building(plan), np.zeros(3))
    mesh = printed(layout, ceiling)
    assert mesh.is_watertight and mesh.is_winding_consistent and mesh.volume > 0


@given(
    st.lists(st.floats(2.0, 5.0), min_size=1, max_size=4),
    st.floats(0.05, 0.4),
    st.floats(-3.0, 3.0),
)
@settings(deadline=None, max_examples=15)
def test_its_inner_sides_are_the_faces(widths: list[float], thickness: float, yaw: float) -> None:
    layout = row_of_rooms(widths, 3.0, thickness, np.array([3.0, -2.0, yaw]))
    vertices, triangles = building_body(layout)
    body = trimesh.Trimesh(vertices, triangles, process=False)
    assert body.is_volume
    rng = np.random.default_rng(len(widths))
    rays = rng.normal(size=(400, 3))
    origin = np.array([*layout.rooms[0].polygon.mean(axis=0), 1.2])
    expected, _ = RayScene(extrude(layout)).cast(origin, rays)
    assert reach(body, origin, rays) == pytest.approx(expected * np.linalg.norm(rays, axis=1), abs=1e-3)
    rooms = sum(room.area for room in layout.rooms) * layout.extrusion_height
    assert body.volume < body.convex_hull.volume - 0.99 * rooms


def reach(mesh: trimesh.Trimesh, origin: Array, rays: Array) -> Array:
    """Distances (n,), m, by trimesh."""
    intersector = trimesh.ray.ray_triangle.RayMeshIntersector(mesh)
    unit = rays / np.linalg.norm(rays, axis=1, keepdims=True)
    points, ray, _ = intersector.intersects_location(np.broadcast_to(origin, rays.shape), unit, multiple_hits=False)
    out = np.full(len(rays), np.inf)
    out[ray] = np.linalg.norm(points - origin, axis=1)
    return out


def test_one_passes_through_open_doors_only() -> None:
    layout = row_of_rooms([3.0, 3.0], 3.0, 0.2)
    through = replace(layout, openings=tuple(replace(o, open=True) for o in layout.openings))
    way, origin = np.array([[1.0, 0.0, 0.0]]), np.array([1.5, 1.5, 1.0])
    for plan, expected in ((layout, 1.5 + 0.05), (through, 4.7)):
        vertices, triangles = building_body(plan)
        assert reach(trimesh.Trimesh(vertices, triangles), origin, way)[0] == pytest.approx(expected, abs=2e-3)
    # Seen from one side only: it still goes through the whole wall.
    one = replace(layout, openings=(replace(layout.openings[0], open=True),))
    vertices, triangles = building_body(one)
    assert reach(trimesh.Trimesh(vertices, triangles), origin, way)[0] == pytest.approx(4.7, abs=2e-3)


@pytest.mark.parametrize("name", sorted(odd_models()))
def test_odd_plans_give_closed_bodies_or_none(name: str) -> None:
    layout = odd_models()[name].layout
    mesh = printed(layout)
    nothing = not layout.rooms and not any(wall.length > 0.01 for wall in layout.walls)
    assert mesh.is_empty if nothing else mesh.is_watertight


def test_walls_that_stand_in_a_room_get_their_other_sides() -> None:
    hall = np.array([[0.0, 0.0], [8.0, 0.0], [8.0, 6.0], [0.0, 6.0]])
    walls = ring(hall)
    screen = replace(walls[0], id=4, start=np.array([3.0, 3.0]), end=np.array([5.0, 3.0]))
    layout = Layout((*walls, screen), (Room(0, "hall", hall),), ceiling_height=2.5)
    faces = extrude(layout)
    assert back_faces(replace(layout, walls=walls), faces[:4] + faces[5:], outside=False) == ()
    backs = back_faces(layout, faces, outside=False)
    assert [face.name for face in backs] == ["back_000", "back_001", "back_002"]
    assert sorted(round(float(np.ptp(face.vertices[:, 0])), 2) for face in backs) == [0.0, 0.0, 2.0]
    behind = next(face for face in backs if np.ptp(face.vertices[:, 0]) > 1)
    assert behind.normal @ [0, -1, 0] == pytest.approx(1, abs=1e-6)
    # From behind one sees the screen now, and no ray slips in between.
    hits = RayScene((*faces, *backs)).cast_front(np.array([4.0, 1.0, 1.2]), np.array([[0.0, 1.0, 0.0]]))[0]
    assert hits[0] == pytest.approx(3.0 - 0.12 - 1.0, abs=2e-3)


def test_the_outside_closes_the_whole_building() -> None:
    model = open_house()
    inside, all_round = (back_faces(model.layout, model.faces, outside) for outside in (False, True))
    assert inside == () and {face.name.split("_")[0] for face in all_round} == {"back", "roof", "underside"}
    low = np.min([face.vertices.min(axis=0) for face in all_round], axis=0)
    assert low[2] == pytest.approx(-SLAB)
    centre = np.mean([face.vertices.mean(axis=0) for face in model.faces], axis=0)
    rays = centre - np.random.default_rng(0).normal(size=(500, 3)) * 20
    scene = RayScene((*model.faces, *all_round))
    reached, owner = scene.cast_front(rays, centre - rays)
    first = np.arange(len(model.faces) + len(all_round))[owner]
    assert np.isfinite(reached).all()
    assert np.mean(first >= len(model.faces)) > 0.97  # but for what one sees through open doors
