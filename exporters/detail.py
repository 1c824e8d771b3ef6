"""How much detail an exported model has: its pictures' sizes, tiles of too large ones, pages of small ones."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import cv2
import numpy as np

from recon.exporters.atlas import on_pages
from recon.exporters.options import ExportOptions
from recon.model import Face, Model
from recon.tiles import MOST_TEXELS, tiled

MOST_WANTED = 8192
"""A side, where that is asked for."""


def with_detail(
    model: Model, options: ExportOptions, level: int = 0, pictures: bool = True
) -> tuple[Model, tuple[str, ...]]:
    """The model with faces in tiles where their picture is too large for engines, and a line that says so.

    Small pictures share pages. level: of detail; every picture has half the size of the level before. pictures:
    whether the format has any.
    """
    most = MOST_TEXELS
    if options.usd_profile != "arkit" and options.texture_size is not None:
        most = min(max(options.texture_size, MOST_TEXELS), MOST_WANTED)
    size = most if options.texture_size is None else min(options.texture_size, most)
    faces = tiled(model.faces, most) if pictures else model.faces
    parts = Counter(face.tile_of for face in faces if face.tile_of is not None)
    notes = tuple(f"{name} has {n} pictures, of at most {most} texels a side" for name, n in parts.items())
    faces = tuple(_resized(face, size, level) for face in faces)
    return replace(model, faces=on_pages(faces, size) if pictures else faces), notes if level == 0 else ()


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
