"""Which view every block shows: sharp, in large patches, with seams where they do not show.

A Markov random field over the blocks, solved by loopy belief propagation (min-sum, sweeping along rows and columns, as
Tappen and Freeman 2003). The cost of a seam follows how far both views are from what most views agree on, so that seams
avoid whatever the images place differently.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from recon.texture.candidates import KEPT

SEAM, SEAM_LEVEL = 0.35, 0.06
"""Octaves a block side of any seam, and a level (0 to 255) of both views' deviations."""
MOST = 30.0
"""Deviations count up to here, levels."""
SWEEPS = 3
LARGE = np.float32(1e4)

Grid = NDArray[np.float32]
Views = NDArray[np.int32]


def choose_views(cost: Grid, view: Views, deviation: Grid, shape: tuple[int, int]) -> Views:
    """The view (rows, columns) of every block, -1 where it has none.

    cost: (n, KEPT) octaves, inf for empty slots; view, deviation: (n, KEPT) per slot; blocks row by row.
    """
    rows, columns = shape
    full = (rows, columns, KEPT)
    own = np.where(np.isfinite(cost), cost, LARGE).astype(np.float32).reshape(full)
    leave = (SEAM_LEVEL * np.minimum(deviation, MOST) + SEAM / 2).astype(np.float32).reshape(full)
    label = view.reshape(full)
    from recon.texture.kernels import send

    field = _Field(own, leave, label, send)
    for _ in range(SWEEPS):
        for axis in (1, 0):
            field.sweep(axis)
    slot = field.belief().argmin(axis=2)
    chosen = np.take_along_axis(label, slot[..., None], axis=2)[..., 0]
    return np.where(field.known, chosen, -1).astype(np.int32)


class _Field:
    """Messages between blocks. Axis 0: from above and from below; axis 1: from the left and from the right."""

    def __init__(self, own: Grid, leave: Grid, label: Views, send: Callable[..., None]) -> None:
        self.own, self.leave, self.send = own, leave, send
        self.known = np.asarray((label >= 0).any(axis=2))
        self.messages = {(axis, step): np.zeros_like(own) for axis in (0, 1) for step in (1, -1)}
        self.twins = {(axis, step): _twins(label, axis, step) for axis in (0, 1) for step in (1, -1)}

    def belief(self) -> Grid:
        """Cost of every slot, all messages included."""
        return np.asarray(self.own + sum(self.messages.values()))

    def sweep(self, axis: int) -> None:
        """Messages along one axis, forwards and then backwards."""
        across = self.own + self.messages[1 - axis, 1] + self.messages[1 - axis, -1]
        for step in (1, -1):
            self._pass(axis, step, np.moveaxis(np.asarray(across), axis, 0))

    def _pass(self, axis: int, step: int, base: Grid) -> None:
        fields = (self.leave, self.known, self.twins[axis, step], self.messages[axis, step])
        self.send(step, base, *(np.moveaxis(field, axis, 0) for field in fields))


def _twins(label: Views, axis: int, step: int) -> NDArray[np.int64]:
    """For every slot of a block the slot of the same view in the block before it along the axis, -1 for none."""
    before = np.roll(label, step, axis=axis)
    same = (label[..., :, None] == before[..., None, :]) & (label >= 0)[..., None]
    return np.where(same.any(axis=-1), same.argmax(axis=-1), -1)
