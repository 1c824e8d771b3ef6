"""Which value a scanner gives where nothing returned, found in its ranges."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

CELL = 0.01
"""m: the resolution of the scanners in question."""
WIDTH = 2
"""Cells on either side that belong to a spike (51.14, 51.15, 51.16)."""
AROUND = 1.0
"""m on either side of a spike that are nearly empty."""
FARTHEST = 1e4
"""m: no range of any such scanner."""
CONTRAST = 5.0
"""A spike holds so many times what is around it."""
FEWEST, FEWEST_BEAMS = 20, 5
WHOLE_BEAM = 0.9
"""Share of one beam's readings: a beam that says nothing else is blind."""


def no_return_limit(ranges: NDArray[np.float32]) -> float:
    """m: ranges from here on mean that nothing returned; inf where no such value stands out.

    ranges (N, B). A scanner that gives a number for "no return" gives the same one in many directions (or always in
    one), far from what it measures: a spike in the upper half of the ranges with next to nothing around it. There may
    be several; the lowest counts, for beyond it nothing is measured.
    """
    with np.errstate(invalid="ignore"):
        finite, farther = (ranges > 0) & (ranges < FARTHEST), (ranges >= FARTHEST) & np.isfinite(ranges)
    beyond = FARTHEST if farther.any() else np.inf
    if not finite.any():
        return beyond
    cells = np.rint(ranges[finite] / CELL).astype(np.int64)
    beams = np.broadcast_to(np.arange(ranges.shape[1]), ranges.shape)[finite]
    counts = np.bincount(cells)
    total = np.concatenate([[0], np.cumsum(counts)])

    def between(low: int, high: int) -> int:
        low, high = max(low, 0), min(high, len(counts))
        return int(total[high] - total[low]) if high > low else 0

    reach = round(AROUND / CELL)
    for cell in (int(c) for c in np.flatnonzero(counts >= FEWEST // 2)):
        if cell < len(counts) / 2:
            continue
        spike = between(cell - WIDTH, cell + WIDTH + 1)
        around = between(cell - reach, cell + reach + 1) - spike
        if spike < max(FEWEST, CONTRAST * around):
            continue
        inside = np.abs(cells - cell) <= WIDTH
        per_beam = np.bincount(beams[inside])
        if np.count_nonzero(per_beam) >= FEWEST_BEAMS or per_beam.max() > WHOLE_BEAM * len(ranges):
            return float(cells[inside].min() - 0.5) * CELL
    return beyond
