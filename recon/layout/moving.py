"""What moved while the drive went on: returns of people and doors, in places that rays passed at other times."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array
from recon.layout.evidence import MAX_CELLS, RESOLUTION

SPELL = 1.0
"""s within which a cell counts as taken if one ray ended in it or beside it."""
CLEAR = 3
"""Spells, at least, in which rays passed a place where something moved ..."""
TAKEN = 0.5
"""... and share of the spells, at most, in which it was taken."""
AROUND = 5
"""Cells, side of the square around a return that is looked at: rays pass at least ..."""
PASSED = 0.8
"""... this share of it. Of a thin thing's they pass 16 of 25 (it takes the cells around its own), of a wall's 15."""


def stays(starts: Array, ends: Array, times: Array) -> NDArray[np.bool_]:
    """(R,) whether rays, sent at times (R,) s, ended at what stayed where it was.

    A place where something moved is passed by rays in most spells of the drive, and so is all around it. A wall is
    never passed, and what is thin stands in the way of some ray whenever others pass beside it.
    """
    from scipy.ndimage import uniform_filter

    from recon.layout.rays import count_spells  # numba takes a while to import

    if len(ends) == 0:
        return np.zeros(0, np.bool_)
    seen = np.concatenate([starts, ends])
    low, high = seen.min(axis=0) - RESOLUTION, seen.max(axis=0) + RESOLUTION
    resolution = max(RESOLUTION, float(np.sqrt(np.prod(high - low) / MAX_CELLS)))
    columns, rows = (np.ceil((high - low) / resolution).astype(int) + 1).tolist()
    spell = np.floor((times - times[0]) / SPELL).astype(np.int64)
    cells = (starts - low) / resolution, (ends - low) / resolution
    taken, clear = count_spells(*cells, spell, rows, columns)
    passed = (clear >= CLEAR) & (taken <= TAKEN * (taken + clear))
    share = uniform_filter(passed.astype(np.float32), AROUND, mode="constant")
    column, row = cells[1].astype(np.int64).T
    return np.asarray(share[row, column] < PASSED)
