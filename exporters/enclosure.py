"""Which faces an exported model has, beyond those that are seen from its rooms."""

from __future__ import annotations

from dataclasses import replace

from recon.backs import back_faces
from recon.exporters.options import ExportOptions
from recon.model import Model


def enclosed(model: Model, options: ExportOptions) -> Model:
    """The model with the backs and ends of walls that stand free, or the whole outside; with ceilings or without."""
    faces = tuple(face for face in model.faces if options.ceiling or face.kind != "ceiling")
    if not faces:
        return replace(model, faces=faces)
    return replace(model, faces=faces + back_faces(model.layout, model.faces, options.outside, options.ceiling))
