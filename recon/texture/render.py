"""The picture of a face from the views chosen for its blocks."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array, Pose3
from recon.texture.canvas import BLOCK, Canvas, enlarge
from recon.texture.consensus import Correction
from recon.texture.fill import fill_smoothly
from recon.texture.gains import Exposure
from recon.texture.grain import grain, repeated
from recon.texture.labelling import Views
from recon.texture.pattern import pattern
from recon.texture.view import Image, Lens, at_level, level_of, pyramid

TILE = 64
"""Blocks a side of what is worked on at a time."""
FEATHER = 2.5
"""How steeply one view gives way to the next: the blend is BLOCK / FEATHER texels wide."""

UPRIGHT = 0.5
"""Largest vertical part of a wall's normal."""

Range = tuple[int, int]
Grid = NDArray[np.float32]


@dataclass(frozen=True)
class Shot:
    """An image, number `view`, as a source of colours. level: index into the pyramid to read from."""

    map_from_camera: Pose3
    exposure: Exposure
    view: int
    correction: Correction
    level: int


def render(
    canvas: Canvas, choice: Views, shots: dict[int, Shot], lens: Lens, load: Callable[[int], Image | None]
) -> tuple[Image, NDArray[np.int32]]:
    """Picture (height, width, 3) BGR, and the image (height, width) that most of each texel is from, -1 filled.

    choice: view of every block, -1 unseen; what is unseen is filled from around it.
    """
    rows, columns = canvas.blocks
    picture = np.zeros((rows * BLOCK, columns * BLOCK, 3), np.uint8)
    alpha = np.zeros((rows * BLOCK, columns * BLOCK), np.uint8)
    padded = np.pad(choice, 1, mode="edge")
    for tile_rows, tile_columns in _tiles(rows, columns):
        texels = (_texels(tile_rows), _texels(tile_columns))
        picture[texels], alpha[texels] = _tile(canvas, padded, (tile_rows, tile_columns), shots, lens, load)
    inside = np.zeros(alpha.shape, bool)
    inside[: canvas.height, : canvas.width] = canvas.inside()
    alpha *= inside
    fill_unseen(picture, alpha, inside, abs(float(canvas.plane.normal[2])) < UPRIGHT)
    picture = np.ascontiguousarray(picture[: canvas.height, : canvas.width])
    sources = np.repeat(np.repeat(choice, BLOCK, axis=0), BLOCK, axis=1)[: canvas.height, : canvas.width]
    sources[alpha[: canvas.height, : canvas.width] < 128] = -1
    return picture, sources


def _tiles(rows: int, columns: int) -> Iterator[tuple[Range, Range]]:
    for top in range(0, rows, TILE):
        for left in range(0, columns, TILE):
            yield (top, min(top + TILE, rows)), (left, min(left + TILE, columns))


def _texels(blocks: Range) -> slice:
    return slice(blocks[0] * BLOCK, blocks[1] * BLOCK)


def _tile(
    canvas: Canvas,
    padded: Views,
    tile: tuple[Range, Range],
    shots: dict[int, Shot],
    lens: Lens,
    load: Callable[[int], Image | None],
) -> tuple[Image, Image]:
    """Colours and alpha of the blocks of a tile. padded: the views of all blocks with one ring around them."""
    (top, bottom), (left, right) = tile
    views = padded[top : bottom + 2, left : right + 2]
    total = np.zeros(((bottom - top) * BLOCK, (right - left) * BLOCK, 3), np.float32)
    summed, cover = np.zeros(total.shape[:2], np.float32), np.zeros(total.shape[:2], np.float32)
    for view in np.unique(views[views >= 0]):
        shot, image = shots[int(view)], load(int(view))
        if image is None:
            continue
        mine = views == view
        r, c = _extent(mine.any(axis=1), top), _extent(mine.any(axis=0), left)
        r, c = (max(r[0], top), min(r[1], bottom)), (max(c[0], left), min(c[1], right))
        colour, valid = _project(canvas, r, c, shot, lens, image)
        near = enlarge(mine[r[0] - top : r[1] - top + 2, c[0] - left : c[1] - left + 2].astype(np.float32))
        share = np.asarray(cv2.multiply(near, valid, scale=1 / 255, dtype=cv2.CV_32F))
        weight = _steep(share) + 1e-3 * share  # the latter where more than two views meet and none has half a share
        place = slice((r[0] - top) * BLOCK, (r[1] - top) * BLOCK), slice((c[0] - left) * BLOCK, (c[1] - left) * BLOCK)
        cover[place] += share
        total[place] += cv2.multiply(colour, cv2.merge([weight] * 3))
        summed[place] += weight
    picture = cv2.divide(total, cv2.merge([np.maximum(summed, 1e-6)] * 3), dtype=cv2.CV_8U)
    return np.asarray(picture), _to_uint8(_steep(cover) * 255)


def _steep(share: Grid) -> Grid:
    return np.clip(FEATHER * (share - 0.5) + 0.5, 0, 1)


def _extent(any_in: NDArray[np.bool_], start: int) -> Range:
    """First and last + 1 block whose ring touches; `any_in` has one ring before `start`."""
    found = np.flatnonzero(any_in)
    return int(found[0]) - 2 + start, int(found[-1]) + 1 + start


def _project(canvas: Canvas, rows: Range, columns: Range, shot: Shot, lens: Lens, image: Image) -> tuple[Grid, Image]:
    """Colours (h, w, 3), exposure compensated, of the texels of some blocks in an image; 255 (h, w) where it has."""
    nodes = canvas.nodes(rows, columns)
    local = shot.map_from_camera.inverse().apply(nodes.reshape(-1, 3))
    at_nodes = lens.project(local).reshape(*nodes.shape[:2], 2)
    light = shot.exposure.light(np.minimum(lens.radius_of(at_nodes), 1.0))[..., None]
    if shot.exposure.fixed is not None:
        light = light + shot.exposure.fixed.light(at_nodes, lens.camera, canvas.floor)
    pixels = enlarge(at_nodes.astype(np.float32))
    inside = cv2.inRange(pixels, (0.0, 0.0, 0.0, 0.0), (image.shape[1] - 1.0, image.shape[0] - 1.0, 0.0, 0.0))
    source = pyramid(image, shot.level + 1)[-1]
    at = at_level(pixels, image, source)
    colour = cv2.remap(source, at, None, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
    gain = np.log(shot.exposure.gains[shot.view]) - np.nan_to_num(light)
    factor = enlarge(np.exp(shot.correction.at(rows, columns) + gain.astype(np.float32)))
    return np.asarray(cv2.multiply(colour, factor, dtype=cv2.CV_32F)), np.asarray(inside)


def best_level(footprint: Sequence[float] | Array) -> int:
    """Pyramid level for texels with these footprints, pixels: none that loses what half of the texels could show."""
    return int(level_of(float(np.median(footprint)) / 1.4, 16))


def _to_uint8(values: Grid | Array) -> Image:
    return np.clip(np.round(values), 0, 255).astype(np.uint8)


def _block_means(picture: Image, alpha: Image) -> tuple[Grid, Grid, Grid]:
    """Of blocks: their mean alpha, 0 to 1, the share seen, both (r, c), and the colour (r, c, 3) of that."""
    size = picture.shape[1] // BLOCK, picture.shape[0] // BLOCK
    seen = (alpha >= 128).astype(np.uint8)
    known = cv2.bitwise_and(picture, picture, mask=seen)
    weight, share = (cv2.resize(a, size, interpolation=cv2.INTER_AREA) for a in (alpha, seen.astype(np.float32)))
    mean = cv2.resize(known, size, interpolation=cv2.INTER_AREA).astype(np.float32)
    mean /= np.maximum(share, 1e-3)[..., None]
    return weight.astype(np.float32) / 255, np.asarray(share), mean


def fill_unseen(picture: Image, alpha: Image, inside: NDArray[np.bool_], upright: bool) -> None:
    """Gives the unseen texels of a picture (H, W, 3), whole blocks, in place, what goes on from those around them.

    alpha: (H, W), 255 where it was seen. inside: (H, W) texels on the face. upright: a wall. Colours go on smoothly,
    what repeats repeats, and noise as strong as in what was seen lies on top.
    """
    if not (alpha < 255).any() or not alpha.any():
        return
    rows, columns = picture.shape[0] // BLOCK, picture.shape[1] // BLOCK
    strips = [_texels((top, min(top + TILE, rows))) for top in range(0, rows, TILE)]  # a few at a time: memory
    parts = [_block_means(picture[strip], alpha[strip]) for strip in strips]
    weight, share, mean = (np.concatenate(values) for values in zip(*parts, strict=True))
    repeating = pattern(picture, alpha, inside, (mean, share), upright)
    plain = mean if repeating is None else mean - repeating.blocks(rows, columns)
    smooth = fill_smoothly(plain, np.where(share > 0.1, weight, 0))
    padded = np.pad(smooth, ((1, 1), (1, 1), (0, 0)), mode="edge")
    fine = grain(picture, alpha)
    for (top, bottom), (left, right) in _tiles(rows, columns):
        place = _texels((top, bottom)), _texels((left, right))
        own = alpha[place].astype(np.float32)[..., None] / 255
        if (own < 1).any():
            below = enlarge(padded[top : bottom + 2, left : right + 2])
            if repeating is not None:
                below = below + repeating.texels(*place)
            if fine is not None:
                below = below + repeated(fine, *place)[..., None]
            picture[place] = _to_uint8(picture[place] * own + below * (1 - own))
