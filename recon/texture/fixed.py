"""What stays in the same place of every image: the platform's own shadow or shine, and the platform where it shows.

A point of a face passes through many places of the image as the platform moves. A place where it is darker, or
brighter, than in others, whatever the point and whatever the image, belongs to the platform and not to the face.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array
from recon.sequence.camera import Camera

ROWS, COLUMNS = 24, 32
"""Cells of the image; each kind of face has its own, as a shadow lies on the floor and not on what is before it."""
UPRIGHT, FLOOR = 0, 1
SHAPE = 2, ROWS, COLUMNS
CELLS = 2 * ROWS * COLUMNS
STRONG = 0.12
"""Logarithm: what is less than this, gains and the shading of the lens take up, or corrections of single views."""
LEAST_IMAGES, SAME, SPREAD = 4, 0.75, 0.5
"""Images a cell needs; share of them that say the same, at least by half; their robust deviation as a share of it."""
LEAST_CELLS, MOST_CELLS = 4, 0.4
"""Cells in one piece that count; more than this share of those known is a floor that shines, and no shadow."""
ROUNDS = 16
"""Most times that what was found is left out of the consensus, which tells the rest from it."""
NOISE = 0.15
"""As in `gains`."""
CLIP, OPAQUE = 1.5, 1.2
"""Logarithm: residuals count up to here; from here on nothing of the face is left."""
JUMP = 0.3
"""Logarithm: between neighbours, from here on no factor makes up for it everywhere."""
UNMOVED = 0.7
"""Deviation of colours, as a share of that of residuals, below which a cell shows the platform and not the face."""

Index = NDArray[np.int64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Fixed:
    """log: (2, ROWS, COLUMNS, 3), logarithm of the share of light that arrives, 0 where nothing is fixed.

    doubtful, hidden: (2, ROWS, COLUMNS), where to look last, and where not to: the platform, or a shadow's edge.
    """

    log: Array
    doubtful: Mask
    hidden: Mask

    def light(self, pixels: Array, camera: Camera, floor: bool) -> Array:
        """Logarithm (..., 3) of the share of light at pixels (..., 2), linear between cells' middles; nan: any."""
        x, y = (np.nan_to_num(p).astype(np.float32).reshape(-1, 1) for p in np.moveaxis(pixels, -1, 0))
        at = ((x + 0.5) * (COLUMNS / camera.width) - 0.5, (y + 0.5) * (ROWS / camera.height) - 0.5)
        grid, low = self.log[int(floor)], [np.floor(part).astype(np.int64) for part in at]
        column = np.clip(np.concatenate([low[0], low[0] + 1], axis=1), 0, COLUMNS - 1)
        row = np.clip(np.concatenate([low[1], low[1] + 1], axis=1), 0, ROWS - 1)
        right, down = at[0] - low[0], at[1] - low[1]
        top = grid[row[:, 0], column[:, 0]] * (1 - right) + grid[row[:, 0], column[:, 1]] * right
        bottom = grid[row[:, 1], column[:, 0]] * (1 - right) + grid[row[:, 1], column[:, 1]] * right
        return np.asarray(top * (1 - down) + bottom * down).reshape(*pixels.shape[:-1], 3)

    def lit(self, colours: NDArray[np.uint8], pixels: Array, camera: Camera, floor: bool) -> NDArray[np.uint8]:
        """Colours (n, 3) at pixels (n, 2) as they would be without."""
        factor = np.exp(-self.light(pixels, camera, floor))
        return np.clip(np.rint(colours * factor), 0, 255).astype(np.uint8)

    def at(self, pixels: Array, camera: Camera, floor: bool) -> tuple[Mask, Mask]:
        """Whether pixels (n, 2) are doubtful (n,), and whether they are not to be used (n,)."""
        cells = cell_of(pixels, camera, floor)
        return self.doubtful.ravel()[cells], self.hidden.ravel()[cells]


def cell_of(pixels: Array, camera: Camera, floor: bool) -> Index:
    """The cell (n,) of pixels (n, 2) on a floor or on any other face."""
    column = np.clip((pixels[:, 0] + 0.5) * (COLUMNS / camera.width), 0, COLUMNS - 1).astype(np.int64)
    row = np.clip((pixels[:, 1] + 0.5) * (ROWS / camera.height), 0, ROWS - 1).astype(np.int64)
    return np.asarray((int(floor) * ROWS + row) * COLUMNS + column)


@dataclass(frozen=True)
class Seen:
    """Samples (S,): number of the point, image, cell, logarithm (S, 3) of the colour with gain and shading made up for,
    and whether that is neither dark nor clipped."""

    point: Index
    view: Index
    cell: Index
    log: Array
    valid: Mask

    def residuals(self, masked: Mask) -> tuple[Array, Mask]:
        """(S, 3) what each differs by from the robust mean of its point's valid samples outside of cells `masked`
        (CELLS,), and (S,) for which at least two others tell."""
        usable = self.valid & ~masked[self.cell]
        count = int(self.point.max()) + 1
        weights = usable.astype(np.float64)
        away = np.zeros_like(self.log)
        for _ in range(6):
            total = np.maximum(np.bincount(self.point, weights, count), 1e-12)
            mean = np.stack([np.bincount(self.point, weights * c, count) for c in self.log.T], axis=1) / total[:, None]
            away = self.log - mean[self.point]
            weights = usable / (1 + (np.abs(away).max(axis=1) / NOISE) ** 2) ** 2
        known = np.bincount(self.point, usable, count)[self.point] - usable >= 2
        return np.clip(away, -CLIP, CLIP), known


@dataclass(frozen=True)
class _Cells:
    """What images say of each cell: how many do, their median, robust deviation, and the share that says the same."""

    images: Index
    median: Array
    spread: Array
    same: Array

    @staticmethod
    def of(values: Array, cell: Index, view: Index) -> _Cells:
        """Each image's mean of values (n,) in each cell counts once."""
        views = int(view.max(initial=0)) + 1
        pairs, inverse = np.unique(cell * views + view, return_inverse=True)
        means = np.bincount(inverse, values) / np.maximum(np.bincount(inverse), 1)
        owner = pairs // views
        images = np.bincount(owner, minlength=CELLS)
        median = _medians(means, owner)
        off = np.abs(means - median[owner])
        agrees = means * np.sign(median[owner]) > 0.5 * np.abs(median[owner])
        same = np.bincount(owner, agrees, CELLS) / np.maximum(images, 1)
        return _Cells(images, median, 1.4826 * _medians(off, owner), same)

    @property
    def strong(self) -> Mask:
        """(CELLS,) those that differ from the rest, and always by the same."""
        sure = (self.images >= LEAST_IMAGES) & (self.same > SAME) & (self.spread < SPREAD * np.abs(self.median))
        return np.asarray(sure & (np.abs(self.median) > STRONG))


def _medians(values: Array, owner: Index) -> Array:
    """(CELLS,) median of the values (n,) of each owner (n,), 0 where it has none."""
    ranked = values[np.lexsort((values, owner))]
    count = np.bincount(owner, minlength=CELLS)
    start = np.cumsum(count) - count
    out = np.zeros(CELLS)
    some = count > 0
    low, high = (start + (count - 1) // 2)[some], (start + count // 2)[some]
    out[some] = 0.5 * (ranked[low] + ranked[high])
    return out


def find_fixed(seen: Seen) -> Fixed | None:
    """What is fixed to the image; None where nothing is.

    The strongest cells are looked for first and left out of what the others are compared with, again and again: points
    that were seen under a shadow most of the time look as dark as it at first.
    """
    found = np.zeros(CELLS, bool)
    if not len(seen.point):
        return None
    for turn in range(ROUNDS):
        away, known = seen.residuals(_widened(found))
        cells = _Cells.of(away[known].mean(axis=1), seen.cell[known], seen.view[known])
        strong = cells.strong
        if turn == 0 and strong.any():
            strong &= np.abs(cells.median) > 0.5 * np.abs(cells.median[strong]).max()
        if not (strong & ~found).any():
            break
        found |= strong
    kept = _pieces(found & cells.strong)
    wide = _widened(kept)
    if not kept.any() or _too_much(wide, cells.images):
        return None
    channels = [_Cells.of(c, seen.cell[known], seen.view[known]).median for c in away[known].T]
    log = np.where(kept[:, None], np.stack(channels, axis=1), 0.0)
    colours = _Cells.of(seen.log[known].mean(axis=1), seen.cell[known], seen.view[known])
    platform = _widened(_unmoved(kept, colours.spread, cells)).reshape(SHAPE)
    hidden = platform | platform[::-1] | _edges(log.mean(axis=1)).reshape(SHAPE)
    unknown = (cells.images < LEAST_IMAGES).reshape(SHAPE) & wide.reshape(SHAPE)[::-1]
    return Fixed(log.reshape(*SHAPE, 3), wide.reshape(SHAPE) | unknown | hidden, hidden)


def _widened(cells: Mask) -> Mask:
    """With those around: edges lie in them."""
    kernel = np.ones((3, 3), np.uint8)
    kinds = cells.reshape(SHAPE).astype(np.uint8)
    return np.concatenate([cv2.dilate(kind, kernel).ravel() for kind in kinds]).astype(bool)


def _edges(log: Array) -> Mask:
    """(CELLS,) where log (CELLS,) jumps between neighbours: a hard edge lies somewhere there."""
    kernel = np.ones((3, 3), np.uint8)
    kinds = log.reshape(SHAPE)
    steps = [cv2.dilate(kind, kernel) - cv2.erode(kind, kernel) for kind in kinds]
    return np.asarray(np.stack(steps).ravel() > JUMP)


def _labels(cells: Mask) -> Index:
    """(CELLS,) number of the piece of each cell, 0 outside."""
    both = np.zeros((2 * ROWS + 1, COLUMNS), np.uint8)
    both[:ROWS], both[ROWS + 1 :] = cells.reshape(SHAPE)
    labels = cv2.connectedComponents(both, connectivity=8)[1]
    return np.concatenate([labels[:ROWS].ravel(), labels[ROWS + 1 :].ravel()]).astype(np.int64)


def _pieces(cells: Mask) -> Mask:
    """Those in pieces of LEAST_CELLS or more."""
    labels = _labels(cells)
    return np.asarray(cells & (np.bincount(labels)[labels] >= LEAST_CELLS))


def _too_much(cells: Mask, images: Index) -> bool:
    """Whether these are most of the cells known of a kind of face."""
    known = (images >= LEAST_IMAGES).reshape(2, -1)
    share = (cells.reshape(2, -1) & known).sum(axis=1) / np.maximum(known.sum(axis=1), 1)
    return bool(share.max() > MOST_CELLS)


def _unmoved(kept: Mask, colours: Array, cells: _Cells) -> Mask:
    """Those pieces that show the same while faces move past, or hardly any light."""
    labels = _labels(kept)
    out = np.zeros(CELLS, bool)
    for piece in range(1, int(labels.max()) + 1):
        mine = labels == piece
        still = np.median(colours[mine]) < UNMOVED * np.median(cells.spread[mine])
        out |= mine & (still | (np.median(np.abs(cells.median[mine])) > OPAQUE))
    return out
