"""Materials of a USD file: UsdPreviewSurface with a face's picture, or the neutral colour of its kind."""

from __future__ import annotations

from typing import TYPE_CHECKING

from recon.exporters.options import TextureFormat
from recon.exporters.pictures import OPACITY, linear_rgb, material_name, texture_path
from recon.model import NEUTRAL_COLOURS, Face

if TYPE_CHECKING:
    from pxr import Sdf, Usd, UsdShade

ROUGHNESS = 0.9


def bind(prim: Usd.Prim, material: UsdShade.Material) -> None:
    """Give a mesh its material."""
    from pxr import UsdShade

    UsdShade.MaterialBindingAPI.Apply(prim).Bind(material)


def define_material(
    stage: Usd.Stage, parent: Sdf.Path, face: Face, textures: str, kind: TextureFormat
) -> UsdShade.Material:
    """The material of a face below `parent`; several may share one (`material_name`).

    textures: folder of the pictures, relative to the layer.
    """
    from pxr import Gf, Sdf, UsdShade

    path = parent.AppendChild(material_name(face))
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
        if face.kind in OPACITY:
            surface.CreateInput("opacity", Sdf.ValueTypeNames.Float).Set(OPACITY[face.kind])
    else:
        diffuse.ConnectToSource(_define_texture(stage, path, f"./{texture_path(face, textures, kind)}"))
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
