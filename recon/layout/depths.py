"""How far behind the face of their wall door leaves sit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from recon.layout.recess import DEPTH
from recon.layout.returns import Returns
from recon.model import Opening, Wall

MIN_RETURNS = 8
"""Returns from a leaf before it has a depth."""
INNER = 0.15
"""m from the jambs: nearer there, returns are of the frame."""


def with_depths(openings: Sequence[Opening], walls: Sequence[Wall], returns: Returns) -> list[Opening]:
    """The openings, closed doors with the median depth of the returns from their leaf, m behind the wall's face."""
    named = {wall.id: wall for wall in walls}
    return [o if o.type != "door" or o.open else _measured(o, named[o.wall], returns) for o in openings]


def _measured(door: Opening, wall: Wall, returns: Returns) -> Opening:
    along, across, starts = returns.beside(door.start, door.end, DEPTH[1])
    width = float(np.linalg.norm(door.end - door.start))
    on_leaf = (along > INNER) & (along < width - INNER) & (across < -DEPTH[0])
    on_leaf &= (starts - wall.start) @ wall.normal > 0
    if np.count_nonzero(on_leaf) < MIN_RETURNS:
        return door
    return replace(door, depth=float(-np.median(across[on_leaf])))
