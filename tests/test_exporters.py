from __future__ import annotations

import copy
import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from two_rooms import HEIGHT, QUADRANTS, corner, two_rooms

from recon.errors import OutputError
from recon.exporters import SUFFIXES, WRITERS, check_outputs, export, writer_for
from recon.exporters.options import ExportOptions
from recon.exporters.ply import cut_by_grid, grid_step
from recon.layout_json import layout_from_json, layout_to_json
from recon.model import Layout, Model

BOUNDS = np.array([[0, 0, 0], [6, 5, HEIGHT]])


def state(model: Model) -> bytes:
    """Everything in a model, to see whether it changed."""
    parts = [json.dumps(layout_to_json(model.layout), sort_keys=True).encode(), repr(model.notes).encode()]
    for face in model.faces:
        parts += [face.vertices.tobytes(), face.triangles.tobytes(), face.uv.tobytes()]
        parts.append(b"" if face.texture is None else face.texture.tobytes())
    return b"".join(parts)


def files_in(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_same_model_same_bytes_and_untouched(suffix: str, tmp_path: Path) -> None:
    model = two_rooms()
    before = state(copy.deepcopy(model))
    for name in ("first", "second"):
        (tmp_path / name).mkdir()
        export(model, tmp_path / name / f"model{suffix}")
    first, second = files_in(tmp_path / "first"), files_in(tmp_path / "second")
    assert f"model{suffix}" in first
    assert first == second
    assert state(model) == before
    assert not [name for name in first if Path(name).name.startswith(".")]  # no temporary file left


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_exports_what_has_no_texture_or_nothing_at_all(suffix: str, tmp_path: Path) -> None:
    export(two_rooms(textured=False), tmp_path / f"bare{suffix}")
    assert not (tmp_path / "bare.textures").exists()
    export(Model("empty", Layout((), ()), ()), tmp_path / f"empty{suffix}")
    assert (tmp_path / f"empty{suffix}").stat().st_size > 0


def test_replaces_an_older_file_and_takes_any_case(tmp_path: Path) -> None:
    path = tmp_path / "Modell Ä.GLB"
    path.write_bytes(b"old")
    export(two_rooms(), path)
    assert path.read_bytes()[:4] == b"glTF"


def test_a_failed_export_leaves_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "model.obj"
    path.write_text("old")
    (tmp_path / "model.textures").write_text("in the way")
    with pytest.raises(OutputError, match=r"model\.obj"):
        export(two_rooms(), path)
    assert path.read_text() == "old"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["model.obj", "model.textures"]


def test_every_suffix_has_its_writer() -> None:
    assert set(SUFFIXES) >= {".usd", ".usda", ".usdc", ".usdz", ".glb", ".obj", ".ply", ".stl", ".dxf", ".svg", ".json"}
    for suffix in WRITERS:
        assert callable(writer_for(Path(f"model{suffix}")))


@pytest.mark.parametrize("name", ["model.xyz", "model", "model.usd.gz"])
def test_unknown_suffix_lists_the_known(name: str, tmp_path: Path) -> None:
    with pytest.raises(OutputError) as before:
        check_outputs([tmp_path / name])
    with pytest.raises(OutputError) as later:
        export(two_rooms(), tmp_path / name)
    for error in (before, later):
        assert all(text in str(error.value) for text in (name, *SUFFIXES))
    assert not list(tmp_path.iterdir())


def test_outputs_are_checked_before_work(tmp_path: Path) -> None:
    check_outputs([tmp_path / "model.usd", tmp_path / "model.obj"])
    (tmp_path / "folder.glb").mkdir()
    (tmp_path / "taken.textures").write_text("a file")
    refused = {
        "missing/model.usd": "does not exist",
        "folder.glb": "is a folder",
        "taken.usdc": "texture",
    }
    for name, reason in refused.items():
        with pytest.raises(OutputError, match=reason):
            check_outputs([tmp_path / "good.glb", tmp_path / name])
    with pytest.raises(OutputError, match="twice"):
        check_outputs([tmp_path / "model.glb", tmp_path / "folder.glb" / ".." / "model.glb"])
    assert {p.name for p in tmp_path.iterdir()} == {"folder.glb", "taken.textures"}


def test_a_folder_that_cannot_be_written_is_refused() -> None:
    if not Path("/proc/self").is_dir():
        pytest.skip("needs /proc, a folder in which nobody can make a file")
    with pytest.raises(OutputError, match="not writable"):
        check_outputs([Path("/proc/self/model.glb")])


def test_json_is_the_layout(tmp_path: Path) -> None:
    model = two_rooms()
    export(model, tmp_path / "layout.json")
    data = json.loads((tmp_path / "layout.json").read_text(encoding="utf-8"))
    assert layout_to_json(layout_from_json(data, "layout.json")) == layout_to_json(model.layout)
    assert data["notes"] == list(model.notes)
    assert [room["name"] for room in data["rooms"]] == ["Büro 1", "Küche & Flur <2>"]


def test_stl_is_a_closed_solid_around_the_rooms(tmp_path: Path) -> None:
    model = two_rooms()
    export(model, tmp_path / "model.stl")
    export(model, tmp_path / "open.stl", ExportOptions(ceiling=False))
    closed, above = (trimesh.load_mesh(tmp_path / name) for name in ("model.stl", "open.stl"))
    rooms = HEIGHT * (18 + 3.8 * 2.8)
    for mesh, cavities in ((closed, rooms), (above, 0.0)):
        assert mesh.is_volume
        # Walls, floor and ceiling add at least their thickness all round, on the outside.
        assert (mesh.bounds[0] <= np.array(BOUNDS)[0] - 0.09).all()
        assert 2.0 < mesh.volume < 40.0
        inside = trimesh.ray.ray_triangle.RayMeshIntersector(mesh)
        at = np.array([[1.0, 1.0, 1.0]])
        hit, _, _ = inside.intersects_location(at, np.array([[0.0, 0.0, 1.0]]), multiple_hits=False)
        assert (len(hit) == 1 and hit[0, 2] == pytest.approx(HEIGHT, abs=1e-3)) if cavities else len(hit) == 0


def test_obj_opens_with_names_textures_and_y_up(tmp_path: Path) -> None:
    model = two_rooms()
    export(model, tmp_path / "model.obj")
    scene = trimesh.load_scene(tmp_path / "model.obj", split_objects=True, group_material=False)
    np.testing.assert_allclose(scene.bounds, np.array([[0, 0, -5], [6, HEIGHT, 0]]), atol=1e-5)
    assert set(scene.geometry) == {face.name for face in model.faces}
    for face in (f for f in model.faces if f.texture is not None):
        mesh = scene.geometry[face.name]
        colours = mesh.visual.to_color().vertex_colors
        for name, expected in QUADRANTS.items():
            x, y, z = corner(face, name)
            nearest = np.linalg.norm(mesh.vertices - [x, z, -y], axis=1).argmin()
            if face.kind == "wall":
                np.testing.assert_allclose(colours[nearest][:3], expected, atol=8)


def test_obj_names_files_that_are_there(tmp_path: Path) -> None:
    export(two_rooms(), tmp_path / "haus.obj")
    lines = (tmp_path / "haus.mtl").read_text().splitlines()
    pictures = [line.split(maxsplit=1)[1] for line in lines if line.startswith("map_Kd")]
    assert pictures == ["haus.textures/page_00.jpg"]
    assert all((tmp_path / picture).is_file() for picture in pictures)
    assert "newmtl neutral_wall" in lines


def test_ply_shows_the_textures_as_vertex_colours(tmp_path: Path) -> None:
    model = two_rooms()
    export(model, tmp_path / "model.ply")
    mesh = trimesh.load_mesh(tmp_path / "model.ply", process=False)
    np.testing.assert_allclose(mesh.bounds, BOUNDS, atol=1e-6)
    wall = next(f for f in model.faces if f.name == "wall_000")
    for name, expected in QUADRANTS.items():
        centre = wall.vertices.mean(axis=0)
        target = centre + 0.6 * (corner(wall, name) - centre)
        nearest = np.linalg.norm(mesh.vertices - target, axis=1).argmin()
        np.testing.assert_allclose(mesh.visual.vertex_colors[nearest][:3], expected, atol=1)


def test_ply_grid_covers_each_face_once(tmp_path: Path) -> None:
    model = two_rooms()
    step = grid_step(model)
    for face in model.faces:
        points, triangles = cut_by_grid(face, step)
        a, b, c = np.moveaxis(points[triangles], 1, 0)
        normals = np.cross(b - a, c - a) / 2
        whole = face.vertices[face.triangles]
        area = np.linalg.norm(np.cross(whole[:, 1] - whole[:, 0], whole[:, 2] - whole[:, 0]), axis=1).sum() / 2
        assert (normals @ face.normal).min() > 0
        assert (normals @ face.normal).sum() == pytest.approx(area, rel=1e-5)
        assert np.linalg.norm(b - a, axis=1).max() <= step * np.sqrt(2) + 1e-6
        assert np.abs((points - face.vertices[0]) @ face.normal).max() < 1e-6


def test_ply_of_a_large_building_stays_bounded() -> None:
    model = two_rooms()
    grown = [dataclasses.replace(f, vertices=f.vertices * 100) for f in model.faces]
    step = grid_step(dataclasses.replace(model, faces=tuple(grown)))
    textured = [f for f in grown if f.texture is not None]
    area = sum(
        np.linalg.norm(np.cross(*(f.vertices[t[1:]] - f.vertices[t[0]]))) / 2 for f in textured for t in f.triangles
    )
    assert 0.5e6 < area / step**2 <= 1.000001e6
