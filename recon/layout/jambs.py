"""How well the jambs of openings are known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from recon.geometry import Array
from recon.layout.returns import Returns
from recon.model import Opening, Wall

BESIDE = 0.4
"""m of wall beside a jamb, whose returns say how they scatter ..."""
DEPTH = 0.05
"""... m before and behind it."""
MIN_RETURNS = 8
"""Returns there, at least."""
MAD = 1.4826
"""Standard deviation over the median absolute deviation of what is normally distributed."""


def with_jamb_sigmas(openings: Sequence[Opening], walls: Sequence[Wall], returns: Returns) -> list[Opening]:
    """The openings with the standard deviation of where their jambs are along the wall, the larger one of both.

    A jamb is where the outermost returns beside it end: they scatter, and by as much they are carried beyond it, so the
    variance is twice that of the scatter, and that of an even chance between two returns.
    """
    named = {wall.id: wall for wall in walls}
    return [replace(o, sigma_jambs=_sigma(o, named[o.wall], returns)) for o in openings]


def _sigma(opening: Opening, wall: Wall, returns: Returns) -> float | None:
    low, high = sorted((opening.start, opening.end), key=lambda point: float((point - wall.start) @ wall.direction))
    beside = BESIDE * wall.direction
    sides = [_scatter(low - beside, low, returns), _scatter(high, high + beside, returns)]
    known = [sigma for sigma in sides if sigma is not None]
    return max(known) if len(known) == 2 else None


def _scatter(start: Array, end: Array, returns: Returns) -> float | None:
    """m, of returns beside a piece of wall; None where there are too few."""
    _, across, _ = returns.beside(start, end, DEPTH)
    if len(across) < MIN_RETURNS:
        return None
    scatter = MAD * float(np.median(np.abs(across - np.median(across))))
    return float(np.sqrt(2 * scatter**2 + (BESIDE / len(across)) ** 2 / 12))
