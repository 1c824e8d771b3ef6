"""`recon check`: real programs open what is written, and say what is broken."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from open_house import open_house

from recon.clients import check_file, programs
from recon.clients.check import CLIENTS
from recon.clients.finding import Broken, Missing
from recon.cloud import PointCloud
from recon.exporters import MESHES, export
from recon.exporters.options import ExportOptions

ALSO = {".dxf", ".svg", ".json", ".ifc", ".pdf", ".png", ".yaml", ".geojson", ".rooms.json"}


@pytest.fixture
def only_libraries(monkeypatch: pytest.MonkeyPatch, tmp_path_factory: pytest.TempPathFactory) -> None:
    """As on a machine where no further program is installed."""
    monkeypatch.setenv("PATH", str(tmp_path_factory.mktemp("bin")))
    monkeypatch.delenv("RECON_BPY_PYTHON", raising=False)


@pytest.fixture
def blender_python() -> str:
    here = Path(__file__).parent.parent / ".venv-bpy" / "bin" / "python"
    if "RECON_BPY_PYTHON" not in os.environ and here.is_file():
        os.environ["RECON_BPY_PYTHON"] = str(here)
    try:
        return programs.blender_python()
    except Missing as reason:
        pytest.skip(str(reason))


@pytest.mark.parametrize("suffix", sorted(MESHES | ALSO))
def test_what_is_written_passes(suffix: str, only_libraries: None, tmp_path: Path) -> None:
    path = tmp_path / f"house{suffix}"
    export(open_house(), path)
    findings = {finding.client: finding for finding in check_file(path)}
    assert {f.state for f in findings.values()} <= {"ok", "not run"}
    assert any(f.state == "ok" for f in findings.values()), "a library of ours opens every format"
    for name in ("assimp", "Godot", "Khronos", "Blender"):
        if name in findings:
            assert findings[name].state == "not run" and "install" in findings[name].text
    if "trimesh" in findings:
        triangles = sum(len(face.triangles) for face in open_house().faces)
        other = suffix in (".ply", ".stl")  # cut for its colours; a solid
        assert other or f"{triangles} triangles" in findings["trimesh"].text


@pytest.mark.parametrize(
    "suffix", [".glb", ".gltf", ".ply", ".stl", ".usda", ".usdz", *sorted(ALSO - {".ifc", ".yaml"})]
)
def test_what_is_cut_short_is_broken(suffix: str, only_libraries: None, tmp_path: Path) -> None:
    path = tmp_path / f"house{suffix}"
    export(open_house(), path)
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2])
    assert "broken" in {finding.state for finding in check_file(path)}


@pytest.mark.parametrize(("suffix", "client"), [(".usda", "OpenUSD"), (".obj", "files")])
def test_files_that_a_file_names_are_looked_for(suffix: str, client: str, only_libraries: None, tmp_path: Path) -> None:
    export(open_house(), tmp_path / f"house{suffix}")
    picture = next((tmp_path / "house.textures").iterdir())
    picture.unlink()
    (finding,) = [f for f in check_file(tmp_path / f"house{suffix}") if f.client == client]
    assert finding.state == "broken" and picture.name in finding.text


def test_command(run_recon: Callable[..., Any], only_libraries: None, tmp_path: Path) -> None:
    good, broken = tmp_path / "good.stl", tmp_path / "broken.stl"
    export(open_house(), good)
    broken.write_bytes(good.read_bytes()[:200])
    done = run_recon("check", good)
    assert done.status == 0 and done.errors == []
    assert any(line.startswith("good.stl: trimesh: ok: ") for line in done.output)
    done = run_recon("check", good, broken)
    assert done.status == 2 and "broken.stl" in done.errors[0]
    assert set(CLIENTS) >= MESHES


def test_every_file_has_its_line(run_recon: Callable[..., Any], only_libraries: None, tmp_path: Path) -> None:
    unknown, missing, good = tmp_path / "what.xyz", tmp_path / "nothing.glb", tmp_path / "plan.pdf"
    unknown.write_text("?")
    export(open_house(), good)
    done = run_recon("check", unknown, good)
    assert done.status == 0, "what nothing opens is not wrong"
    assert done.output[0] == "what.xyz: any: not run: nothing here opens .xyz"
    assert done.output[1].startswith("plan.pdf: PDFium: ok: 1 pages, the first ")
    done = run_recon("check", missing, tmp_path, unknown, good)
    assert done.status == 2 and "no such file" in done.errors[0] and "2 of the checks" in done.errors[0]
    assert [line.split(": ")[2] for line in done.output] == ["broken", "broken", "not run", "ok"]


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("map.yaml", "resolution:", "scale:"),
        ("map.yaml", "resolution: 0", "resolution: -0"),
        ("map.yaml", "map.pgm", "other.pgm"),
        ("house.geojson", '"Polygon"', '"Polygone"'),
        ("house.rooms.json", '"target": ', '"target": 9'),
    ],
)
def test_wrong_values_are_broken(name: str, old: str, new: str, tmp_path: Path) -> None:
    path = tmp_path / name
    export(open_house(), path)
    (finding,) = check_file(path)
    assert finding.state == "ok", finding.text
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    (finding,) = check_file(path)
    assert finding.state == "broken"


def test_blender_has_the_same_from_usd_and_gltf(blender_python: str, tmp_path: Path) -> None:
    model = open_house()
    pictures = sum(face.texture is not None for face in model.faces)
    materials = pictures + len({face.kind for face in model.faces if face.texture is None})
    said = {}
    for name in ("house.glb", "house.usd", "house.usdz", "house.gltf"):
        export(model, tmp_path / name)
        said[name] = programs.blender(tmp_path / name)
    export(model, tmp_path / "phone.usdz", ExportOptions(usd_profile="arkit"))
    said["phone.usdz"] = programs.blender(tmp_path / "phone.usdz")
    expected = f"{len(model.faces)} meshes, {materials} materials, {pictures} images"
    assert {text.rsplit(", ", 1)[0] for text in said.values()} == {expected}, said
    assert {text.rsplit(", ", 1)[1] for text in said.values()} == {"6.05 x 5.05 x 2.50 m"}, said


@pytest.mark.parametrize(("engine", "shapes"), [("godot", True), ("unity", False)])
def test_godot_finds_collision_shapes(engine: str, shapes: bool, tmp_path: Path) -> None:
    model = open_house()
    export(model, tmp_path / "house.glb", ExportOptions(engine=engine))  # type: ignore[arg-type]
    try:
        said = programs.godot(tmp_path / "house.glb")
    except Missing as reason:
        pytest.skip(str(reason))
    faces = len(model.faces)
    assert said == f"{faces} meshes, {faces if shapes else 0} collision shapes"


def test_points_are_no_mesh(tmp_path: Path) -> None:
    cloud = PointCloud(np.eye(3, dtype=np.float32), np.zeros((3, 3), np.uint8))
    export(replace(open_house(), cloud=cloud), tmp_path / "house.cloud.ply")
    (tmp_path / "cloud.ply").write_bytes((tmp_path / "house.cloud.ply").read_bytes())
    for name in ("house.cloud.ply", "cloud.ply"):
        findings = {f.client: f for f in check_file(tmp_path / name) if f.client in ("trimesh", "assimp")}
        assert (findings["trimesh"].state, findings["assimp"].state) == ("ok", "not run")
        assert "3 points" in findings["trimesh"].text


def test_assimp_reads_every_mesh_format(tmp_path: Path) -> None:
    model = open_house()
    for name in ("house.glb", "house.gltf", "house.obj", "house.ply", "house.stl"):
        export(model, tmp_path / name)
        try:
            said = programs.assimp(tmp_path / name)
        except Missing as reason:
            pytest.skip(str(reason))
        meshes = 1 if name.endswith(("ply", "stl")) else len(model.faces)
        assert said.startswith(f"{meshes} meshes"), (name, said)
    (tmp_path / "house.glb").write_bytes(b"glTF")
    with pytest.raises(Broken):
        programs.assimp(tmp_path / "house.glb")


@pytest.mark.parametrize(("suffix", "simulator"), [(".urdf", "MuJoCo"), (".urdf", "Bullet"), (".sdf", "Bullet")])
def test_robots_run_into_what_one_sees(suffix: str, simulator: str, tmp_path: Path) -> None:
    module = {"MuJoCo": "mujoco", "Bullet": "pybullet"}[simulator]
    pytest.importorskip(module, reason=f"{module} is not installed")
    path = tmp_path / f"house{suffix}"
    export(open_house(), path)
    (finding,) = [f for f in check_file(path) if f.client == simulator]
    assert finding.state == "ok", finding.text
    assert (suffix == ".urdf") == ("a ball rests" in finding.text)
    # Walls that are not where one sees them are found out.
    text = path.read_text()
    path.write_text(text.replace('<origin xyz="', '<origin xyz="1').replace("<pose>", "<pose>1"))
    (finding,) = [f for f in check_file(path) if f.client == simulator]
    assert finding.state == "broken"


def test_nvidia_passes_both_profiles_and_finds_faults(tmp_path: Path) -> None:
    pytest.importorskip("omni.asset_validator", reason="omniverse-asset-validator is not installed")
    for profile, name in (("simready", "house.usda"), ("arkit", "house.usdz")):
        options = ExportOptions(usd_profile=profile)  # type: ignore[arg-type]
        export(open_house(), tmp_path / name, options)
        (finding,) = [f for f in check_file(tmp_path / name) if f.client == "NVIDIA"]
        assert finding.state == "ok", finding.text
    text = (tmp_path / "house.usda").read_text()
    (tmp_path / "house.usda").write_text(text.replace('defaultPrim = "building"', ""))
    (finding,) = [f for f in check_file(tmp_path / "house.usda") if f.client == "NVIDIA"]
    assert finding.state == "broken"
