"""Inner loops, compiled."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Grid = NDArray[np.float32]


@njit(cache=True, nogil=True)
def send(step: int, base: Grid, leave: Grid, known: NDArray[np.bool_], twin: NDArray[np.int64], message: Grid) -> None:
    """Messages along the first axis, in place, of a grid of blocks (rows, columns) with a number of slots each.

    base: (r, c, slots) cost of every slot and of what the other axis says; leave: (r, c, slots) cost of a seam there;
    known: (r, c); twin: (r, c, slots) slot of the same view in the block before, -1 for none. step: 1 or -1.
    """
    rows, columns, slots = base.shape
    state = np.empty(slots, np.float32)
    for n in range(1, rows):
        target = n if step > 0 else rows - 1 - n
        source = target - step
        for c in range(columns):
            if not (known[source, c] and known[target, c]):
                message[target, c, :] = 0
                continue
            change = np.float32(np.inf)
            for k in range(slots):
                state[k] = base[source, c, k] + message[source, c, k]
                change = min(change, state[k] + leave[source, c, k])
            least = np.float32(np.inf)
            for k in range(slots):
                sent = change + leave[target, c, k]
                if twin[target, c, k] >= 0:
                    sent = min(sent, state[twin[target, c, k]])
                message[target, c, k] = sent
                least = min(least, sent)
            for k in range(slots):
                message[target, c, k] -= least
