"""Small pictures together on pages, so that many faces share one material: a door's sides need no picture each."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.model import Face

SMALL = 640
"""Texels on the longer side of pictures that go on pages; larger ones stay by themselves."""
PAGE = 2048
"""Texels on the longer side of a page."""
FILLED = 1.2
"""Area of a page over that of what is to go on it, at least."""
BORDER = 16
"""Texels around a picture, like its edge, and the multiple at which pictures lie: down to a sixteenth of the size, as
when seen from afar, no picture shows in another."""


def on_pages(faces: tuple[Face, ...], most: int, name: str = "page") -> tuple[Face, ...]:
    """The faces; small pictures have places on shared ones (`Face.page`) of at most `most` texels a side.

    Pages are filled with shelves, the highest pictures first. Texels are neither scaled nor turned.
    """
    small = [k for k, f in enumerate(faces) if f.texture is not None and _fits(f, min(PAGE, most))]
    if len(small) < 2:
        return faces
    cells = {k: _cell(faces[k]) for k in small}
    order = sorted(small, key=lambda k: (-cells[k][1], -cells[k][0], k))
    places = _shelves([cells[k] for k in order], _side(list(cells.values()), min(PAGE, most)))
    out = list(faces)
    for page in range(places[-1][0] + 1):
        mine = [(k, x, y) for k, (p, x, y) in zip(order, places, strict=True) if p == page]
        picture = _drawn([(faces[k], x, y) for k, x, y in mine])
        for k, x, y in mine:
            out[k] = _placed(faces[k], picture, x, y, f"{name}_{page:02d}")
    return tuple(out)


def _size(face: Face) -> tuple[int, int]:
    """Width and height of its picture, texels."""
    assert face.texture is not None
    height, width = face.texture.shape[:2]
    return width, height


def _cell(face: Face) -> tuple[int, int]:
    """Width and height that it takes on a page, with its border."""
    width, height = (-(-length // BORDER) * BORDER + 2 * BORDER for length in _size(face))
    return width, height


def _fits(face: Face, side: int) -> bool:
    return max(_size(face)) <= SMALL and max(_cell(face)) <= side


def _side(cells: list[tuple[int, int]], most: int) -> int:
    """Width of pages, a power of two where `most` is one: the least that may hold everything, or `most`."""
    area, side = sum(width * height for width, height in cells), BORDER
    while side < most and (side * side < FILLED * area or side < max(max(cell) for cell in cells)):
        side *= 2
    return min(side, most)


def _shelves(cells: list[tuple[int, int]], side: int) -> list[tuple[int, int, int]]:
    """Page and upper left corner x, y of every cell; their heights do not increase."""
    places = []
    page = x = y = shelf = 0
    for width, height in cells:
        if x + width > side:
            x, y, shelf = 0, y + shelf, 0
        if y + height > side:
            page, x, y, shelf = page + 1, 0, 0, 0
        places.append((page, x, y))
        x, shelf = x + width, max(shelf, height)
    return places


def _drawn(pictures: list[tuple[Face, int, int]]) -> NDArray[np.uint8]:
    """One page, as large as it must be; what no picture needs is grey."""
    width, height = (max(at[axis] + _cell(face)[axis] for face, *at in pictures) for axis in (0, 1))
    page = np.full((height, width, 3), 128, np.uint8)
    for face, x, y in pictures:
        (across, down), size = _cell(face), _size(face)
        rest = down - size[1] - BORDER, across - size[0] - BORDER
        bordered = cv2.copyMakeBorder(np.asarray(face.texture), BORDER, rest[0], BORDER, rest[1], cv2.BORDER_REPLICATE)
        page[y : y + down, x : x + across] = bordered
    return page


def _placed(face: Face, page: NDArray[np.uint8], x: int, y: int, name: str) -> Face:
    width, height = _size(face)
    u = (x + BORDER + face.uv[:, 0] * width) / page.shape[1]
    v = 1 - (y + BORDER + (1 - face.uv[:, 1]) * height) / page.shape[0]
    return replace(face, texture=page, uv=np.column_stack([u, v]), sources=None, page=name)
