"""Wavefront OBJ with its .mtl and a folder of textures; metres, Y up as most programs assume."""

from __future__ import annotations

from recon.exporters.options import DEFAULTS, ExportOptions, TextureFormat
from recon.exporters.output import Output
from recon.exporters.pictures import OPACITY, texture_files, texture_path
from recon.exporters.shape import Structure, face_normal, y_up
from recon.geometry import Array
from recon.model import NEUTRAL_COLOURS, Face, Model


def write_obj(model: Model, stem: str, options: ExportOptions = DEFAULTS) -> Output:
    """One object a face (`o wall_003`), with a material of the same name, room by room.

    No groups (`g`): programs that split a file by both would name the parts differently.
    """
    folder = f"{stem}.textures"
    lines = ["# recon: metres, Y up, right-handed", f"mtllib {stem}.mtl"]
    first = 1  # OBJ counts from 1 over the whole file
    for number, face in enumerate(Structure(model).faces(), start=1):
        lines += _face_lines(face, first, number)
        first += len(face.vertices)
    materials = "".join(_material(face, folder, options.texture_format) for face in _material_faces(model))
    beside = {f"{stem}.mtl": ("# recon\n" + materials).encode()} | texture_files(model, folder, options.texture_format)
    return Output(("\n".join(lines) + "\n").encode(), beside)


def _face_lines(face: Face, first: int, normal_index: int) -> list[str]:
    lines = [f"o {face.name}", f"usemtl {_material_name(face)}"]
    lines += _rows("v", y_up(face.vertices)) + _rows("vt", face.uv) + _rows("vn", y_up(face_normal(face))[None])
    for triangle in face.triangles + first:
        lines.append("f " + " ".join(f"{i}/{i}/{normal_index}" for i in triangle))
    return lines


def _rows(keyword: str, values: Array) -> list[str]:
    rounded = values.round(6) + 0.0  # no minus zero
    return [f"{keyword} " + " ".join(f"{v:.6f}" for v in row) for row in rounded]


def _material_name(face: Face) -> str:
    return f"neutral_{face.kind}" if face.texture is None else face.name


def _material_faces(model: Model) -> list[Face]:
    """One face for every material, in the order of first use."""
    return list({_material_name(f): f for f in reversed(model.faces)}.values())[::-1]


def _material(face: Face, folder: str, kind: TextureFormat) -> str:
    colour = [1.0, 1.0, 1.0] if face.texture is not None else [c / 255 for c in NEUTRAL_COLOURS[face.kind]]
    lines = [f"newmtl {_material_name(face)}", "Ka 0 0 0", "Kd " + " ".join(f"{c:.4f}" for c in colour), "Ks 0 0 0"]
    lines.append("illum 1")
    if face.texture is None and face.kind in OPACITY:
        lines.append(f"d {OPACITY[face.kind]}")
    if face.texture is not None:
        lines.append(f"map_Kd {texture_path(face, folder, kind)}")
    return "\n".join(lines) + "\n\n"
