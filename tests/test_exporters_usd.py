from __future__ import annotations

import io
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from pxr import Kind, Usd, UsdGeom, UsdShade, UsdUtils, UsdValidation
from two_rooms import HEIGHT, QUADRANTS, corner, two_rooms

from recon.exporters import export, export_building
from recon.exporters.options import ExportOptions, UsdProfile
from recon.model import Face
from recon.storeys import Storey, stack

SUFFIXES = (".usd", ".usda", ".usdc", ".usdz")


def complaints(path: Path) -> list[str]:
    """What all of OpenUSD's validators say about a file."""
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    assert len(validators) >= 20
    errors = UsdValidation.ValidationContext(validators).Validate(Usd.Stage.Open(str(path)))
    return [f"{error.GetName()}: {error.GetMessage()}" for error in errors]


def room_of(face: Face) -> str:
    """Of `two_rooms`: walls 0 to 5 are those of the first room."""
    first = face.ref == 0 if face.kind in ("floor", "ceiling") else face.ref < 6
    return "room_000" if first else "room_001"


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("textured", [True, False])
def test_every_validator_passes(suffix: str, textured: bool, tmp_path: Path) -> None:
    path = tmp_path / f"Gebäude 1{suffix}"
    export(two_rooms(textured), path)
    assert complaints(path) == []


def test_the_validators_do_find_a_fault(tmp_path: Path) -> None:
    path = tmp_path / "model.usda"
    export(two_rooms(), path)
    for picture in (tmp_path / "model.textures").iterdir():
        picture.unlink()
    assert complaints(path)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_metres_z_up_names_and_hierarchy(suffix: str, tmp_path: Path) -> None:
    model = two_rooms()
    path = tmp_path / f"model{suffix}"
    export(model, path)
    stage = Usd.Stage.Open(str(path))
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1.0
    assert UsdGeom.GetStageUpAxis(stage) == "Z"
    root = stage.GetDefaultPrim()
    assert (root.GetPath(), root.GetDisplayName()) == ("/building", model.name)
    assert Usd.ModelAPI(root).GetKind() == Kind.Tokens.component
    for face in model.faces:
        mesh = UsdGeom.Mesh(stage.GetPrimAtPath(f"/building/{room_of(face)}/{face.name}"))
        np.testing.assert_allclose(np.array(mesh.GetPointsAttr().Get()), face.vertices, atol=1e-6)
        extent = np.array(mesh.GetExtentAttr().Get())
        np.testing.assert_allclose(extent, [face.vertices.min(axis=0), face.vertices.max(axis=0)], atol=1e-6)
        assert mesh.GetSubdivisionSchemeAttr().Get() == "none"
        assert np.array(mesh.GetNormalsAttr().Get()) @ face.normal == pytest.approx(1.0)
    box = UsdGeom.BBoxCache(Usd.TimeCode.Default(), ["default"]).ComputeWorldBound(root).ComputeAlignedRange()
    np.testing.assert_allclose([box.GetMin(), box.GetMax()], np.array([[0, 0, 0], [6, 5, HEIGHT]]), atol=1e-6)


def test_walls_carry_their_accuracy(tmp_path: Path) -> None:
    export(two_rooms(), tmp_path / "model.usda")
    stage = Usd.Stage.Open(str(tmp_path / "model.usda"))
    prim = stage.GetPrimAtPath("/building/room_000/wall_003")
    assert prim.GetAttribute("userProperties:sigma_offset").Get() == pytest.approx(0.013)
    assert prim.GetAttribute("userProperties:source").Get() == "lidar"


def texture_path(mesh: Any) -> str:
    material, _ = UsdShade.MaterialBindingAPI(mesh).ComputeBoundMaterial()
    surface = material.ComputeSurfaceSource()[0]
    texture = surface.GetInput("diffuseColor").GetConnectedSources()[0][0].source
    return str(UsdShade.Shader(texture.GetPrim()).GetInput("file").Get().resolvedPath)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_textures_lie_on_the_right_corners(suffix: str, tmp_path: Path) -> None:
    model = two_rooms()
    path = tmp_path / f"model{suffix}"
    export(model, path)
    stage = Usd.Stage.Open(str(path))
    for face in (f for f in model.faces if f.kind == "wall" and f.texture is not None):
        mesh = UsdGeom.Mesh(stage.GetPrimAtPath(f"/building/{room_of(face)}/{face.name}"))
        resolved = texture_path(mesh)
        if suffix == ".usdz":
            package, inside = resolved[:-1].split("[")
            picture = Image.open(io.BytesIO(zipfile.ZipFile(package).read(inside)))
        else:
            assert Path(resolved).parent == tmp_path / "model.textures"
            picture = Image.open(resolved)
        points = np.array(mesh.GetPointsAttr().Get())
        st = np.array(UsdGeom.PrimvarsAPI(mesh).GetPrimvar("st").Get())
        for name, expected in QUADRANTS.items():
            u, v = st[np.linalg.norm(points - corner(face, name), axis=1).argmin()]
            # USD: st (0, 0) is the lower left corner of the picture.
            pixel = picture.getpixel((round(u * (picture.width - 1)), round((1 - v) * (picture.height - 1))))
            np.testing.assert_allclose(np.array(pixel), expected, atol=8)


def test_usdz_is_a_valid_package(tmp_path: Path) -> None:
    path = tmp_path / "model.usdz"
    export(two_rooms(), path)
    content = path.read_bytes()
    with zipfile.ZipFile(path) as package:
        assert package.testzip() is None
        entries = package.infolist()
    assert entries[0].filename == "model.usdc"
    assert [entry.filename for entry in entries[1:]] == ["textures/page_00.jpg"]
    for entry in entries:
        assert entry.compress_type == zipfile.ZIP_STORED
        name, extra = (int.from_bytes(content[entry.header_offset + at :][:2], "little") for at in (26, 28))
        assert (entry.header_offset + 30 + name + extra) % 64 == 0
    layers, assets, unresolved = UsdUtils.ComputeAllDependencies(str(path))
    assert (len(layers), len(assets), len(unresolved)) == (1, 1, 0)


def test_faces_without_a_texture_share_clean_materials(tmp_path: Path) -> None:
    export(two_rooms(textured=False), tmp_path / "model.usda")
    stage = Usd.Stage.Open(str(tmp_path / "model.usda"))
    names = {prim.GetName() for prim in stage.GetPrimAtPath("/building/materials").GetChildren()}
    assert names == {"neutral_wall", "neutral_floor", "neutral_ceiling"}
    wall = UsdShade.MaterialBindingAPI(stage.GetPrimAtPath("/building/room_000/wall_000"))
    assert wall.ComputeBoundMaterial()[0].GetPath() == "/building/materials/neutral_wall"


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("profile", [None, "simready", "arkit"])
def test_storeys_stand_above_one_another(suffix: str, profile: UsdProfile | None, tmp_path: Path) -> None:
    if profile == "arkit" and suffix != ".usdz":
        pytest.skip("the profile arkit is a package")
    model = two_rooms()
    building = stack("Haus", [Storey("1. Stock", 3.2, model), Storey("Erdgeschoß", 0.0, model)])
    path = tmp_path / f"haus{suffix}"
    export_building(building, path, ExportOptions(usd_profile=profile))
    assert complaints(path) == []
    stage = Usd.Stage.Open(str(path))
    levels = [prim for prim in stage.GetDefaultPrim().GetChildren() if prim.IsA(UsdGeom.Xform)]
    assert [prim.GetDisplayName() for prim in levels] == ["Erdgeschoß", "1. Stock"]
    boxes = UsdGeom.BBoxCache(Usd.TimeCode.Default(), ["default"])
    up = 1 if profile == "arkit" else 2
    for prim, elevation in zip(levels, (0.0, 3.2), strict=True):
        box = boxes.ComputeWorldBound(prim).ComputeAlignedRange()
        assert (box.GetMin()[up], box.GetMax()[up]) == pytest.approx((elevation, elevation + HEIGHT), abs=1e-6)
        wall = stage.GetPrimAtPath(f"{prim.GetPath()}/room_000/wall_000")
        assert f"/{prim.GetName()}/page_00.jpg" in texture_path(UsdGeom.Mesh(wall))
    assert len({texture_path(UsdGeom.Mesh(p)) for p in stage.Traverse() if has_texture(p)}) == 2


def has_texture(prim: Usd.Prim) -> bool:
    material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
    return prim.IsA(UsdGeom.Mesh) and bool(material) and not material.GetPrim().GetName().startswith("neutral_")
