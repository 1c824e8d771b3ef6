"""Walls, floors and ceilings in 3D: sizes, orientation, pictures that are not mirrored."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from shapely.geometry import Point, Polygon

from recon.faces import extrude, triangulate
from recon.geometry import Array
from recon.model import Face, Layout, Opening, Room, Wall

L_SHAPE = np.array([[0.0, 0.0], [6.0, 0.0], [6.0, 2.0], [2.0, 2.0], [2.0, 5.0], [0.0, 5.0]])


def layout_of(*polygons: Array, **options: object) -> Layout:
    """Rooms with a wall on every edge."""
    walls: list[Wall] = []
    for polygon in polygons:
        for start, end in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
            walls.append(Wall(len(walls), start, end, 0.01, 0.001, "lidar", 1))
    rooms = tuple(Room(i, f"room {i}", polygon) for i, polygon in enumerate(polygons))
    return Layout(tuple(walls), rooms, **options)  # type: ignore[arg-type]


def areas(face: Face) -> Array:
    """Signed by the face's own normal, (T,) m2."""
    a, b, c = (face.vertices[face.triangles[:, i]] for i in range(3))
    return np.asarray(np.cross(b - a, c - a) @ face.normal / 2)


def shoelace(polygon: Array) -> float:
    x, y = polygon.T
    return float(0.5 * np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))


@st.composite
def star_polygons(draw: st.DrawFnT) -> Array:  # type: ignore[name-defined]
    """Simple, counter-clockwise polygons with dents, somewhere and turned somehow."""
    n = draw(st.integers(3, 24))
    radii = np.array(draw(st.lists(st.floats(0.4, 5.0), min_size=n, max_size=n)))
    turn = draw(st.floats(0, 6.3))
    angles = turn + 2 * np.pi * np.arange(n) / n
    centre = np.array([draw(st.floats(-20, 20)), draw(st.floats(-20, 20))])
    return np.asarray(centre + radii[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1))


@given(star_polygons(), st.floats(2.0, 6.0))
def test_any_simple_room_closes(polygon: Array, height: float) -> None:
    faces = extrude(layout_of(polygon, ceiling_height=height))
    n = len(polygon)
    assert [f.kind for f in faces] == ["wall"] * n + ["floor", "ceiling"]
    for face in faces:
        assert np.all(areas(face) > 0), "all triangles turn the same way"
    floor, ceiling = faces[n], faces[n + 1]
    assert areas(floor).sum() == pytest.approx(shoelace(polygon), rel=1e-9)
    assert areas(ceiling).sum() == pytest.approx(shoelace(polygon), rel=1e-9)
    assert floor.normal == pytest.approx([0, 0, 1]) and ceiling.normal == pytest.approx([0, 0, -1])
    # Divergence theorem: closed, and all normals inwards, exactly when the enclosed volume comes out (negative).
    volume = 0.0
    for face in faces:
        a, b, c = (face.vertices[face.triangles[:, i]] for i in range(3))
        volume += float(np.sum(a * np.cross(b, c)) / 6)
    assert volume == pytest.approx(-shoelace(polygon) * height, rel=1e-6, abs=1e-6)


@given(star_polygons())
def test_pictures_are_metric_and_not_mirrored(polygon: Array) -> None:
    for face in extrude(layout_of(polygon, ceiling_height=2.5)):
        homogeneous = np.column_stack([face.uv, np.ones(len(face.uv))])
        plane, *_ = np.linalg.lstsq(homogeneous, face.vertices, rcond=None)
        assert homogeneous @ plane == pytest.approx(face.vertices, abs=1e-6), "uv is affine in space"
        right, up = plane[0], plane[1]
        assert abs(right @ up) < 1e-6 * np.linalg.norm(right) * np.linalg.norm(up)
        turned = np.cross(right, up)
        assert turned / np.linalg.norm(turned) == pytest.approx(face.normal, abs=1e-6), (
            "right x up is out of the picture"
        )
        assert face.uv.min(axis=0) == pytest.approx([0, 0], abs=1e-9)
        assert face.uv.max(axis=0) == pytest.approx([1, 1], abs=1e-9)


def test_wall_as_seen_from_inside() -> None:
    wall = extrude(layout_of(L_SHAPE, ceiling_height=2.5))[0]
    # Wall 0 runs along y = 0 in +x, free space at y > 0: who faces it looks in -y and has larger x on the left.
    assert wall.name == "wall_000"
    corners = {tuple(uv): tuple(v) for uv, v in zip(wall.uv, wall.vertices, strict=True)}
    assert corners == {(0, 0): (6, 0, 0), (1, 0): (0, 0, 0), (1, 1): (0, 0, 2.5), (0, 1): (6, 0, 2.5)}
    assert wall.normal == pytest.approx([0, 1, 0])


def test_passages_are_holes_and_doors_are_not() -> None:
    def opening(kind: str, bottom: float) -> Opening:
        return Opening(0, kind, 0, np.array([1.0, 0.0]), np.array([2.0, 0.0]), bottom, 2.0)  # type: ignore[arg-type]

    full = 6.0 * 2.5
    for kind, bottom, area in (("door", 0.0, full), ("passage", 0.0, full - 2.0), ("passage", 0.5, full - 1.5)):
        layout = layout_of(L_SHAPE, ceiling_height=2.5, openings=(opening(kind, bottom),))
        face = extrude(layout)[0]
        assert areas(face).sum() == pytest.approx(area)
        assert np.all(areas(face) > 0)
        middle = Point(1.5, (bottom + 2.0) / 2)
        assert any(Polygon(t).contains(middle) for t in face.vertices[face.triangles][:, :, [0, 2]]) == (kind == "door")


def test_heights() -> None:
    square = L_SHAPE[[0, 1, 2]] + [0, 10]
    layout = layout_of(L_SHAPE, square)
    low = Room(1, "low", square, ceiling_height=2.1)
    faces = {f.name: f for f in extrude(Layout(layout.walls, (layout.rooms[0], low)))}
    assert faces["ceiling_000"].vertices[:, 2] == pytest.approx(2.6), "no height measured: the default"
    assert faces["ceiling_001"].vertices[:, 2] == pytest.approx(2.1)
    assert faces["wall_000"].vertices[:, 2].max() == pytest.approx(2.6)
    assert faces["wall_007"].vertices[:, 2].max() == pytest.approx(2.1)


def test_nothing_gives_nothing_and_degenerate_walls_no_face() -> None:
    point = np.array([1.0, 1.0])
    assert extrude(Layout((), ())) == ()
    assert extrude(Layout((Wall(0, point, point, 0.0, 0.0, "lidar", 1),), ())) == ()


def test_polygons_with_holes_like_slivers_are_triangulated() -> None:
    """Unions of wall bodies leave holes of no width, on which GEOS' triangulation gives up."""
    from shapely.geometry import Polygon

    shell = [(0, 0), (4, 0), (4, 3), (0, 3)]
    sliver = [(1.0, 1.0), (2.0145, 1.9691), (2.025, 1.9793), (2.025, 1.979300000001), (1.0, 1.0)]
    vertices, triangles = triangulate(Polygon(shell, [sliver]))
    a, b, c = (vertices[triangles[:, i]] for i in range(3))
    area = 0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    assert np.all(area > 0)
    assert area.sum() == pytest.approx(12.0, abs=1e-3)
