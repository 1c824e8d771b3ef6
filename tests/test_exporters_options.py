"""Openings in every mesh format, and what may be asked of formats: pictures, levels of detail, engines, profiles."""

from __future__ import annotations

import io
import json
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from open_house import first_hit, open_house
from PIL import Image
from pxr import Usd, UsdGeom, UsdPhysics, UsdSemantics, UsdValidation
from two_rooms import HEIGHT

from recon.cloud import PointCloud
from recon.errors import OutputError
from recon.exporters import MESHES, check_outputs, export, suffix_of
from recon.exporters.bodies import bodies_behind, convex_bodies
from recon.exporters.lightmap import light_map
from recon.exporters.options import ExportOptions
from recon.geometry import Array
from recon.model import Face


def read_glb(path: Path) -> dict[str, Any]:
    content = path.read_bytes()
    document: dict[str, Any] = json.loads(content[20 : 20 + int.from_bytes(content[12:16], "little")])
    return document


def usd_triangles(stage: Usd.Stage) -> Array:
    """(T, 3, 3) in coordinates of the stage."""
    found = []
    cache = UsdGeom.XformCache()
    for prim in (p for p in stage.Traverse() if p.IsA(UsdGeom.Mesh)):
        mesh = UsdGeom.Mesh(prim)
        points = np.array(mesh.GetPointsAttr().Get(), np.float64)
        matrix = np.array(cache.GetLocalToWorldTransform(prim))
        points = points @ matrix[:3, :3] + matrix[3, :3]
        found.append(points[np.array(mesh.GetFaceVertexIndicesAttr().Get()).reshape(-1, 3)])
    return np.concatenate(found)


def triangles_in_map(path: Path) -> Array:
    """(T, 3, 3), m, map frame, of an exported file, by a reader that is not ours."""
    if path.suffix.startswith(".usd"):
        return usd_triangles(Usd.Stage.Open(str(path)))
    if path.suffix in (".sdf", ".urdf"):
        visual = trimesh.load_scene(path.with_suffix(".meshes") / "visual.obj").to_geometry()
        return np.asarray(visual.triangles, np.float64)
    mesh = trimesh.load_scene(path).to_geometry()
    triangles = np.asarray(mesh.triangles, np.float64)
    if path.suffix in (".glb", ".gltf", ".obj"):
        x, y, z = np.moveaxis(triangles, -1, 0)
        return np.stack([x, -z, y], axis=-1)
    return triangles


@pytest.mark.parametrize("suffix", sorted(MESHES))
def test_openings_are_cut_and_closed_in_every_format(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"house{suffix}"
    export(open_house(), path)
    triangles = triangles_in_map(path)
    if suffix != ".stl":  # which is a solid, with walls around the rooms
        np.testing.assert_allclose(triangles.max(axis=(0, 1)), [6, 5, HEIGHT], atol=1e-5)
    # Through the passage from one room into the other: its far wall, 2.5 m on from the middle of the first room.
    assert first_hit(triangles, np.array([4.0, 1.0, 1.0]), np.array([0.0, 1.0, 0.0])) == pytest.approx(4.0, abs=3e-4)
    # The leaf and the glass lie 5 cm back, beside them is wall.
    assert first_hit(triangles, np.array([1.5, 1.0, 1.0]), np.array([0.0, -1.0, 0.0])) == pytest.approx(1.05, abs=3e-4)
    assert first_hit(triangles, np.array([2.5, 1.0, 1.0]), np.array([0.0, -1.0, 0.0])) == pytest.approx(1.0, abs=3e-4)
    assert first_hit(triangles, np.array([1.0, 2.2, 1.5]), np.array([-1.0, 0.0, 0.0])) == pytest.approx(1.05, abs=3e-4)
    # Above the passage is wall, and below its head one sees the head.
    assert first_hit(triangles, np.array([4.0, 1.0, 2.3]), np.array([0.0, 1.0, 0.0])) == pytest.approx(1.0, abs=3e-4)
    assert first_hit(triangles, np.array([4.0, 2.05, 1.0]), np.array([0.0, 0.0, 1.0])) == pytest.approx(1.1, abs=3e-4)


@pytest.mark.parametrize(("kind", "magic"), [("jpg", "JPEG"), ("png", "PNG"), ("webp", "WEBP")])
@pytest.mark.parametrize("suffix", [".glb", ".gltf"])
def test_pictures_of_gltf(kind: Any, magic: str, suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"ein Haus{suffix}"
    export(open_house(), path, ExportOptions(texture_format=kind, texture_size=32))
    document = read_glb(path) if suffix == ".glb" else json.loads(path.read_text())
    assert (document.get("extensionsRequired") == ["EXT_texture_webp"]) == (kind == "webp")
    if suffix == ".gltf":
        names = {p.name for p in (tmp_path / "ein Haus.textures").iterdir()}
        assert names == {f"{f.name}.{kind}" for f in open_house().faces if f.texture is not None}
        assert document["buffers"][0]["uri"] == "ein%20Haus.bin"
        assert (tmp_path / "ein Haus.bin").stat().st_size == document["buffers"][0]["byteLength"]
        pictures = [p.read_bytes() for p in (tmp_path / "ein Haus.textures").iterdir()]
    else:
        binary = path.read_bytes()
        start = 20 + int.from_bytes(binary[12:16], "little") + 8
        views = [document["bufferViews"][image["bufferView"]] for image in document["images"]]
        pictures = [binary[start + v["byteOffset"] :][: v["byteLength"]] for v in views]
    for picture in pictures:
        image = Image.open(io.BytesIO(picture))
        assert (image.format, image.size) == (magic, (32, 16))


def test_what_formats_cannot_hold_is_refused_before_work(tmp_path: Path) -> None:
    for name in ("a.usd", "a.usdz", "a.obj"):
        with pytest.raises(OutputError, match="WebP"):
            check_outputs([tmp_path / name], ExportOptions(texture_format="webp"))
    with pytest.raises(OutputError, match=r"\.usdz"):
        check_outputs([tmp_path / "a.usdc"], ExportOptions(usd_profile="arkit"))
    check_outputs([tmp_path / "a.usdz", tmp_path / "a.glb"], ExportOptions(usd_profile="arkit"))
    assert not list(tmp_path.iterdir())


def test_levels_of_detail_are_files_of_their_own(tmp_path: Path) -> None:
    export(open_house(), tmp_path / "house.glb", ExportOptions(lod=2))
    names = ["house.glb", "house.lod1.glb", "house.lod2.glb"]
    assert sorted(p.name for p in tmp_path.iterdir()) == names
    walls = [trimesh.load_scene(tmp_path / name).geometry["wall_000"].visual for name in names]
    sizes = [np.ptp(wall.uv, axis=0) * wall.material.baseColorTexture.size for wall in walls]  # its part of a page
    np.testing.assert_allclose(sizes, [(100, 50), (50, 25), (25, 12)], atol=1e-3)


@pytest.mark.parametrize("most", [400, 5000])
def test_most_triangles_of_a_ply(most: int, tmp_path: Path) -> None:
    assert export(open_house(), tmp_path / "house.ply", ExportOptions(max_triangles=most)) == ()
    count = len(trimesh.load_mesh(tmp_path / "house.ply", process=False).faces)
    assert 0.2 * most < count <= most
    (note,) = export(open_house(), tmp_path / "house.ply", ExportOptions(max_triangles=10))
    count = len(trimesh.load_mesh(tmp_path / "house.ply", process=False).faces)
    assert f"{count} triangles" in note and count == sum(len(f.triangles) for f in open_house().faces)


@pytest.mark.parametrize("suffix", sorted(MESHES - {".ply"}))
def test_meshes_that_are_minimal_say_so(suffix: str, tmp_path: Path) -> None:
    (note,) = export(open_house(), tmp_path / f"house{suffix}", ExportOptions(max_triangles=50))
    assert note.startswith(f"house{suffix}: has ") and "fewest" in note and int(note.split()[2]) > 50
    assert export(open_house(), tmp_path / f"house{suffix}", ExportOptions(max_triangles=500)) == ()


@pytest.mark.parametrize("present", [False, True])
def test_a_failed_export_leaves_no_folder(present: bool, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A disk that is full at the first byte; a folder that was there stays."""
    if present:
        (tmp_path / "house.textures").mkdir()

    def full(*_: Any) -> int:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patched, pytest.raises(OutputError, match="No space left on device"):
        patched.setattr(Path, "write_bytes", lambda path, _: full() if path.parent != tmp_path else 0)
        export(open_house(), tmp_path / "house.usda")
    assert [path.name for path in tmp_path.iterdir()] == ["house.textures"] * present


def test_a_cloud_by_its_bare_name_is_a_cloud(tmp_path: Path) -> None:
    known = {"cloud.ply": ".cloud.ply", "a.cloud.ply": ".cloud.ply", "Cloud.PLY": ".cloud.ply", "mycloud.ply": ".ply"}
    known |= {"rooms.json": ".rooms.json", "layout.json": ".json", ".ply": "", "glb": ""}
    assert {name: suffix_of(Path(name)) for name in known} == known
    cloud = PointCloud(np.ones((3, 3), np.float32), np.zeros((3, 3), np.uint8))
    export(replace(open_house(), cloud=cloud), tmp_path / "cloud.ply")
    assert len(trimesh.load(tmp_path / "cloud.ply").vertices) == 3


def test_stl_in_millimetres(tmp_path: Path) -> None:
    export(open_house(), tmp_path / "house.stl", ExportOptions(stl_units="mm"))
    mesh = trimesh.load_mesh(tmp_path / "house.stl")
    assert b"millimetres" in (tmp_path / "house.stl").read_bytes()[:80]
    thickness = 120 + 2  # of walls whose other side nobody saw, and of the floor's edge
    np.testing.assert_allclose(mesh.bounds[1], [6000 + thickness, 5000 + thickness, HEIGHT * 1000 + 100], atol=0.01)


def test_names_of_collision_shapes(tmp_path: Path) -> None:
    model = open_house()
    faces = {face.name for face in model.faces}
    for engine in ("godot", "unreal", "unity"):
        export(model, tmp_path / f"{engine}.glb", ExportOptions(engine=engine))
    nodes = {e: read_glb(tmp_path / f"{e}.glb")["nodes"] for e in ("godot", "unreal", "unity")}
    meshes = {engine: {n["name"] for n in found if "mesh" in n} for engine, found in nodes.items()}
    assert meshes["godot"] == {f"{name}-col" for name in faces}
    assert meshes["unity"] == faces
    assert {name for name in meshes["unreal"] if not name.startswith("UCX_")} == faces
    assert {name[4:-3] for name in meshes["unreal"] if name.startswith("UCX_")} == faces


def test_convex_bodies_fill_what_is_behind_a_face() -> None:
    for face in open_house().faces:
        a, b, c = np.moveaxis(face.vertices[face.triangles], 1, 0)
        area = float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()) / 2
        volume = 0.0
        for each in convex_bodies(face):
            body = trimesh.Trimesh(each.vertices, each.triangles, process=False)
            assert body.is_watertight and body.is_winding_consistent and body.volume > 0
            assert body.volume == pytest.approx(body.convex_hull.volume, rel=1e-5), "convex"
            assert ((each.vertices - face.vertices[0]) @ face.normal).max() < 1e-9, "behind the face"
            volume += float(body.volume)
        assert volume == pytest.approx(0.05 * area, rel=1e-6)


@given(st.floats(0.1, 3.1), st.floats(0.0, 6.28))
@settings(max_examples=30, deadline=None)
def test_bodies_of_a_sharp_corner_stand_out_nowhere(angle: float, turn: float) -> None:
    """The end of a wall that is a wedge, seen from both sides: what collides is the wedge, 5 cm deep."""
    ends = [np.array([np.cos(turn), np.sin(turn)]), np.array([np.cos(turn + angle), np.sin(turn + angle)])]
    faces = []
    for k, (a, b) in enumerate([(ends[0], np.zeros(2)), (np.zeros(2), ends[1])]):
        vertices = np.array([[*a, 0.0], [*b, 0.0], [*b, 2.0], [*a, 2.0]])[::-1]
        triangles = np.array([[0, 1, 2], [0, 2, 3]])
        faces.append(Face(f"wall_{k:03d}", "wall", k, vertices, triangles, np.zeros((4, 2))))
    for face, bodies in zip(faces, bodies_behind(faces), strict=True):
        (body,) = (trimesh.Trimesh(each.vertices, each.triangles, process=False) for each in bodies)
        assert body.is_watertight and body.volume == pytest.approx(body.convex_hull.volume, rel=1e-5)
        cut = max(0.0, np.tan(np.pi / 2 - angle) * 0.05)  # of its end, where the angle is sharp
        assert 2.0 * 0.05 * (1.0 - cut / 2) == pytest.approx(body.volume, abs=2e-4) or angle < 0.15
        inside = ends[0] + ends[1]  # the wedge is behind both faces
        assert np.dot(face.normal[:2], inside) < 0
        for other in faces:
            assert ((body.vertices - other.vertices[0]) @ other.normal).max() < 1.1e-3, (face.name, other.name)


@given(st.lists(st.tuples(st.floats(0.02, 60.0), st.floats(0.02, 6.0)), min_size=1, max_size=60))
@settings(max_examples=40)
def test_light_maps_overlap_nowhere(sizes: list[tuple[float, float]]) -> None:
    faces = []
    for k, (width, height) in enumerate(sizes):
        vertices = np.array([[0, k, 0], [width, k, 0], [width, k, height], [0, k, height]], np.float64)
        uv = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
        faces.append(Face(f"wall_{k:03d}", "wall", k, vertices, np.array([[0, 1, 2], [0, 2, 3]]), uv))
    squares = light_map(faces)
    low, high = (np.array([f(s, axis=0) for s in squares]) for f in (np.min, np.max))
    assert low.min() >= 0.0 and high.max() <= 1.0
    scale = (high - low).max(axis=1) / np.array([max(s) for s in sizes])
    np.testing.assert_allclose(scale, scale[0], rtol=1e-6, err_msg="one scale for all")
    for i in range(len(sizes)):
        apart = (low[i] >= high[i + 1 :]) | (high[i] <= low[i + 1 :])
        assert apart.any(axis=1).all()
        a, b, c = squares[i][:3]
        assert np.linalg.det([b - a, c - a]) > 0, "not mirrored"


def test_light_map_coordinates_are_in_the_file(tmp_path: Path) -> None:
    export(open_house(), tmp_path / "house.glb")
    document = read_glb(tmp_path / "house.glb")
    for mesh in document["meshes"]:
        assert {"TEXCOORD_0", "TEXCOORD_1"} <= set(mesh["primitives"][0]["attributes"])
    wall = next(n for n in document["nodes"] if n["name"] == "wall_000")["extras"]
    assert wall["room"] == "Büro 1" and wall["sigma_offset"] == pytest.approx(0.01) and wall["source"] == "lidar"
    door = next(n for n in document["nodes"] if n["name"] == "door_000")["extras"]
    assert (door["kind"], door["id"], door["wall"], door["opening"]) == ("door", 0, 0, "door")
    opening = next(n for n in document["nodes"] if n["name"] == "opening_000")
    names = {document["nodes"][k]["name"] for k in opening["children"]}
    assert names == {"door_000", "reveal_000_left", "reveal_000_right", "reveal_000_head", "threshold_000"}


@pytest.mark.parametrize("suffix", [".sdf", ".urdf"])
def test_worlds_for_robots(suffix: str, tmp_path: Path) -> None:
    model = open_house()
    export(model, tmp_path / f"Haus & Hof{suffix}")
    root = ElementTree.parse(tmp_path / f"Haus & Hof{suffix}").getroot()
    assert root.tag == {".sdf": "sdf", ".urdf": "robot"}[suffix]
    assert root.findtext("world/model/static") == ("true" if suffix == ".sdf" else None)
    visual = trimesh.load_scene(tmp_path / "Haus & Hof.meshes" / "visual.obj").to_geometry()
    np.testing.assert_allclose(visual.bounds, [[-0.05, -0.05, 0.0], [6.0, 5.0, HEIGHT]], atol=1e-5)
    shapes = [collision_shape(item, tmp_path) for item in root.iter("collision")]
    assert all(shape.is_volume and shape.volume > 0.999 * shape.convex_hull.volume for shape in shapes)
    collision = trimesh.util.concatenate(shapes)
    # A robot stands on the floor and is stopped by walls and doors; the way between the rooms is free.
    triangles = np.asarray(collision.triangles, np.float64)
    assert first_hit(triangles, np.array([1.0, 1.0, 0.5]), np.array([0.0, 0.0, -1.0])) == pytest.approx(0.5, abs=1e-5)
    assert first_hit(triangles, np.array([1.5, 1.0, 0.5]), np.array([0.0, -1.0, 0.0])) == pytest.approx(1.05, abs=1e-5)
    assert first_hit(triangles, np.array([4.0, 1.0, 0.5]), np.array([0.0, 1.0, 0.0])) == pytest.approx(4.0, abs=1e-5)
    corners = np.concatenate([face.vertices[face.triangles] for face in model.faces])
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum() / 2
    volume = sum(shape.volume for shape in shapes)
    assert 0.7 * 0.05 * area < volume <= 0.0501 * area, "5 cm thick, thinner between faces back to back"


def collision_shape(item: Any, folder: Path) -> Any:
    """A collision element of SDF or URDF as a mesh in its place."""
    origin = item.find("origin")
    pose = item.findtext("pose") if origin is None else f"{origin.get('xyz')} {origin.get('rpy')}"
    numbers = [float(v) for v in pose.split()]
    box, mesh = item.find("geometry/box"), item.find("geometry/mesh")
    if box is not None:
        size = box.get("size") or box.findtext("size")
        shape = trimesh.creation.box([float(v) for v in size.split()])
    else:
        shape = trimesh.load_mesh(folder / (mesh.get("filename") or mesh.findtext("uri")))
    place = trimesh.transformations.euler_matrix(*numbers[3:], "sxyz")
    place[:3, 3] = numbers[:3]
    return shape.apply_transform(place)


def complaints(stage: Usd.Stage) -> list[str]:
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    errors = UsdValidation.ValidationContext(validators).Validate(stage)
    return [f"{error.GetName()}: {error.GetMessage()}" for error in errors]


@pytest.mark.parametrize("textured", [True, False])
def test_usd_for_phones(textured: bool, tmp_path: Path) -> None:
    path = tmp_path / "house.usdz"
    export(open_house(textured), path, ExportOptions(usd_profile="arkit", texture_format="png"))
    stage = Usd.Stage.Open(str(path))
    assert complaints(stage) == []
    assert UsdGeom.GetStageUpAxis(stage) == "Y" and UsdGeom.GetStageMetersPerUnit(stage) == 1.0
    triangles = usd_triangles(stage)
    bounds = [triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))]
    np.testing.assert_allclose(bounds, [[-0.05, 0.0, -5.0], [6.0, HEIGHT, 0.05]], atol=1e-5)
    assert {Path(layer.identifier).suffix for layer in stage.GetUsedLayers() if not layer.anonymous} <= {
        ".usdz",
        ".usdc]",
    }


@pytest.mark.parametrize("suffix", [".usda", ".usdc", ".usdz"])
def test_usd_for_simulators(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"house{suffix}"
    model = open_house()
    export(model, path, ExportOptions(usd_profile="simready"))
    stage = Usd.Stage.Open(str(path))
    assert complaints(stage) == []
    assert UsdGeom.GetStageUpAxis(stage) == "Z"
    meshes = {p.GetName(): p for p in stage.Traverse() if p.IsA(UsdGeom.Mesh)}
    assert set(meshes) == {face.name for face in model.faces}
    for face in model.faces:
        prim = meshes[face.name]
        assert prim.HasAPI(UsdPhysics.CollisionAPI) and prim.HasAPI(UsdPhysics.MeshCollisionAPI)
        (label,) = UsdSemantics.LabelsAPI(prim, "class").GetLabelsAttr().Get()
        assert label == {"reveal": "wall", "threshold": "floor"}.get(face.kind, face.kind)
    facts = meshes["wall_003"].GetCustomData()["recon"]
    assert facts["sigma_offset"] == pytest.approx(0.013) and facts["source"] == "lidar"
    variants = stage.GetDefaultPrim().GetVariantSet("ceiling")
    assert (variants.GetVariantSelection(), set(variants.GetVariantNames())) == ("shown", {"shown", "hidden"})
    ceiling = UsdGeom.Imageable(meshes["ceiling_000"])
    assert ceiling.ComputeVisibility() == "inherited"
    variants.SetVariantSelection("hidden")
    assert UsdGeom.Imageable(stage.GetPrimAtPath(ceiling.GetPath())).ComputeVisibility() == "invisible"
    assert UsdGeom.Imageable(meshes["floor_000"]).ComputeVisibility() == "inherited"


def test_a_model_without_a_picture_or_anything_is_valid_in_every_profile(tmp_path: Path) -> None:
    empty = replace(open_house(False), faces=())
    for profile in ("arkit", "simready"):
        for name, model in (("bare", open_house(False)), ("empty", empty)):
            path = tmp_path / f"{name}_{profile}.usdz"
            export(model, path, ExportOptions(usd_profile=profile))
            assert complaints(Usd.Stage.Open(str(path))) == []


def test_a_blank_picture_of_one_texel(tmp_path: Path) -> None:
    model = open_house()
    tiny = replace(model.faces[0], texture=np.full((1, 1, 3), 7, np.uint8))
    export(
        replace(model, faces=(tiny, *model.faces[1:])),
        tmp_path / "house.glb",
        ExportOptions(lod=3, texture_format="png"),
    )
    wall = trimesh.load_scene(tmp_path / "house.lod3.glb").geometry["wall_000"].visual
    page = wall.material.baseColorTexture
    np.testing.assert_allclose(np.ptp(wall.uv, axis=0) * page.size, 1, atol=1e-3)
    u, v = wall.uv.mean(axis=0) * page.size
    assert page.getpixel((int(u), int(page.height - v)))[:3] == (7, 7, 7)


def test_walls_without_a_room_have_a_group_of_their_own(tmp_path: Path) -> None:
    model = open_house()
    roomless = replace(model, layout=replace(model.layout, rooms=()))
    walls = tuple(face for face in roomless.faces if face.kind not in ("floor", "ceiling"))
    for name in ("house.glb", "house.usda"):
        export(replace(roomless, faces=walls), tmp_path / name)
    nodes = {node["name"]: node for node in read_glb(tmp_path / "house.glb")["nodes"]}
    assert "room_000" not in nodes and "room" not in nodes["wall_000"]["extras"]
    parts = [document["name"] for document in nodes.values() if document["name"].startswith(("wall_", "opening_"))]
    backs = [name for name in nodes if name.startswith(("back_", "roof_", "underside_"))]
    assert len(parts) == 10 + 4 and len(nodes["other"]["children"]) == len(parts) + len(backs) and backs
    stage = Usd.Stage.Open(str(tmp_path / "house.usda"))
    assert complaints(stage) == [] and stage.GetPrimAtPath("/building/other/opening_000/door_000")
