"""Scans of a log on one grid of bearings: scanners that count their beams anew every turn included."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Ranges = NDArray[np.float32]

ON_GRID = 0.1
"""Of a beam's step: beams closer to the common grid's are its own."""
FINER = 4
"""Cells a beam where beams lie anywhere: bearings are then off by an eighth of a step at most."""
MAX_BEAMS = 16384


@dataclass(frozen=True)
class Sweep:
    """One scan: ranges (B,) m, bearing of beam b is start + b * step, rad."""

    start: float
    step: float
    ranges: Ranges


@dataclass(frozen=True)
class Grid:
    """Ranges (N, B) of `kept` (M,) sweeps, N of them kept: bearing of beam b is start + b * step, rad."""

    start: float
    step: float
    ranges: Ranges
    kept: NDArray[np.bool_]


def common_grid(sweeps: Sequence[Sweep]) -> Grid:
    """One grid for all sweeps; cells without a beam are nan.

    Mostly they have one grid already: then the few that do not (under 5 %) are left out. Scanners whose beams lie
    elsewhere every turn get a finer grid; a beam then fills the cell nearest to it.
    """
    start, step = (float(v) for v in np.median([(s.start, s.step) for s in sweeps], axis=0))
    size = int(np.median([len(s.ranges) for s in sweeps]))
    usual = [s for s in sweeps if len(s.ranges) == size and abs(s.step - step) * size < ON_GRID * abs(step)]
    if usual:  # a median of starts may lie between two kinds
        start = float(np.median([s.start for s in usual]))
    offsets = np.array([(s.start - start) / step for s in sweeps])
    drift = np.array([abs(s.step - step) * len(s.ranges) / abs(step) for s in sweeps])
    on_grid = (np.abs(offsets - np.rint(offsets)) < ON_GRID) & (drift < ON_GRID)
    on_grid &= np.array([0.5 < len(s.ranges) / size < 2 for s in sweeps])
    if on_grid.mean() < 0.95:
        on_grid[:] = True
        step /= FINER
    first = min(_cells(s, start, step)[0] for s, ok in zip(sweeps, on_grid, strict=True) if ok)
    last = max(_cells(s, start, step)[-1] for s, ok in zip(sweeps, on_grid, strict=True) if ok)
    beams = min(int(last - first) + 1, MAX_BEAMS, max(int(2 * np.pi / abs(step) * 1.02), 1) + 1)
    ranges = np.full((int(on_grid.sum()), beams), np.nan, dtype=np.float32)
    for row, sweep in zip(ranges, (s for s, ok in zip(sweeps, on_grid, strict=True) if ok), strict=True):
        cells = _cells(sweep, start, step) - first
        inside = cells < beams
        row[cells[inside]] = sweep.ranges[inside]
    return Grid(start + float(first) * step, step, ranges, on_grid)


def _cells(sweep: Sweep, start: float, step: float) -> NDArray[np.int64]:
    bearings = sweep.start + sweep.step * np.arange(len(sweep.ranges))
    return np.rint((bearings - start) / step).astype(np.int64)
