"""Which faces an exported model has, beyond those that are seen from its rooms."""

from __future__ import annotations

from dataclasses import replace

from recon.backs import back_faces
from recon.exporters.options import ExportOptions
from recon.model import Model

WITH_CHOICE = (".ply", ".stl")
"""Formats that see to `max_triangles` themselves."""


def too_many_triangles(model: Model, suffix: str, options: ExportOptions) -> tuple[str, ...]:
    """A line where a format whose faces are as simple as they can be has more triangles than were asked for."""
    count = sum(len(face.triangles) for face in model.faces)
    if options.max_triangles is None or count <= options.max_triangles or suffix in WITH_CHOICE:
        return ()
    return (fewest(count),)


def fewest(count: int) -> str:
    """What is said where no mesh has fewer triangles."""
    return f"has {count} triangles, the fewest that keep the faces' outlines"


def enclosed(model: Model, options: ExportOptions) -> Model:
    """The model with the backs and ends of walls that stand free, or the whole outside; with ceilings or without."""
    faces = tuple(face for face in model.faces if options.ceiling or face.kind != "ceiling")
    if not faces:
        return replace(model, faces=faces)
    return replace(model, faces=faces + back_faces(model.layout, model.faces, options.outside, options.ceiling))
