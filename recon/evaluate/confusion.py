"""Pictures of the images whose labels are the least right."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.errors import OutputError
from recon.evaluate.labels import compare_labels, read_label_image
from recon.labels import CEILING, FIRST_WALL, OBJECT, UNLABELLED, draw_labels

INVENTED = 1000
"""Added to walls without a counterpart, so that they are drawn as walls of their own."""
MISTAKES = {"identity": (60, 60, 230), "object": (230, 130, 30), "class": (0, 190, 255)}
"""BGR: a wall taken for another; an object missed or invented; all other mistakes, as floor for wall."""
STRENGTH = 0.75

Image = NDArray[np.uint8]


def write_confusions(pairs: list[tuple[Path, Path]], images: dict[str, Path], folder: Path) -> list[Path]:
    """STEM.png of each of the five worst images: photo and mistakes above, true and estimated labels below.

    pairs: label images, (estimate, truth). images: photographs by stem; grey without one. Estimated walls have the
    colours and numbers of the true walls that they stand for, or numbers from INVENTED on. Raises InputError as
    `compare_labels`, OutputError where `folder` cannot be written.
    """
    if not pairs:
        return []
    scores, meaning = compare_labels(pairs)
    by_stem = {truth.stem: (mine, truth) for mine, truth in pairs}
    out = []
    try:
        folder.mkdir(exist_ok=True)
        for stem, _ in scores.worst:
            mine, truth = (read_label_image(path) for path in by_stem[stem])
            photo = cv2.imread(str(images[stem]), cv2.IMREAD_COLOR) if stem in images else None
            grey = np.full((*truth.shape, 3), 128, np.uint8)
            picture = confusion(grey if photo is None else np.asarray(photo, np.uint8), named(mine, meaning), truth)
            out.append(folder / f"{stem}.png")
            out[-1].write_bytes(cv2.imencode(".png", picture)[1].tobytes())
    except OSError as error:
        raise OutputError(f"{folder}: cannot be written: {error.strerror or error}") from error
    return out


def named(labels: NDArray[np.uint16], meaning: NDArray[np.int64]) -> NDArray[np.uint16]:
    """Labels (H, W) with estimated walls called as the true walls that they stand for."""
    other = np.where(meaning < 0, np.arange(len(meaning)) + INVENTED, meaning)
    return np.asarray(other[labels], dtype=np.uint16)


def confusion(photo: Image, estimate: NDArray[np.uint16], truth: NDArray[np.uint16]) -> Image:
    """(2 H, 2 W, 3) BGR: photo (H, W, 3), mistakes, true labels, estimated labels; walls named alike in both."""
    scored = (truth != UNLABELLED) & (truth != CEILING)
    wrong = scored & (estimate != truth)
    walls = (estimate >= FIRST_WALL) & (truth >= FIRST_WALL)
    objects = (estimate == OBJECT) | (truth == OBJECT)
    kinds = {"identity": wrong & walls, "object": wrong & objects, "class": wrong & ~walls & ~objects}
    shown = cv2.cvtColor(cv2.cvtColor(photo, cv2.COLOR_BGR2GRAY), cv2.COLOR_GRAY2BGR).astype(np.float32)
    for name, where in kinds.items():
        shown[where] = (1 - STRENGTH) * shown[where] + STRENGTH * np.array(MISTAKES[name], np.float32)
    below = [draw_labels(photo, truth), draw_labels(photo, estimate)]
    return np.vstack([np.hstack([photo, shown.round().astype(np.uint8)]), np.hstack(below)])
