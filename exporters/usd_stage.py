"""The scene of a USD file: /building/room_000/wall_003 and so on, with materials, accuracy and, if wanted, physics."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

import recon
from recon.exporters.options import ExportOptions
from recon.exporters.parts import Part
from recon.exporters.pictures import linear_rgb, mean_colour
from recon.exporters.shape import Group, Structure, face_normal, room_facts, y_up
from recon.exporters.usd_material import bind, define_material
from recon.geometry import Array
from recon.model import Face

if TYPE_CHECKING:
    from pxr import Sdf, Usd

ROOT = "/building"
CEILING_VARIANTS = {"shown": "inherited", "hidden": "invisible"}
"""Variants to the visibility of ceilings; the first is the default."""
_LABELS = {"reveal": ["wall"], "threshold": ["floor"]}
"""Semantic classes of faces that are not called what they are."""


def build_stage(name: str, parts: list[Part], options: ExportOptions) -> Usd.Stage:
    """/building, its storeys where there are several, rooms, and in these floor, ceiling, walls and openings.

    Profile "arkit": Y up. "simready": every face collides (UsdPhysics), has a semantic class (UsdSemantics),
    and the variant set `ceiling` shows or hides the ceilings.
    """
    from pxr import Kind, Usd, UsdGeom

    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y if options.usd_profile == "arkit" else UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, UsdGeom.LinearUnits.meters)
    root = UsdGeom.Xform.Define(stage, ROOT).GetPrim()
    stage.SetDefaultPrim(root)
    Usd.ModelAPI(root).SetKind(Kind.Tokens.component)
    Usd.ModelAPI(root).SetAssetName(name)
    root.SetDisplayName(name)
    layer = stage.GetRootLayer()
    notes = dict.fromkeys(note for part in parts for note in (*part.model.notes, *part.model.picture_notes))
    layer.documentation = "\n".join([name, *notes])
    layer.customLayerData = {"creator": f"recon {recon.__version__}"}
    for part in parts:
        _Storey(stage, part, options).define()
    if options.usd_profile == "simready":
        _define_variants(stage, root)
    if any(part.model.faces for part in parts):
        boxes = UsdGeom.BBoxCache(Usd.TimeCode.Default(), [UsdGeom.Tokens.default_])
        UsdGeom.ModelAPI.Apply(root).SetExtentsHint(UsdGeom.ModelAPI(root).ComputeExtentsHint(boxes))
    return stage


class _Storey:
    def __init__(self, stage: Usd.Stage, part: Part, options: ExportOptions) -> None:
        self.stage, self.part, self.options = stage, part, options
        self.structure = Structure(part.model)
        self.path = f"{ROOT}/{part.name}" if part.name else ROOT

    def define(self) -> None:
        from pxr import UsdGeom

        if self.part.name:
            self.define_level()
        self.materials = UsdGeom.Scope.Define(self.stage, f"{self.path}/materials").GetPath()
        for group in self.structure.groups:
            self.define_room(group)

    def define_level(self) -> None:
        from pxr import Gf, UsdGeom

        level = UsdGeom.Xform.Define(self.stage, self.path)
        level.GetPrim().SetDisplayName(self.part.title)
        shift = self.placed(np.array([0.0, 0.0, self.part.elevation]))
        level.AddTranslateOp().Set(Gf.Vec3d(*shift.tolist()))
        _describe(level.GetPrim(), {"kind": "storey", "elevation": float(self.part.elevation)})

    def define_room(self, group: Group) -> None:
        from pxr import UsdGeom

        path = f"{self.path}/{group.name}"
        prim = UsdGeom.Xform.Define(self.stage, path).GetPrim()
        if group.room is not None:
            prim.SetDisplayName(group.room.name)
            _describe(prim, room_facts(group.room))
        for face in group.faces:
            self.define_face(path, face)
        for name, faces in group.parts.items():
            UsdGeom.Xform.Define(self.stage, f"{path}/{name}")
            for face in faces:
                self.define_face(f"{path}/{name}", face)

    def define_face(self, parent: str, face: Face) -> None:
        from pxr import Kind, Sdf, Usd

        mesh = self.define_mesh(Sdf.Path(f"{parent}/{face.name}"), face)
        prim = mesh.GetPrim()
        Usd.ModelAPI(prim).SetKind(Kind.Tokens.subcomponent)
        bind(prim, define_material(self.stage, self.materials, face, self.part.textures, self.options.texture_format))
        _describe(prim, self.structure.facts(face))
        if self.options.usd_profile == "simready":
            _define_physics(prim, face)

    def define_mesh(self, path: Sdf.Path, face: Face) -> Any:
        from pxr import Sdf, UsdGeom, Vt

        mesh = UsdGeom.Mesh.Define(self.stage, path)
        points = Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(self.placed(face.vertices), dtype=np.float32))
        mesh.CreatePointsAttr(points)
        mesh.CreateExtentAttr(UsdGeom.PointBased.ComputeExtent(points))
        mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(face.triangles), 3, np.int32)))
        mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(face.triangles.astype(np.int32).reshape(-1)))
        mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
        mesh.CreateOrientationAttr(UsdGeom.Tokens.rightHanded)
        # One-sided: from outside one looks through a wall into the room, as in a doll's house.
        mesh.CreateDoubleSidedAttr(False)
        normals = np.broadcast_to(self.placed(face_normal(face)), face.vertices.shape).astype(np.float32)
        mesh.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(normals)))
        mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
        colour = linear_rgb(mean_colour(face)).astype(np.float32)
        mesh.CreateDisplayColorAttr(Vt.Vec3fArray.FromNumpy(colour[None]))
        kind = Sdf.ValueTypeNames.TexCoord2fArray
        st = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("st", kind, UsdGeom.Tokens.vertex)
        st.Set(Vt.Vec2fArray.FromNumpy(face.uv.astype(np.float32)))
        return mesh

    def placed(self, vectors: Array) -> Array:
        """Map coordinates (..., 3) in those of the stage."""
        return y_up(vectors) if self.options.usd_profile == "arkit" else vectors


def _define_physics(prim: Usd.Prim, face: Face) -> None:
    """A static collider of the face's own triangles, and a semantic class."""
    from pxr import UsdPhysics, UsdSemantics

    UsdPhysics.CollisionAPI.Apply(prim)
    UsdPhysics.MeshCollisionAPI.Apply(prim).CreateApproximationAttr(UsdPhysics.Tokens.none)
    UsdSemantics.LabelsAPI.Apply(prim, "class").CreateLabelsAttr(_LABELS.get(face.kind, [face.kind]))


def _define_variants(stage: Usd.Stage, root: Usd.Prim) -> None:
    """The variant set `ceiling` of the root: shown (the default) or hidden."""
    from pxr import UsdGeom

    ceilings = [prim.GetPath() for prim in stage.Traverse() if prim.GetName().startswith(("ceiling_", "roof_"))]
    variants = root.GetVariantSets().AddVariantSet("ceiling")
    for name, visibility in CEILING_VARIANTS.items():
        variants.AddVariant(name)
        variants.SetVariantSelection(name)
        with variants.GetVariantEditContext():
            for path in ceilings:
                UsdGeom.Imageable(stage.GetPrimAtPath(path)).CreateVisibilityAttr(visibility)
    variants.SetVariantSelection(next(iter(CEILING_VARIANTS)))


def _describe(prim: Usd.Prim, facts: dict[str, Any]) -> None:
    """What is known as `userProperties:` attributes, which viewers show and Blender imports, and in `customData`."""
    from pxr import Sdf

    types = {str: Sdf.ValueTypeNames.String, int: Sdf.ValueTypeNames.Int, float: Sdf.ValueTypeNames.Double}
    for key, value in facts.items():
        attribute = prim.CreateAttribute(f"userProperties:{key}", types[type(value)], custom=True)
        attribute.Set(value)
    prim.SetCustomDataByKey("recon", facts)
