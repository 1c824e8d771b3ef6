"""Walls, floors and ceilings in 3D: sizes, orientation, pictures that are not mirrored."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
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
def star_polygons(draw: st.DrawFn) -> Array:
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
    assert areas(floor).sum() == pytest.approx(shoelace(polygon), rel=1e-5), "corners are rounded to micrometres"
    assert areas(ceiling).sum() == pytest.approx(shoelace(polygon), rel=1e-5)
    assert floor.normal == pytest.approx([0, 0, 1]) and ceiling.normal == pytest.approx([0, 0, -1])
    # Divergence theorem: closed, and all normals inwards, exactly when the enclosed volume comes out (negative).
    volume = 0.0
    for face in faces:
        a, b, c = (face.vertices[face.triangles[:, i]] for i in range(3))
        volume += float(np.sum(a * np.cross(b, c)) / 6)
    assert volume == pytest.approx(-shoelace(polygon) * height, rel=1e-5, abs=1e-5)


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


def opening(kind: str, bottom: float = 0.0, **more: object) -> Opening:
    """In wall 0, from x = 1 to x = 2, up to 2 m."""
    return Opening(0, kind, 0, np.array([1.0, 0.0]), np.array([2.0, 0.0]), bottom, 2.0, **more)  # type: ignore[arg-type]


@pytest.mark.parametrize(("kind", "bottom"), [("door", 0.0), ("passage", 0.0), ("passage", 0.5), ("window", 0.9)])
def test_openings_are_holes_in_their_wall(kind: str, bottom: float) -> None:
    faces = extrude(layout_of(L_SHAPE, ceiling_height=2.5, openings=(opening(kind, bottom),)))
    wall = faces[0]
    assert areas(wall).sum() == pytest.approx(6.0 * 2.5 - (2.0 - bottom))
    assert np.all(areas(wall) > 0)
    middle = Point(1.5, (bottom + 2.0) / 2)
    assert not any(Polygon(t).contains(middle) for t in wall.vertices[wall.triangles][:, :, [0, 2]])
    names = {f.name for f in faces if f.opening == 0}
    closing = {"door": {"door_000"}, "window": {"window_000"}, "passage": set()}[kind]
    foot = "threshold_000" if bottom == 0.0 else "reveal_000_sill"
    assert names == {"reveal_000_left", "reveal_000_right", "reveal_000_head", foot} | closing
    assert all(f.ref == 0 for f in faces if f.opening == 0)


def test_openings_are_clipped_and_do_not_overlap() -> None:
    wide = Opening(0, "passage", 0, np.array([-1.0, 0.0]), np.array([7.0, 0.0]), -1.0, 9.0)
    inside = Opening(1, "door", 0, np.array([2.0, 0.0]), np.array([3.0, 0.0]), 0.0, 2.0)
    tiny = Opening(2, "window", 1, np.array([6.0, 0.5]), np.array([6.0, 0.505]), 1.0, 2.0)
    faces = extrude(layout_of(L_SHAPE, ceiling_height=2.5, openings=(wide, inside, tiny)))
    assert {f.opening for f in faces} == {None, 0}, "nothing is left of wall 0 that a door could be in"
    assert areas(faces[0]).sum() == pytest.approx(2 * 0.01 * 2.5), "a centimetre at either end"
    whole = np.concatenate([f.vertices for f in faces])
    assert whole[:, 2].min() == 0.0 and whole[:, 2].max() == 2.5


def open_edges(faces: tuple[Face, ...]) -> list[tuple[Array, Array]]:
    """Edges of triangles that no other triangle has the other way round; corners are equal to the last bit or not."""
    points, index = np.unique(np.concatenate([f.vertices for f in faces]), axis=0, return_inverse=True)
    first = np.cumsum([0, *[len(f.vertices) for f in faces]])
    triangles = index.reshape(-1)[np.concatenate([f.triangles + n for f, n in zip(faces, first, strict=False)])]
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]).tolist()
    count = Counter(map(tuple, edges))
    return [(points[a], points[b]) for (a, b), n in count.items() if count[b, a] != n]


@settings(max_examples=40)
@given(star_polygons(), st.data())
def test_a_room_with_closed_openings_is_watertight(polygon: Array, data: st.DataObject) -> None:
    rounded = polygon.round(6)
    n, openings = len(rounded), []
    for k, (start, end) in enumerate(zip(rounded, np.roll(rounded, -1, axis=0), strict=True)):
        length = float(np.linalg.norm(end - start))
        if length < 0.3 or not data.draw(st.booleans()):
            continue
        a, b = sorted(data.draw(st.floats(0.0, 1.0)) for _ in range(2))
        kind = data.draw(st.sampled_from(["door", "window"]))
        bottom = 0.0 if kind == "door" else data.draw(st.sampled_from([0.0, 0.9]))
        ends = (start + a * (end - start)).round(6), (start + b * (end - start)).round(6)
        depth = data.draw(st.sampled_from([None, 0.0, 0.12]))
        top = data.draw(st.sampled_from([2.1, 2.5]))
        openings.append(Opening(k, kind, k, *ends, bottom, top, depth=depth))  # type: ignore[arg-type]
    faces = extrude(layout_of(rounded, ceiling_height=2.5, openings=tuple(openings)))
    assert open_edges(faces) == []
    assert len({f.name for f in faces}) == len(faces) >= n + 2
    for face in faces:
        assert np.all(areas(face) > 0)


def test_two_rooms_and_the_way_between_them_are_watertight() -> None:
    """A passage whose two ends were measured a little differently, and a wall that ends amid another room's side."""
    left = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]])
    right = np.array([[4.2, 0.0], [8.0, 0.0], [8.0, 4.0], [4.2, 4.0]])
    behind = np.array([[0.0, 4.0], [2.5, 4.0], [2.5, 6.0], [0.0, 6.0]])
    ends = (
        Opening(0, "passage", 1, np.array([4.0, 1.0]), np.array([4.0, 2.0]), 0.0, 2.0),
        Opening(1, "passage", 7, np.array([4.2, 2.02]), np.array([4.2, 0.97]), 0.0, 2.05),
    )
    layout = layout_of(left, right, behind, ceiling_height=2.5, openings=ends)
    assert open_edges(extrude(layout)) == []
    alone = open_edges(extrude(replace(layout, openings=ends[:1])))
    rim = np.concatenate([np.stack(edge) for edge in alone])
    assert len(alone) == 4 and np.all(rim[:, 0] == 4.1), "what nobody saw the other end of is open there, halfway or so"


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
