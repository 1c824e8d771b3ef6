"""Wavefront OBJ with its .mtl and a folder of textures; metres, Y up as most programs assume."""

from __future__ import annotations

from recon.exporters.options import DEFAULTS, ExportOptions, TextureFormat
from recon.exporters.output import Output
from recon.exporters.pictures import OPACITY, material_name, texture_files, texture_path
from recon.exporters.shape import Structure, face_normal, y_up
from recon.geometry import Array
from recon.model import NEUTRAL_COLOURS, Face, Model


def write_obj(model: Model, stem: str, options: ExportOptions = DEFAULTS) -> Output:
    """One object a face (`o wall_003`), with a material of the same name, room by room.

    No groups (`g`): programs that split a file by both would name the parts differently.
    """
    return obj_output(model, stem, options)


def obj_output(model: Model, stem: str, options: ExportOptions, z_up: bool = False) -> Output:
    """As `write_obj`, with Y or Z up."""
    folder = f"{stem}.textures"
    lines = [f"# recon: metres, {'Z' if z_up else 'Y'} up, right-handed", f"mtllib {stem}.mtl"]
    first = 1  # OBJ counts from 1 over the whole file
    for number, face in enumerate(Structure(model).faces(), start=1):
        lines += _face_lines(face, first, number, z_up)
        first += len(face.vertices)
    materials = "".join(_material(face, folder, options.texture_format) for face in _material_faces(model))
    beside = {f"{stem}.mtl": ("# recon\n" + materials).encode()} | texture_files(model, folder, options.texture_format)
    return Output(("\n".join(lines) + "\n").encode(), beside)


def _face_lines(face: Face, first: int, normal_index: int, z_up: bool) -> list[str]:
    vertices, normal = face.vertices, face_normal(face)[None]
    if not z_up:
        vertices, normal = y_up(vertices), y_up(normal)
    lines = [f"o {face.name}", f"usemtl {material_name(face)}"]
    lines += _rows("v", vertices) + _rows("vt", face.uv) + _rows("vn", normal)
    for triangle in face.triangles + first:
        lines.append("f " + " ".join(f"{i}/{i}/{normal_index}" for i in triangle))
    return lines


def _rows(keyword: str, values: Array) -> list[str]:
    rounded = values.round(6) + 0.0  # no minus zero
    return [f"{keyword} " + " ".join(f"{v:.6f}" for v in row) for row in rounded]


def _material_faces(model: Model) -> list[Face]:
    """One face for every material, in the order of first use."""
    return list({material_name(f): f for f in reversed(model.faces)}.values())[::-1]


def _material(face: Face, folder: str, kind: TextureFormat) -> str:
    colour = [1.0, 1.0, 1.0] if face.texture is not None else [c / 255 for c in NEUTRAL_COLOURS[face.kind]]
    lines = [f"newmtl {material_name(face)}", "Ka 0 0 0", "Kd " + " ".join(f"{c:.4f}" for c in colour), "Ks 0 0 0"]
    lines.append("illum 1")
    if face.texture is None and face.kind in OPACITY:
        lines.append(f"d {OPACITY[face.kind]}")
    if face.texture is not None:
        lines.append(f"map_Kd {texture_path(face, folder, kind)}")
    return "\n".join(lines) + "\n\n"
