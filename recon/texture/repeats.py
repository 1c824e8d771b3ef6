"""Moves by which a picture looks like itself: the tiles of a floor, the panels of a ceiling.

Found by autocorrelation (the offsets of He and Sun 2012, "Statistics of patch offsets for image completion").
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array

Grid = NDArray[np.float32]
Mask = NDArray[np.bool_]

STRONGEST = 40.0
"""Levels: what stands out more has no greater say in how alike two places are."""
ALIKE = 0.5
"""Least likeness, 1 for the same and 0 for nothing in common."""
OVERLAP = 0.25
"""Share of the known cells that must meet known ones."""
SHORTEST, APART = 6, 2
"""Cells: shorter moves only say that neighbours are alike; moves nearer to one another are the same."""
MOST_MOVES = 12
"""And as many back."""


def moves(detail: Grid, known: Mask) -> Array:
    """(K, 2) rows and columns of cells, to fractions, by which a picture's detail (r, c, 3) looks like itself.

    The best first, each followed by the way back; none where nothing repeats.
    """
    rows, columns = known.shape
    score = likeness(np.clip(detail, -STRONGEST, STRONGEST), known)
    left = score.copy()
    left[np.hypot(*np.ogrid[-rows + 1 : rows, -columns + 1 : columns]) < SHORTEST] = -1
    left[: rows - 1] = -1
    found: list[tuple[float, float]] = []
    while len(found) < 2 * MOST_MOVES:
        row, column = np.unravel_index(int(left.argmax()), left.shape)
        if left[row, column] < ALIKE:
            break
        step = (_peak(score[:, column], int(row)) - rows + 1, _peak(score[row], int(column)) - columns + 1)
        found += [step, (-step[0], -step[1])]
        left[max(row - APART, 0) : row + APART + 1, max(column - APART, 0) : column + APART + 1] = -1
    return np.array(found).reshape(-1, 2)


def _peak(values: Grid, at: int) -> float:
    """Where the parabola through a value and its neighbours is highest, at most half a cell away."""
    if not 0 < at < len(values) - 1 or min(values[at - 1], values[at + 1]) <= -1:
        return float(at)
    before, here, after = (float(v) for v in values[at - 1 : at + 2])
    bend = before - 2 * here + after
    return at + float(np.clip(0.5 * (before - after) / bend, -0.5, 0.5)) if bend < 0 else float(at)


def likeness(detail: Grid, known: Mask) -> Grid:
    """(2 r - 1, 2 c - 1), -1 to 1: of detail (r, c, 3) and itself moved by -r + 1 to r - 1, -c + 1 to c - 1 cells.

    Twice the products over the sum of the squares, where both are known (r, c); -1 where too few of them meet.
    """
    from scipy import fft

    rows, columns = known.shape
    size = [fft.next_fast_len(2 * n, real=True) for n in known.shape]
    mask = known.astype(np.float32)
    values = detail * mask[..., None]
    seen = fft.rfft2(mask, size)
    energy = fft.rfft2((values**2).sum(axis=2), size)
    power = np.stack([np.abs(fft.rfft2(values[..., c], size)) ** 2 for c in range(3)])
    spectra = (power.sum(axis=0), 2 * (energy * seen.conj()).real, np.abs(seen) ** 2)
    row, column = np.arange(-rows + 1, rows), np.arange(-columns + 1, columns)
    product, squares, count = (fft.irfft2(s, size)[np.ix_(row, column)] for s in spectra)
    score = 2 * product / np.maximum(squares, 1e-3 * max(float(squares.max()), 1e-6))
    return np.where(count > OVERLAP * known.sum(), score, -1).astype(np.float32)
