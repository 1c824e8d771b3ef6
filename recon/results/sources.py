"""Which image each texel is from: sources/NAME.png of the result folder."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.errors import InputError

FOLDER = "sources"
LAST = 65535
"""Of 16 bits: image LAST - 1 and all later ones."""


def write_sources(folder: Path, name: str, sources: NDArray[np.int32]) -> None:
    """16 bits a texel of `sources` (H, W): 0 filled, 1 + i from image i of the sequence."""
    place = folder / FOLDER
    place.mkdir(exist_ok=True)
    values = np.minimum(sources + 1, LAST).astype(np.uint16)
    (place / f"{name}.png").write_bytes(cv2.imencode(".png", values)[1].tobytes())


def read_sources(folder: Path, name: str) -> NDArray[np.int32] | None:
    """As written; None without such a picture. Raises InputError where it is damaged."""
    path = folder / FOLDER / f"{name}.png"
    if not path.is_file():
        return None
    values = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    if values is None or values.ndim != 2 or values.dtype != np.uint16:
        raise InputError(f"{path}: is no picture of 16 bits, expected a PNG of recon build")
    return np.asarray(values, np.int32) - 1
