"""Faces in tiles: the same colours everywhere, no gap, names and pictures as files want them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from open_house import open_house
from pxr import Usd, UsdGeom
from two_rooms import two_rooms

from recon.exporters import export
from recon.exporters.detail import with_detail
from recon.exporters.options import ExportOptions
from recon.faces import extrude
from recon.geometry import Array
from recon.model import Face, Layout, Model, Opening, Room, Wall
from recon.sampling import FaceColours
from recon.tiles import OVERLAP, tiled

MOST = 8 * OVERLAP
TEXEL = 0.025


def painted(face: Face, seed: int = 0) -> Face:
    """With a picture of TEXEL without any repetition: every place has a colour of its own."""
    right, up = (float(np.ptp(face.vertices @ axis)) for axis in _axes(face))
    size = max(round(right / TEXEL), 1), max(round(up / TEXEL), 1)
    rng = np.random.default_rng([seed, face.ref, len(face.name)])
    noise = rng.integers(0, 256, (size[1], size[0], 3), np.uint8)
    texture = np.asarray(cv2.GaussianBlur(noise, (0, 0), 1.0), np.uint8)
    sources = np.arange(texture[..., 0].size, dtype=np.int32).reshape(texture.shape[:2])
    return replace(face, texture=texture, sources=sources, metres_per_texel=TEXEL, seen_fraction=1.0)


def _axes(face: Face) -> Array:
    """(2, 3) unit vectors along u and v."""
    ground = np.column_stack([face.uv, np.ones(len(face.uv))])
    rows = np.linalg.lstsq(ground, face.vertices, rcond=None)[0][:2]
    return np.asarray(rows / np.linalg.norm(rows, axis=1, keepdims=True))


def hall(ground: Array, openings: tuple[Opening, ...] = ()) -> tuple[Face, ...]:
    """A room of this outline, 3 m high, all faces with pictures."""
    ends = np.roll(ground, -1, axis=0)
    walls = tuple(Wall(k, a, b, 0.01, 0.001, "lidar", 9) for k, (a, b) in enumerate(zip(ground, ends, strict=True)))
    layout = Layout(walls, (Room(0, "hall", ground),), openings, ceiling_height=3.0)
    return tuple(map(painted, extrude(layout)))


HALL = np.array([[0.0, 0.0], [14.0, 0.0], [14.0, 5.5], [9.0, 5.5], [9.0, 9.0], [0.0, 9.0]])
DOORS = (
    Opening(0, "door", 0, np.array([1.0, 0.0]), np.array([3.5, 0.0]), 0.0, 2.1, depth=0.1),
    Opening(1, "window", 0, np.array([6.0, 0.0]), np.array([13.0, 0.0]), 0.9, 2.4),
    Opening(2, "door", 2, np.array([11.5, 5.5]), np.array([10.0, 5.5]), 0.0, 2.1),
)


def whole(faces: tuple[Face, ...]) -> trimesh.Trimesh:
    """One mesh, corners equal to the last bit made one."""
    first = np.cumsum([0, *[len(face.vertices) for face in faces]])
    triangles = np.concatenate([face.triangles + n for face, n in zip(faces, first, strict=False)])
    points, index = np.unique(np.concatenate([f.vertices for f in faces]), axis=0, return_inverse=True)
    return trimesh.Trimesh(points, index.reshape(-1)[triangles], process=False)


def spots(face: Face, count: int, seed: int) -> Array:
    """Random points (n, 3) on the triangles of a face."""
    rng = np.random.default_rng(seed)
    corners = face.vertices[face.triangles]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    mine = rng.choice(len(corners), count, p=area / area.sum())
    share = rng.dirichlet([1, 1, 1], count)
    return np.asarray(np.einsum("ni,nij->nj", share, corners[mine]))


def test_tiles_show_what_the_whole_shows() -> None:
    before = {face.name: face for face in hall(HALL, DOORS)}
    after = tiled(tuple(before.values()), MOST)
    cut = [face for face in after if face.tile_of is not None]
    assert {face.tile_of for face in cut} >= {"wall_000", "floor_000", "ceiling_000"}
    for tile in cut:
        assert tile.texture is not None and tile.sources is not None and tile.tile_of is not None
        assert max(tile.texture.shape[:2]) <= MOST
        assert tile.uv.min() > -1e-4 and tile.uv.max() < 1 + 1e-4
        face, points = before[tile.tile_of], spots(tile, 300, seed=1)
        assert tile.normal == pytest.approx(face.normal, abs=1e-4)
        points = np.concatenate([points, tile.vertices])  # its corners, too: the borders between tiles
        found, truth = (FaceColours(f).at(points, TEXEL) for f in (tile, face))
        assert np.abs(found - truth).max() < 0.5, tile.name


def test_half_the_size_over_and_over_shows_no_seam() -> None:
    """Where tiles meet both have the same colour, the whole's, also in smaller pictures."""
    before = hall(HALL)
    for level in range(4):
        model = Model("hall", two_rooms().layout, before)
        small, _ = with_detail(model, ExportOptions(texture_size=None), level, pictures=False)
        assert small.faces[0].texture is not None and before[0].texture is not None
        assert small.faces[0].texture.shape[1] == before[0].texture.shape[1] // 2**level
    left, right = (f for f in tiled(before, 400) if f.tile_of == "wall_000")
    edge = np.array([v for v in left.vertices if (right.vertices == v).all(axis=1).any()])
    assert len(edge) >= 2 and np.ptp(edge[:, 2]) == 3.0, "they meet from the floor to the ceiling"
    line = edge[0] + np.linspace(0, 1, 50)[:, None] * (edge[np.argmax(edge[:, 2])] - edge[np.argmin(edge[:, 2])])
    for spacing in (TEXEL, 2 * TEXEL, 4 * TEXEL, 8 * TEXEL):
        a, b, truth = (FaceColours(face).at(line, spacing) for face in (left, right, before[0]))
        assert np.abs(a - b).max() < 1.5 and np.abs(a - truth).max() < 1.5


@settings(max_examples=20, deadline=None)
@given(st.integers(MOST, 300), st.floats(0.0, 3.0), st.booleans(), st.floats(-400.0, 400.0))
def test_what_was_watertight_stays_so(most: int, turn: float, open_ended: bool, shift: float) -> None:
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])

    def placed(points: Array) -> Array:
        return np.asarray((points @ rotation.T + shift).round(6))

    doors = tuple(replace(d, start=placed(d.start), end=placed(d.end)) for d in DOORS)
    before = hall(placed(HALL), doors[: 1 if open_ended else 3])
    assert whole(before).is_watertight
    after = tiled(before, most)
    mesh = whole(after)
    assert mesh.is_watertight and mesh.is_winding_consistent
    assert mesh.volume == pytest.approx(whole(before).volume, rel=1e-6)
    assert len({face.name for face in after}) == len(after) > len(before)


def test_faces_of_common_size_are_left_alone() -> None:
    faces = open_house().faces
    assert tiled(faces, MOST * 4) is faces
    with pytest.raises(ValueError, match="tiles of 20 texels"):
        tiled(faces, 20)


@pytest.fixture
def long_house() -> Model:
    """Wall 0 and floor 0 have pictures of 9000 texels a side."""
    model = open_house()
    large = np.zeros((40, 9000, 3), np.uint8)
    large[:, 3000:] = (250, 0, 0)
    named = ("wall_000", "floor_000")
    return replace(
        model, faces=tuple(replace(f, texture=large, sources=None) if f.name in named else f for f in model.faces)
    )


def test_large_pictures_are_several_in_files_and_a_line_says_so(long_house: Model, tmp_path: Path) -> None:
    notes = export(long_house, tmp_path / "house.glb")
    assert len(notes) == 2 and all("house.glb" in note and "3 pictures" in note for note in notes)
    scene = trimesh.load_scene(tmp_path / "house.glb")
    tiles = [f"wall_000_tile_{k:02d}" for k in range(3)]
    sizes = [scene.geometry[name].visual.material.baseColorTexture.size for name in tiles]
    assert [width for width, _ in sizes] == [3024, 3024, 3016] and {height for _, height in sizes} == {40}
    assert "wall_000" not in scene.geometry
    assert set(scene.graph.transforms.children["wall_000"]) == set(tiles), "one node a wall, its tiles below"
    assert export(long_house, tmp_path / "house.stl") == () == export(open_house(), tmp_path / "plain.glb")
    assert "8192" in export(long_house, tmp_path / "house.glb", ExportOptions(texture_size=16384))[0]
    export(long_house, tmp_path / "house.glb", ExportOptions(texture_size=512))
    small = trimesh.load_scene(tmp_path / "house.glb").geometry
    assert [small[name].visual.material.baseColorTexture.size[0] for name in tiles] == [512, 512, 512]


@pytest.mark.parametrize("suffix", [".glb", ".obj", ".usdc"])
def test_bounds_and_pictures_agree_with_the_whole(suffix: str, long_house: Model, tmp_path: Path) -> None:
    path = tmp_path / f"house{suffix}"
    export(long_house, path)
    low, high = (f([v for face in long_house.faces for v in face.vertices], axis=0) for f in (np.min, np.max))
    if suffix == ".usdc":
        stage = Usd.Stage.Open(str(path))
        box = UsdGeom.BBoxCache(Usd.TimeCode.Default(), ["default"]).ComputeWorldBound(stage.GetPseudoRoot())
        found = np.array([box.ComputeAlignedRange().GetMin(), box.ComputeAlignedRange().GetMax()])
        assert found == pytest.approx(np.array([low, high]), abs=1e-4)
        assert stage.GetPrimAtPath("/building/room_000/floor_000/floor_000_tile_02").IsA(UsdGeom.Mesh)
        assert stage.GetPrimAtPath("/building/room_000/floor_000").IsA(UsdGeom.Xform)
        return
    scene = trimesh.load_scene(path)
    assert scene.bounds == pytest.approx(np.array([[low[0], 0, -high[1]], [high[0], high[2], -low[1]]]), abs=1e-4)
    assert sum(name.startswith("wall_000_tile") for name in scene.geometry) == 3
