"""What most of the places to which a cell can be moved agree on, compiled."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Grid = NDArray[np.float32]
Mask = NDArray[np.bool_]
Moves = NDArray[np.int64]

LEAST = 3
"""Fewer places cannot agree."""


@njit(cache=True, nogil=True)
def consent(detail: Grid, known: Mask, wanted: Mask, moves: Moves, rounds: int, alike: float) -> Grid:
    """The median (r, c, 3) of detail (r, c, 3) over known (r, c) cells at `moves` (K, 2), 0 where they are too few.

    It is damped where fewer than three quarters of them lie within `alike` of it, to nothing at a half. Cells `wanted`
    (r, c) and not known follow from ring to ring, `rounds` times: what was found counts as known for the next.
    """
    rows, columns = known.shape
    out, source, have = np.zeros_like(detail), detail.copy(), known.copy()
    values = np.empty((3, len(moves)), np.float32)
    for turn in range(rounds):
        found, grown = have.copy(), 0
        for i in range(rows):
            for j in range(columns):
                asked = wanted[i, j] and not have[i, j]
                if not asked and (turn > 0 or not known[i, j]):
                    continue
                n = _gather(source, have, moves, i, j, values)
                if n < LEAST:
                    continue
                _agreed(values[:, :n], alike, out[i, j])
                if asked:
                    found[i, j] = True
                    source[i, j] = out[i, j]
                    grown += 1
        have = found
        if grown == 0:
            break
    return out


@njit(cache=True, nogil=True)
def _gather(source: Grid, have: Mask, moves: Moves, i: int, j: int, values: Grid) -> int:
    """Puts what is known at the moves from a cell into values (3, K), from the left; returns how many there are."""
    n = 0
    for k in range(len(moves)):
        a, b = i + moves[k, 0], j + moves[k, 1]
        if 0 <= a < have.shape[0] and 0 <= b < have.shape[1] and have[a, b]:
            for c in range(3):
                values[c, n] = source[a, b, c]
            n += 1
    return n


@njit(cache=True, nogil=True)
def _agreed(values: Grid, alike: float, out: Grid) -> None:
    """The damped median (3,) of values (3, n), into `out`."""
    away = np.zeros(values.shape[1], np.float32)
    for c in range(3):
        out[c] = np.median(values[c])
        away = np.maximum(away, np.abs(values[c] - out[c]))
    share = (away < alike).sum() / len(away)
    out *= np.float32(min(max(4 * share - 2, 0.0), 1.0))
