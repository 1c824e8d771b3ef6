"""The best few views of every block of a face."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array
from recon.sequence.camera import Camera
from recon.texture.canvas import BLOCK, Canvas
from recon.texture.view import Sight

KEPT = 8
"""Views a block: enough for a median that outvotes clutter."""
BORDER = 0.04
"""Share of the image's height: lenses are worst at the border."""
BORDER_COST, PARTIAL_COST, OBLIQUE_COST = 0.3, 6.0, 0.2
"""Octaves: at the very border, where the border cuts the block, and for each octave between the best and the worst
resolved direction."""


class Candidates:
    """Of n blocks (row by row): costs (n, KEPT), octaves of sharpness lost, inf where fewer; views; colours, uint8.

    radius: (n, KEPT) uint8, distance from the middle of the image, 255 at its corners.
    """

    def __init__(self, blocks: int) -> None:
        self.cost = np.full((blocks, KEPT), np.inf, np.float32)
        self.view = np.full((blocks, KEPT), -1, np.int32)
        self.colour = np.zeros((blocks, KEPT, 3), np.uint8)
        self.radius = np.zeros((blocks, KEPT), np.uint8)

    def offer(self, index: NDArray[np.int64], view: int, cost: Array, colour: NDArray[np.uint8], radius: Array) -> None:
        """View `view` sees blocks `index` (n,) at this cost (n,), in these colours (n, 3): kept if among the best.

        radius: (n,), distance from the middle of the image, 1 at its corners.
        """
        slot = self.cost[index].argmax(axis=1)
        better = cost < self.cost[index, slot]
        place = index[better], slot[better]
        self.cost[place] = cost[better]
        self.view[place] = view
        self.colour[place] = colour[better]
        self.radius[place] = np.clip(np.rint(255 * radius[better]), 0, 255)

    def by_view(self) -> dict[int, tuple[NDArray[np.int64], NDArray[np.int64]]]:
        """For every view, its blocks and the slots it has there."""
        block, slot = np.nonzero(self.view >= 0)
        view = self.view[block, slot]
        order = np.argsort(view, kind="stable")
        starts = np.flatnonzero(np.diff(view[order], prepend=-1))
        parts = np.split(order, starts[1:]) if len(order) else []
        return {int(view[p[0]]): (block[p], slot[p]) for p in parts}


def view_cost(sight: Sight, canvas: Canvas, camera: Camera) -> Array:
    """Octaves (n,) by which the texture loses sharpness in the worst direction, and less than that for other ills."""
    blur = np.maximum(-np.log2(sight.coarse * canvas.texel), 0)
    oblique = np.log2(sight.fine / sight.coarse)
    x, y = sight.pixels.T
    border = np.minimum(np.minimum(x, camera.width - 1 - x), np.minimum(y, camera.height - 1 - y))
    near_border = np.clip(1 - border / (BORDER * camera.height), 0, 1)
    partial = border < 0.5 * BLOCK * canvas.texel * sight.fine
    return np.asarray(blur + OBLIQUE_COST * oblique + BORDER_COST * near_border + PARTIAL_COST * partial)
