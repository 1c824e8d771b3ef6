"""What most views of a block agree on: clutter in front of a face stands out, and shine and shade are evened out."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.texture.candidates import KEPT, Candidates
from recon.texture.gains import Exposure

MIN_VIEWS = 3
"""Fewer views cannot outvote one that is wrong."""
CLUTTER_FROM, CLUTTER_TO, CLUTTER_COST = 22.0, 60.0, 5.0
"""Levels (0 to 255) by which a patch differs where its cost starts and where it is full, and that cost in octaves."""
DULLER = 25.0
"""Levels: a view that is a grey amount brighter, or by so much darker, shows the same thing with and without shine."""
AGREE, MAJORITY, UNANIMITY = 20.0, 0.5, 0.75
"""Levels within which views agree; shares of views that do so where their word starts to count and where it is law."""
CORRECTION, TINT = 0.7, 0.1
"""Largest correction of brightness and of hue, logarithm: shine and shade are grey, clutter need not be."""
REACH, HOLD = 3.0, 0.03
"""Blocks: standard deviation of the smoothing of corrections; weight of no correction, where little is trusted."""

PART = 1 << 15
"""Blocks looked at together: for memory."""

Slots = tuple[NDArray[np.int64], NDArray[np.int64]]
"""Blocks of a view, and its slot in each."""


@dataclass(frozen=True)
class Consensus:
    """Of n blocks: colour (n, 3), 0 to 255, the median of views; count (n,) of views; deviation (n, KEPT) from it.

    trust: (n,), 0 to 1, whether enough views agree for the others to be wrong.
    """

    colour: NDArray[np.float32]
    count: NDArray[np.int64]
    deviation: NDArray[np.float32]
    trust: NDArray[np.float32]


def agree(candidates: Candidates, exposure: Exposure) -> Consensus:
    """The median colour of each block's views, channel by channel, exposure compensated."""
    starts = range(0, max(len(candidates.view), 1), PART)
    parts = [_agree(candidates, slice(start, start + PART), exposure) for start in starts]
    return Consensus(
        np.concatenate([part.colour for part in parts]),
        np.concatenate([part.count for part in parts]),
        np.concatenate([part.deviation for part in parts]),
        np.concatenate([part.trust for part in parts]),
    )


def _agree(candidates: Candidates, part: slice, exposure: Exposure) -> Consensus:
    view = candidates.view[part]
    known = view >= 0
    gains = exposure.gains.astype(np.float32)[np.maximum(view, 0)]
    colours = candidates.colour[part] * gains * _lit(exposure, candidates.radius[part])
    colours[~known] = np.inf
    count = known.sum(axis=1)
    ranked = np.sort(colours, axis=1)
    rows = np.arange(len(ranked))
    low, high = ranked[rows, np.maximum(count - 1, 0) // 2], ranked[rows, np.minimum(count // 2, KEPT - 1)]
    median = np.where(count[:, None] > 0, 0.5 * (low + high), 0).astype(np.float32)
    colours[~known] = 0
    away = colours - median[:, None]
    gleam, dullness = away.min(axis=2, keepdims=True), away.max(axis=2, keepdims=True)
    away -= np.maximum(gleam, 0) + np.clip(dullness, -DULLER, 0)
    deviation = np.abs(away).max(axis=2)
    deviation[~known] = 0
    share = (known & (deviation < AGREE)).sum(axis=1) / np.maximum(count, 1)
    trust = np.clip((share - MAJORITY) / (UNANIMITY - MAJORITY), 0, 1) * (count >= MIN_VIEWS)
    return Consensus(median, count, np.minimum(deviation, 255), trust.astype(np.float32))


def _lit(exposure: Exposure, radius: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Factor (..., 1) on colours at `radius` (...), 255 in the corners, that makes up for the lens's shading."""
    table = np.exp(-exposure.light(np.arange(256) / 255)).astype(np.float32)
    return np.asarray(table[radius][..., None])


def clutter_cost(candidates: Candidates, consensus: Consensus, shape: tuple[int, int]) -> NDArray[np.float32]:
    """Octaves (n, KEPT) on views that show something in front of the face.

    Only patches at least three blocks wide count: what is thinner is an edge that images place a little differently.
    With them count the blocks around, which show a part.
    """
    out = np.zeros(candidates.cost.shape, np.float32)
    for block, slot in candidates.by_view().values():
        window = Window.around(block, shape)
        share = (consensus.deviation[block, slot] - CLUTTER_FROM) / (CLUTTER_TO - CLUTTER_FROM)
        grid = window.scatter(block, np.clip(share, 0, 1) * consensus.trust[block], np.inf)
        core = cv2.erode(grid, np.ones((3, 3), np.uint8))
        core[np.isinf(grid)] = 0
        out[block, slot] = CLUTTER_COST * window.gather(cv2.dilate(core, np.ones((5, 5), np.uint8)), block)
    return out


@dataclass(frozen=True)
class Window:
    """A rectangle of blocks, rows top to before bottom, columns left to before right, of a grid `columns` wide."""

    top: int
    bottom: int
    left: int
    right: int
    columns: int

    @staticmethod
    def around(block: NDArray[np.int64], shape: tuple[int, int]) -> Window:
        """The smallest that holds these blocks."""
        row, column = np.divmod(block, shape[1])
        return Window(int(row.min()), int(row.max()) + 1, int(column.min()), int(column.max()) + 1, shape[1])

    def _place(self, block: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        row, column = np.divmod(block, self.columns)
        return row - self.top, column - self.left

    def scatter(self, block: NDArray[np.int64], values: NDArray[np.float32], empty: float) -> NDArray[np.float32]:
        """A grid with `values` (n, ...) at the blocks and `empty` elsewhere."""
        grid = np.full((self.bottom - self.top, self.right - self.left, *values.shape[1:]), empty, np.float32)
        grid[self._place(block)] = values
        return grid

    def gather(self, grid: NDArray[np.float32], block: NDArray[np.int64]) -> NDArray[np.float32]:
        """The grid's values at the blocks."""
        return np.asarray(grid[self._place(block)])


@dataclass(frozen=True)
class Correction:
    """Logarithm (rows, columns, 3) to add to a view's colours on a face so that shine and shade agree with the rest."""

    window: Window
    log: NDArray[np.float32]

    def at(self, rows: tuple[int, int], columns: tuple[int, int]) -> NDArray[np.float32]:
        """Values (r + 2, c + 2, 3) at `Canvas.nodes`; held beyond the window."""
        r = np.clip(np.arange(rows[0] - 1, rows[1] + 1) - self.window.top, 0, self.log.shape[0] - 1)
        c = np.clip(np.arange(columns[0] - 1, columns[1] + 1) - self.window.left, 0, self.log.shape[1] - 1)
        return np.asarray(self.log[np.ix_(r, c)])


def correct(
    candidates: Candidates, consensus: Consensus, exposure: Exposure, view: int, seen: Slots, shape: tuple[int, int]
) -> Correction:
    """The smooth difference between the consensus and one view (its blocks and slots are `seen`)."""
    block, slot = seen
    factor = exposure.gains[view].astype(np.float32) * _lit(exposure, candidates.radius[block, slot])
    own = np.log(candidates.colour[block, slot] * factor + 4.0)
    log = np.log(consensus.colour[block] + 4.0) - own
    brightness = log.mean(axis=1, keepdims=True)
    log = np.clip(brightness, -CORRECTION, CORRECTION) + np.clip(log - brightness, -TINT, TINT)
    weight = consensus.trust[block] * np.exp(-0.5 * (consensus.deviation[block, slot] / AGREE) ** 2)
    window = Window.around(block, shape)
    total = window.scatter(block, np.column_stack([log * weight[:, None], weight]), 0.0)
    smooth = cv2.GaussianBlur(total, (0, 0), REACH, borderType=cv2.BORDER_CONSTANT)
    return Correction(window, np.asarray(smooth[..., :3] / (smooth[..., 3:] + HOLD), dtype=np.float32))
