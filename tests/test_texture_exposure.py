"""Images that are dark, burnt out, grey or exposed each in its own way: pictures that fit, or a line."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
import pytest
from box_room import WIDE, box_layout, camera_at, shoot
from numpy.typing import NDArray

from recon.config import TextureConfig
from recon.faces import extrude
from recon.model import Face
from recon.texture import texture_faces
from recon.texture.notes import texture_notes

Image = NDArray[np.uint8]
COARSE = TextureConfig(metres_per_texel=0.02)


def textured(change: Callable[[int, Image], NDArray[Any]]) -> tuple[Face, ...]:
    """A box room from six places, each image changed."""
    poses = tuple(camera_at(2.5, 1.2 + 0.2 * k, k * np.pi / 3) for k in range(6))
    taken = shoot(WIDE, poses)

    def load(i: int) -> Image:
        return np.asarray(np.clip(np.rint(change(i, taken.images[i])), 0, 255), np.uint8)

    return texture_faces(extrude(box_layout()), WIDE, poses, load, COARSE)


def levels(faces: tuple[Face, ...]) -> NDArray[np.float64]:
    """Mean brightness of every wall's picture."""
    return np.array([f.texture.mean() for f in faces if f.kind == "wall" and f.texture is not None])


@pytest.mark.parametrize("factor", [0.0, 0.02, 60.0])
def test_black_and_burnt_out_images_are_said(factor: float) -> None:
    faces = textured(lambda _, image: image * factor + (255 if factor > 1 else 0))
    notes = [note for note in texture_notes(faces, COARSE) if "black or burnt out" in note]
    assert len(notes) == 1 and "wall_000" in notes[0]
    assert len(levels(faces)) == 4, "the pictures are there all the same"


def test_images_exposed_one_by_one_agree() -> None:
    """Half, normal and one and a half exposure in turn: walls come out alike, and no line complains."""
    plain = levels(textured(lambda _, image: image.astype(np.float64)))
    uneven = levels(textured(lambda i, image: image * (0.6, 1.0, 1.4)[i % 3]))
    assert uneven.std() < plain.std() + 0.15 * plain.mean()
    assert uneven.mean() == pytest.approx(plain.mean(), rel=0.3)


def test_grey_images_make_grey_pictures() -> None:
    def grey(_: int, image: Image) -> NDArray[Any]:
        return np.asarray(cv2.cvtColor(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), cv2.COLOR_GRAY2BGR))

    faces = textured(grey)
    assert all(np.ptp(f.texture.astype(int), axis=2).max() <= 2 for f in faces if f.texture is not None)
    assert not [note for note in texture_notes(faces, COARSE) if "burnt" in note]
