from __future__ import annotations

import importlib.util
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from two_rooms import HEIGHT, QUADRANTS, corner, two_rooms

from recon.exporters import export
from recon.model import Layout, Model

HERE = Path(__file__).resolve().parent


@pytest.fixture(scope="session")
def validator(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with Khronos' validator installed by npm, and the script that runs it."""
    node, npm = shutil.which("node"), shutil.which("npm")
    if node is None or npm is None:
        pytest.skip("node and npm are not installed: Khronos' gltf-validator cannot run")
    folder = tmp_path_factory.mktemp("node")
    for name in ("package.json", "validate.js"):
        shutil.copy(HERE / "node" / name, folder)
    command = [npm, "install", "--no-package-lock", "--no-audit", "--no-fund", "--silent"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=300)
    if done.returncode != 0 and "CI" not in os.environ:
        pytest.skip(f"npm cannot install gltf-validator here: {done.stderr.strip()[-200:]}")
    assert done.returncode == 0, done.stderr
    return folder


def test_khronos_validator_has_nothing_to_say(validator: Path, tmp_path: Path) -> None:
    models = {"textured": two_rooms(), "bare": two_rooms(False), "empty": Model("empty", Layout((), ()), ())}
    for name, model in models.items():
        export(model, tmp_path / f"{name}.glb")
    (tmp_path / "broken.glb").write_bytes((tmp_path / "bare.glb").read_bytes().replace(b'"VEC3"', b'"VEC4"'))
    command = ["node", "validate.js", *(str(p) for p in sorted(tmp_path.glob("*.glb")))]
    output = subprocess.run(command, cwd=validator, capture_output=True, text=True, check=True, timeout=120).stdout
    reports = {Path(path).stem: report["issues"] for path, report in json.loads(output).items()}
    assert reports.pop("broken")["numErrors"] > 0
    for name, issues in reports.items():
        assert (issues["numErrors"], issues["numWarnings"]) == (0, 0), (name, issues["messages"])
        remarks = {message["code"] for message in issues["messages"]}
        # Coordinates of light maps are for whoever bakes one: no material of the file uses them.
        shown = {"textured": {"IMAGE_NPOT_DIMENSIONS", "UNUSED_OBJECT"}, "bare": {"UNUSED_OBJECT"}}
        assert remarks == shown.get(name, {"NODE_EMPTY"})
        assert {m["pointer"].rsplit("/", 1)[1][:9] for m in issues["messages"] if m["code"] == "UNUSED_OBJECT"} <= {
            "TEXCOORD_"
        }


def test_trimesh_opens_it_with_names_and_the_right_size(tmp_path: Path) -> None:
    model = two_rooms()
    export(model, tmp_path / "model.glb")
    scene = trimesh.load_scene(tmp_path / "model.glb")
    np.testing.assert_allclose(scene.bounds, np.array([[0, 0, -5], [6, HEIGHT, 0]]), atol=1e-6)
    assert set(scene.graph.nodes) >= {"Büro", "room_000", "room_001", *(f.name for f in model.faces)}
    parents = scene.graph.transforms.parents
    assert (parents["wall_003"], parents["wall_006"], parents["floor_001"]) == ("room_000", "room_001", "room_001")
    assert parents["room_000"] == "Büro"
    for face in model.faces:
        mesh = scene.geometry[face.name]
        x, y, z = face.normal
        np.testing.assert_allclose(mesh.face_normals, np.tile([x, z, -y], (len(mesh.faces), 1)), atol=1e-6)


def test_textures_lie_on_the_right_corners(tmp_path: Path) -> None:
    model = two_rooms()
    export(model, tmp_path / "model.glb")
    scene = trimesh.load_scene(tmp_path / "model.glb")
    for face in (f for f in model.faces if f.kind == "wall" and f.texture is not None):
        mesh = scene.geometry[face.name]
        colours = mesh.visual.to_color().vertex_colors
        for name, expected in QUADRANTS.items():
            x, y, z = corner(face, name)
            nearest = np.linalg.norm(mesh.vertices - [x, z, -y], axis=1).argmin()
            np.testing.assert_allclose(colours[nearest][:3], expected, atol=8)


def test_nodes_carry_what_is_known_of_walls(tmp_path: Path) -> None:
    export(two_rooms(), tmp_path / "model.glb")
    content = (tmp_path / "model.glb").read_bytes()
    document = json.loads(content[20 : 20 + int.from_bytes(content[12:16], "little")])
    extras = {node["name"]: node.get("extras", {}) for node in document["nodes"]}
    assert extras["wall_003"]["sigma_offset"] == pytest.approx(0.013)
    assert extras["wall_000"]["seen_fraction"] == 0.75
    assert extras["Büro"]["notes"] == ["The ceiling height is assumed."]


def blender() -> Path:
    """An interpreter that has Blender as a module; the test is skipped where there is none."""
    if importlib.util.find_spec("bpy") is not None:
        return Path(sys.executable)
    named = os.environ.get("RECON_BPY_PYTHON")
    candidate = Path(named) if named else HERE.parent / ".venv-bpy" / "bin" / "python"
    if not candidate.is_file():
        pytest.skip("Blender is not installed: pip install bpy and name that interpreter in RECON_BPY_PYTHON")
    return candidate


def test_blender_opens_every_mesh_format(tmp_path: Path) -> None:
    python = blender()
    model = two_rooms()
    named = ("glb", "obj", "usd", "usdz")
    paths = [tmp_path / f"model.{suffix}" for suffix in (*named, "ply", "stl")]
    for path in paths:
        export(model, path)
    command = [str(python), str(HERE / "blender_scene.py"), *map(str, paths)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    line = next((x for x in done.stdout.splitlines() if x.startswith("SCENES ")), None)
    assert line is not None, done.stderr[-2000:]
    for path, objects in json.loads(line.removeprefix("SCENES ")).items():
        low = np.min([o["low"] for o in objects.values()], axis=0)
        high = np.max([o["high"] for o in objects.values()], axis=0)
        np.testing.assert_allclose([low, high], np.array([[0, 0, 0], [6, 5, HEIGHT]]), atol=1e-5, err_msg=path)
        if Path(path).suffix[1:] in named:
            assert set(objects) == {face.name for face in model.faces}, path
            check_corners(model, objects)


def check_corners(model: Model, objects: dict[str, Any]) -> None:
    for face in (f for f in model.faces if f.kind == "wall" and f.texture is not None):
        corners = objects[face.name]["corners"]
        points = np.array([point for point, _, _ in corners])
        for name, expected in QUADRANTS.items():
            nearest = np.linalg.norm(points - corner(face, name), axis=1).argmin()
            np.testing.assert_allclose(corners[nearest][2], expected, atol=8)
