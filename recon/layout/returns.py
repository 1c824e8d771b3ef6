"""Where rays ended, found again by place."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array

TILE = 1.0
"""m, side of the squares that returns are kept in."""


class Returns:
    """Ends (R, 2) m of rays with their starts (R, 2), map frame, sorted into tiles."""

    def __init__(self, starts: Array, ends: Array) -> None:
        self._low = ends.min(axis=0) - 2 * TILE if len(ends) else np.zeros(2)
        tile = np.floor((ends - self._low) / TILE).astype(np.int64)
        self._columns = int(tile[:, 0].max()) + 3 if len(ends) else 1
        key = tile[:, 1] * self._columns + tile[:, 0]
        order = np.argsort(key, kind="stable")
        self._key, self._starts, self._ends = key[order], starts[order], ends[order]

    def beside(self, start: Array, end: Array, depth: float) -> tuple[Array, Array, Array]:
        """Positions along a stretch from `start` to `end` (2,) m and across (to its left), and starts, of the returns
        within `depth` < `TILE` m of it."""
        length = float(np.linalg.norm(end - start))
        direction = (end - start) / max(length, 1e-12)
        steps = np.linspace(0.0, length, int(length / TILE * 2) + 2)
        index = self._near(start + steps[:, None] * direction)
        offset = self._ends[index] - start
        along, across = offset @ direction, offset @ np.array([-direction[1], direction[0]])
        near = (along >= 0) & (along < length) & (np.abs(across) <= depth)
        return along[near], across[near], self._starts[index[near]]

    def _near(self, points: Array) -> NDArray[np.int64]:
        """Indices of the returns in the tiles of points (P, 2) and the tiles around these."""
        around = np.array([(x, y) for x in (-1, 0, 1) for y in (-1, 0, 1)])
        tiles = (np.floor((points - self._low) / TILE).astype(np.int64)[:, None] + around).reshape(-1, 2)
        tiles = tiles[(tiles >= 0).all(axis=1) & (tiles[:, 0] < self._columns)]
        keys = np.unique(tiles[:, 1] * self._columns + tiles[:, 0])
        first, last = np.searchsorted(self._key, keys), np.searchsorted(self._key, keys, side="right")
        parts = [np.arange(a, b) for a, b in zip(first, last, strict=True) if b > a]
        return np.concatenate(parts) if parts else np.zeros(0, np.int64)
