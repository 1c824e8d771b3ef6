"""What goes on where no image saw a face: skirtings and bands along walls, tiles of floors, panels of ceilings.

What is there once, a poster or a stain, does not go on. Light and shade are left to the smooth fill.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array
from recon.texture.canvas import BLOCK
from recon.texture.fill import UNUSUAL, Grid
from recon.texture.repeats import moves
from recon.texture.view import Image

SURROUNDINGS = 12.0
"""Blocks, standard deviation: what is wider is light and shade."""
TURNS = 3
"""Times that this is found for a wall; after each, what is unlike it by more than UNUSUAL, a poster, counts for less.
Of tiles, all count."""
ALIKE = 14.0
"""Levels within which places agree."""
STEADY = 6.0
"""Texels, standard deviation, up and down a wall: agreement does not come and go from row to row."""
COLUMNS, LEAST_COLUMNS = 128, 10
"""Of a wall that are looked at, and in how many of them a height must have been seen."""
SHADE = 18.0
"""Levels: what differs by more at the last height seen does not go on above it."""
CELL = 4
"""Texels a side of the cells of a floor's pattern."""
ROUNDS = 8
"""Moves that follow one another: farther away, nothing is sure."""
LEAST_BLOCKS = 8
"""Blocks a side of a face: less holds no pattern."""

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Pattern:
    """What repeats on a face, levels about its light and shade. cells: of `height` x `width` texels each."""

    cells: Grid
    height: int
    width: int

    def blocks(self, rows: int, columns: int) -> Grid:
        """(rows, columns, 3): means over blocks."""
        return np.asarray(cv2.resize(self.cells, (columns, rows), interpolation=cv2.INTER_AREA))

    def texels(self, rows: slice, columns: slice) -> Grid:
        """(rows, columns, 3), linear between cells."""
        y = (np.arange(rows.start, rows.stop, dtype=np.float32) + 0.5) / self.height - 0.5
        x = (np.arange(columns.start, columns.stop, dtype=np.float32) + 0.5) / self.width - 0.5
        across, down = np.meshgrid(x, y)
        return np.asarray(cv2.remap(self.cells, across, down, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE))


def pattern(picture: Image, alpha: Image, inside: Mask, blocks: tuple[Grid, Grid], upright: bool) -> Pattern | None:
    """Of a picture (H, W, 3), whole blocks, seen where alpha (H, W) is 255; None where nothing is sure to go on.

    inside: (H, W) texels on the face. blocks: colours (r, c, 3) of what was seen of each, and its share (r, c).
    upright: a wall, along which things go on level; else they go on by whatever move makes the face look like itself.
    """
    mean, share = blocks
    if min(share.shape) < LEAST_BLOCKS or not (share > 0.9).any():
        return None
    around = _surroundings(mean, share, TURNS if upright else 1)
    if upright:
        return _along(picture, alpha, around)
    steps = moves(mean - around, share > 0.9)
    return _repeating(picture, alpha, inside, around, steps) if len(steps) else None


def _surroundings(mean: Grid, share: Grid, turns: int) -> Grid:
    """Light and shade (r, c, 3): wide means of blocks; after the first turn what is unlike them counts for less."""
    weight = share[..., None]
    for _ in range(turns):
        total = cv2.GaussianBlur(np.concatenate([mean * weight, weight], axis=2), (0, 0), SURROUNDINGS)
        around = np.asarray(total[..., :3] / np.maximum(total[..., 3:], 1e-4))
        away = np.abs(mean - around).max(axis=2, keepdims=True)
        weight = share[..., None] / (1 + (away / UNUSUAL) ** 2)
    return around


def _along(picture: Image, alpha: Image, around: Grid) -> Pattern | None:
    """One profile from bottom to top: at each height the median along the wall, damped where columns disagree.

    Above and below what was seen the last height goes on, unless it stands out.
    """
    height, width = alpha.shape
    step = max(width // COLUMNS, 1)
    columns = np.arange(step // 2, width, step)
    base = cv2.resize(around, (around.shape[1], height), interpolation=cv2.INTER_LINEAR)[:, columns // BLOCK]
    seen = alpha[:, columns] == 255
    median, weight = _agreed(np.where(seen[..., None], picture[:, columns] - base, np.inf), seen.sum(axis=1))
    profile = (median * weight[:, None]).astype(np.float32)
    if not profile.any():
        return None
    rows, found = np.arange(height), np.flatnonzero(seen.sum(axis=1) >= LEAST_COLUMNS)
    beyond = (rows < found[0]) | (rows > found[-1])
    held = np.clip(profile[np.clip(rows, found[0], found[-1])], -SHADE, SHADE)
    return Pattern(np.where(beyond[:, None], held, profile)[:, None], 1, width)


def _agreed(detail: Grid, count: NDArray[np.int64]) -> tuple[Grid, Grid]:
    """Median (h, 3) of each row of detail (h, n, 3), of which `count` (h,) are known and the others inf; and how much
    (h,) of it the row agrees on."""
    rows, most = np.arange(len(detail)), detail.shape[1] - 1
    ranked = np.sort(detail, axis=1)
    median = 0.5 * (ranked[rows, np.maximum(count - 1, 0) // 2] + ranked[rows, np.minimum(count // 2, most)])
    median[count < LEAST_COLUMNS] = 0
    share = (np.abs(detail - median[:, None]).max(axis=2) < ALIKE).sum(axis=1) / np.maximum(count, 1)
    weight = np.clip(4 * share - 2, 0, 1) * np.clip(2 * count / LEAST_COLUMNS - 2, 0, 1)
    steady = cv2.GaussianBlur(weight[:, None], (1, 0), 0, sigmaY=STEADY, borderType=cv2.BORDER_REPLICATE)
    return median, np.asarray(steady[:, 0])


def _repeating(picture: Image, alpha: Image, inside: Mask, around: Grid, steps: Array) -> Pattern | None:
    """What most of the places agree on to which the face can be moved, by `steps` (K, 2) blocks."""
    from recon.texture.consent import consent

    size = (alpha.shape[1] // CELL, alpha.shape[0] // CELL)
    fine = cv2.resize(picture, size, interpolation=cv2.INTER_AREA).astype(np.float32)
    fine -= cv2.resize(around, size, interpolation=cv2.INTER_LINEAR)
    known = cv2.resize(alpha, size, interpolation=cv2.INTER_AREA) == 255
    wanted = inside[::CELL, ::CELL] & ~known
    cells = consent(fine, known, wanted, np.rint(steps * (BLOCK // CELL)).astype(np.int64), ROUNDS, ALIKE)
    return Pattern(cells, CELL, CELL) if cells.any() else None
