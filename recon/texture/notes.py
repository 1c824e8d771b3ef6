"""What people should know of the pictures of faces, in words."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from recon.config import TextureConfig
from recon.model import Face
from recon.texture.canvas import Plane, limit

KINDS = ("wall", "floor", "ceiling", "door", "window")
"""Faces worth a word: the narrow sides of openings are not."""
LITTLE_SEEN = 0.5
COARSE = 2.0
"""Times the resolution asked for."""
BLACK, WHITE = 6, 250
"""Levels: where half of what was seen lies below, or above, images show nothing there."""
NAMED = 6


def texture_notes(faces: tuple[Face, ...], config: TextureConfig) -> tuple[str, ...]:
    """One sentence each: faces that no image shows, that are filled for the most part, known from one image only,
    black or burnt out, or coarser than asked for because of their size or because images see them from afar or at a
    grazing angle."""
    shown = [face for face in faces if face.kind in KINDS]
    painted = [face for face in shown if face.texture is not None]
    if shown and not painted:
        return ("No image shows the model; its faces have plain colours.",)
    plain = [face.name for face in shown if face.texture is None]
    filled = [face.name for face in painted if face.seen_fraction < LITTLE_SEEN]
    single = [face.name for face in painted if _images(face) == 1]
    limited = [face for face in painted if _limit(face, config) > 1.01 * config.metres_per_texel]
    far = [f.name for f in painted if f.metres_per_texel > COARSE * max(config.metres_per_texel, _limit(f, config))]
    notes = [
        (plain, "No image shows {}; plain colours stand there."),
        (filled, f"Images show less than {LITTLE_SEEN:.0%} of {{}}; the rest of the picture continues what they show."),
        (single, "One image only shows {}: nothing there could be checked against another."),
        (
            [f.name for f in painted if not BLACK <= _level(f) <= WHITE],
            "Images are nearly black or burnt out on {}: other exposures would show more.",
        ),
        (far, f"Images see {{}} from afar or at a grazing angle: coarser than {COARSE:g} x {_mm(config)} a texel."),
        (
            [f.name for f in limited],
            f"Pictures have at most {_most(config)} pixels: {{}} coarser than {_mm(config)} a texel.",
        ),
    ]
    return tuple(text.format(_listed(names)) for names, text in notes if names)


def _images(face: Face) -> int:
    """How many images its picture is from."""
    if face.sources is None:
        return 0
    return int(np.count_nonzero(np.unique(face.sources) >= 0))


def _level(face: Face) -> float:
    """The middle brightness of what images show of it, 0 to 255; mid-grey where that is nothing."""
    if face.texture is None or face.sources is None:
        return 128.0
    seen = face.texture[::4, ::4][face.sources[::4, ::4] >= 0]
    return float(np.median(seen)) if len(seen) else 128.0


def _limit(face: Face, config: TextureConfig) -> float:
    """Metres per texel at the largest size allowed."""
    return limit(Plane.of(face), config.max_texture_size)


def _most(config: TextureConfig) -> str:
    return f"{config.max_texture_size} x {config.max_texture_size}"


def _mm(config: TextureConfig) -> str:
    return f"{1000 * config.metres_per_texel:g} mm"


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - NAMED} more" if len(names) > NAMED else ""
    return ", ".join(names[:NAMED]) + more
