"""How much detail an exported model has: the sizes of its pictures."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from recon.exporters.options import ExportOptions
from recon.model import Face, Model

MOST_TEXELS = 8192
"""A side, of any picture: what engines and the file formats of pictures take."""
MOST_ON_PHONES = 4096
"""A side, in the profile arkit."""


def with_detail(model: Model, options: ExportOptions, level: int = 0) -> tuple[Model, tuple[str, ...]]:
    """The model with smaller pictures where options or engines want them, and a line where nobody had asked for it.

    level: of detail; every picture has half the size of the level before.
    """
    limit = MOST_ON_PHONES if options.usd_profile == "arkit" else MOST_TEXELS
    size = limit if options.texture_size is None else min(options.texture_size, limit)
    faces = tuple(_resized(face, size, level) for face in model.faces)
    changed = sum(a is not b for a, b in zip(faces, model.faces, strict=True))
    said = options.texture_size is None and level == 0 and changed
    notes = (f"{changed} pictures were larger than {limit} texels a side and are scaled down to that",) if said else ()
    return replace(model, faces=faces), notes


def _resized(face: Face, size: int, level: int) -> Face:
    if face.texture is None:
        return face
    height, width = face.texture.shape[:2]
    factor = min(1.0, size / max(height, width)) * 0.5**level
    if factor >= 1.0:
        return face
    target = max(round(width * factor), 1), max(round(height * factor), 1)
    texture = np.asarray(cv2.resize(face.texture, target, interpolation=cv2.INTER_AREA), dtype=np.uint8)
    return replace(face, texture=texture, metres_per_texel=face.metres_per_texel / factor)
