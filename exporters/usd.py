"""USD: .usd and .usdc (binary), .usda (text), .usdz (one package with its textures); metres, Z up."""

from __future__ import annotations

import io
import tempfile
import zipfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import recon
from recon.exporters.output import Output
from recon.exporters.pictures import linear_rgb, mean_colour, texture_files, texture_path
from recon.exporters.shape import face_facts, face_normal, grouped
from recon.model import NEUTRAL_COLOURS, Face, Model

if TYPE_CHECKING:
    from pxr import Sdf, Usd, UsdShade

ROOT = "/building"
ROUGHNESS = 0.9
USDZ_ALIGNMENT = 64
_LOCAL_HEADER, _EXTRA_HEADER = 30, 4  # bytes, of a zip archive's entry and of its extra field
_PADDING_FIELD = 0x1986  # id of the extra field that OpenUSD's own packages are padded with


def write_usdc(model: Model, stem: str) -> Output:
    """Binary USD, textures beside it in `<stem>.textures`."""
    folder = f"{stem}.textures"
    return Output(_crate(_stage(model, folder)), texture_files(model, folder))


def write_usda(model: Model, stem: str) -> Output:
    """Text USD, textures beside it in `<stem>.textures`."""
    folder = f"{stem}.textures"
    stage = _stage(model, folder)  # held here: its layer dies with it
    return Output(stage.GetRootLayer().ExportToString().encode(), texture_files(model, folder))


def write_usdz(model: Model, stem: str) -> Output:
    """A package of a binary layer and its textures: stored, every file at a multiple of 64 bytes."""
    files = {"model.usdc": _crate(_stage(model, "textures"))} | texture_files(model, "textures")
    return Output(_package(files))


def _crate(stage: Usd.Stage) -> bytes:
    with tempfile.TemporaryDirectory() as folder:  # the binary format can only be written to a file
        path = Path(folder) / "model.usdc"
        if not stage.GetRootLayer().Export(str(path)):
            raise OSError(None, "OpenUSD cannot write a temporary layer", str(path))
        return path.read_bytes()


def _package(files: dict[str, bytes]) -> bytes:
    """A zip archive as the USDZ specification wants it: nothing compressed, data aligned, the layer first."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_STORED) as archive:
        for name, content in files.items():
            info = zipfile.ZipInfo(name, date_time=(1980, 1, 1, 0, 0, 0))
            data_start = buffer.tell() + _LOCAL_HEADER + len(name.encode()) + _EXTRA_HEADER
            padding = -data_start % USDZ_ALIGNMENT
            info.extra = _PADDING_FIELD.to_bytes(2, "little") + padding.to_bytes(2, "little") + bytes(padding)
            archive.writestr(info, content)
    return buffer.getvalue()


def _stage(model: Model, textures: str) -> Usd.Stage:
    """The scene: /building/{walls,floors,ceilings}/NAME and /building/materials; textures at `./textures/`."""
    from pxr import Kind, Sdf, Usd, UsdGeom

    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, UsdGeom.LinearUnits.meters)
    root = UsdGeom.Xform.Define(stage, ROOT).GetPrim()
    stage.SetDefaultPrim(root)
    Usd.ModelAPI(root).SetKind(Kind.Tokens.component)
    Usd.ModelAPI(root).SetAssetName(model.name)
    root.SetDisplayName(model.name)
    layer = stage.GetRootLayer()
    layer.documentation = "\n".join([model.name, *model.notes])
    layer.customLayerData = {"creator": f"recon {recon.__version__}"}
    materials = UsdGeom.Scope.Define(stage, f"{ROOT}/materials").GetPath()
    for group, faces in grouped(model).items():
        UsdGeom.Xform.Define(stage, f"{ROOT}/{group}")
        for face in faces:
            path = Sdf.Path(f"{ROOT}/{group}/{face.name}")
            mesh = _define_mesh(stage, path, face)
            _bind(mesh, _define_material(stage, materials, face, textures))
            _describe(mesh.GetPrim(), face_facts(model, face))
    boxes = UsdGeom.BBoxCache(Usd.TimeCode.Default(), [UsdGeom.Tokens.default_])
    if model.faces:
        UsdGeom.ModelAPI.Apply(root).SetExtentsHint(UsdGeom.ModelAPI(root).ComputeExtentsHint(boxes))
    return stage


def _define_mesh(stage: Usd.Stage, path: Sdf.Path, face: Face) -> Any:
    from pxr import Kind, Usd, UsdGeom, Vt

    mesh = UsdGeom.Mesh.Define(stage, path)
    Usd.ModelAPI(mesh.GetPrim()).SetKind(Kind.Tokens.subcomponent)
    points = Vt.Vec3fArray.FromNumpy(face.vertices.astype(np.float32))
    mesh.CreatePointsAttr(points)
    mesh.CreateExtentAttr(UsdGeom.PointBased.ComputeExtent(points))
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(face.triangles), 3, np.int32)))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(face.triangles.astype(np.int32).reshape(-1)))
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.CreateOrientationAttr(UsdGeom.Tokens.rightHanded)
    # One-sided: from outside one looks through a wall into the room, as in a doll's house.
    mesh.CreateDoubleSidedAttr(False)
    normals = np.broadcast_to(face_normal(face), face.vertices.shape).astype(np.float32)
    mesh.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(normals)))
    mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    colour = linear_rgb(mean_colour(face)).astype(np.float32)
    mesh.CreateDisplayColorAttr(Vt.Vec3fArray.FromNumpy(colour[None]))
    _define_st(mesh, face)
    return mesh


def _define_st(mesh: Any, face: Face) -> None:
    from pxr import Sdf, UsdGeom, Vt

    st = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.vertex)
    st.Set(Vt.Vec2fArray.FromNumpy(face.uv.astype(np.float32)))


def _define_material(stage: Usd.Stage, parent: Sdf.Path, face: Face, textures: str) -> UsdShade.Material:
    """A UsdPreviewSurface: the face's texture, or the shared neutral colour of its kind."""
    from pxr import Gf, Sdf, UsdShade

    path = parent.AppendChild(face.name if face.texture is not None else f"neutral_{face.kind}")
    material = UsdShade.Material.Get(stage, path)
    if material:
        return material
    material = UsdShade.Material.Define(stage, path)
    surface = UsdShade.Shader.Define(stage, path.AppendChild("surface"))
    surface.CreateIdAttr("UsdPreviewSurface")
    surface.CreateInput("roughness", Sdf.ValueTypeNames.Float).Set(ROUGHNESS)
    surface.CreateInput("metallic", Sdf.ValueTypeNames.Float).Set(0.0)
    diffuse = surface.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f)
    if face.texture is None:
        diffuse.Set(Gf.Vec3f(*linear_rgb(NEUTRAL_COLOURS[face.kind]).tolist()))
    else:
        diffuse.ConnectToSource(_define_texture(stage, path, f"./{texture_path(face, textures)}"))
    output = surface.CreateOutput("surface", Sdf.ValueTypeNames.Token)
    material.CreateSurfaceOutput().ConnectToSource(output)
    return material


def _define_texture(stage: Usd.Stage, material: Sdf.Path, file: str) -> UsdShade.Output:
    """A UsdUVTexture that reads `file` at primvars:st; its rgb output."""
    from pxr import Sdf, UsdShade

    reader = UsdShade.Shader.Define(stage, material.AppendChild("st"))
    reader.CreateIdAttr("UsdPrimvarReader_float2")
    reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("st")
    texture = UsdShade.Shader.Define(stage, material.AppendChild("texture"))
    texture.CreateIdAttr("UsdUVTexture")
    texture.CreateInput("file", Sdf.ValueTypeNames.Asset).Set(Sdf.AssetPath(file))
    texture.CreateInput("sourceColorSpace", Sdf.ValueTypeNames.Token).Set("sRGB")
    for wrap in ("wrapS", "wrapT"):
        texture.CreateInput(wrap, Sdf.ValueTypeNames.Token).Set("clamp")
    st = reader.CreateOutput("result", Sdf.ValueTypeNames.Float2)
    texture.CreateInput("st", Sdf.ValueTypeNames.Float2).ConnectToSource(st)
    return texture.CreateOutput("rgb", Sdf.ValueTypeNames.Float3)


def _bind(mesh: Any, material: UsdShade.Material) -> None:
    from pxr import UsdShade

    UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(material)


def _describe(prim: Usd.Prim, facts: dict[str, Any]) -> None:
    """What is known of the face as `userProperties:` attributes, which viewers show and Blender imports."""
    from pxr import Sdf

    types = {str: Sdf.ValueTypeNames.String, int: Sdf.ValueTypeNames.Int, float: Sdf.ValueTypeNames.Double}
    for key, value in facts.items():
        attribute = prim.CreateAttribute(f"userProperties:{key}", types[type(value)], custom=True)
        attribute.Set(value)
