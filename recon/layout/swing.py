"""Where an open door's leaf stands: straight, as wide as its gap, hinged at one of the gap's ends, and not a wall."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array
from recon.layout.evidence import FreeSpace
from recon.model import Wall

TURNS = np.radians(np.arange(20.0, 341.0, 2.0))
"""From the gap to its leaf, to either side; flatter ones are the wall itself."""
FLAT = np.sin(np.radians(20.0))
HINGES = np.stack(np.meshgrid([-0.05, 0.0, 0.05], [0.05, 0.0, -0.05, -0.1, -0.15, -0.2, -0.3, -0.4]), axis=-1)
"""m along the wall and across it from an end of the gap: a leaf hangs in either face of a wall."""
LEAF = 0.2, 0.9
"""Stretch of a leaf, in widths of its gap from the hinge, along which it is looked for ..."""
SEEN = 0.85
"""... and the share of it where it must have been seen."""
BEYOND = 1.15, 1.5
"""There nothing goes on straight ..."""
EMPTY = 0.3
"""... but for this share, at most."""
BESIDE = 0.2
"""m beside a leaf, where rays passed on one side at least."""
FREE = 0.6
WALL = 5
"""Cells, the width of a wall of the plan: what lies within is that wall."""


class Swings:
    """What stands in a building, asked for leaves of open doors; walls: those of its plan."""

    def __init__(self, walls: list[Wall], space: FreeSpace) -> None:
        self._space = space
        wall_cells = np.zeros(space.free.shape, np.uint8)
        for wall in walls:
            if wall.source != "inferred":
                ends = np.round((np.stack([wall.start, wall.end]) - space.origin) / space.resolution - 0.5)
                cv2.polylines(wall_cells, [ends.astype(np.int32)[:, None]], False, 1, WALL)
        self._blocked = _grown(space.blocked)
        self._standing = _grown(space.blocked & (wall_cells == 0))

    def has_leaf(self, wall: Wall, low: float, high: float) -> bool:
        """Whether the leaf of the gap from `low` to `high` m along a wall stands open, on either side of it."""
        width = high - low
        for end, way in ((low, 1.0), (high, -1.0)):
            along = end + way * HINGES.reshape(-1, 2)[:, :1]
            hinge = wall.start + along * wall.direction + HINGES.reshape(-1, 2)[:, 1:] * wall.normal
            step = np.cos(TURNS)[:, None] * way * wall.direction + np.sin(TURNS)[:, None] * wall.normal
            step = step[np.abs(np.sin(TURNS)) > FLAT]
            hinge, step = np.repeat(hinge, len(step), axis=0), np.tile(step, (len(hinge), 1))
            stands = self._shares(self._standing, hinge, step, LEAF, width) >= SEEN
            hinge, step = hinge[stands], step[stands]
            stands = self._shares(self._blocked, hinge, step, BEYOND, width) <= EMPTY
            hinge, step = hinge[stands], step[stands]
            side = BESIDE * np.stack([-step[:, 1], step[:, 0]], axis=1)
            free = [self._shares(self._space.free, hinge + s * side, step, LEAF, width) >= FREE for s in (-1.0, 1.0)]
            if (free[0] | free[1]).any():
                return True
        return False

    def _shares(
        self, mask: NDArray[np.bool_], start: Array, step: Array, span: tuple[float, float], width: float
    ) -> Array:
        """(n,) share of cells set in a mask along ways from `start` (n, 2), over a span counted in `width`."""
        distance = np.arange(span[0] * width, span[1] * width, self._space.resolution / 2)
        points = start[:, None] + distance[:, None] * step[:, None]
        return np.asarray(
            mask[self._space.index(points.reshape(-1, 2))].reshape(len(start), len(distance)).mean(axis=1)
        )


def _grown(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    return np.asarray(cv2.dilate(mask.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0)
