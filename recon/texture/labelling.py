"""Which view every block shows: sharp, in large patches, with seams where they do not show.

A Markov random field over the blocks, solved by graph cuts (alpha-expansion, Boykov, Veksler and Zabih 2001, as
Lempitsky and Ivanov 2007 do for mosaics). The cost of a seam follows how far both views are from what most views agree
on, so that seams avoid whatever the images place differently.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

SEAM, SEAM_LEVEL = 0.35, 0.06
"""Octaves a block side of any seam, and a level (0 to 255) of both views' deviations."""
MOST = 30.0
"""Deviations count up to here, levels."""
CYCLES = 3
"""Times that every view may grow: a fourth time changes next to nothing."""
LARGE = np.float32(1e4)

Grid = NDArray[np.float32]
Views = NDArray[np.int32]


def choose_views(cost: Grid, view: Views, deviation: Grid, shape: tuple[int, int]) -> Views:
    """The view (rows, columns) of every block, -1 where it has none.

    cost: (n, slots) octaves, inf for empty ones; view, deviation: (n, slots); blocks row by row. What is
    minimised is the sum of the chosen slots' costs and, for every two neighbours of different views, of `seam_cost` of
    both. No view alone, grown over any of the other blocks, would make it less.
    """
    own = np.where(np.isfinite(cost), cost, LARGE).astype(np.float32)
    leave = seam_cost(deviation)
    chosen = own.argmin(axis=1)
    field = _Field(shape[1], own, leave, view, chosen, np.full(len(own), -1, np.int64))
    by_view = _slots_by_view(view)
    for _ in range(CYCLES):
        grown = [_grow(block, slot, field) for block, slot in by_view]
        if not any(grown):
            break
    picked = view[np.arange(len(view)), chosen]
    return np.asarray(picked, np.int32).reshape(shape)


def seam_cost(deviation: Grid) -> Grid:
    """Octaves (...) that a block pays for each side at which another view begins; deviation (...) in levels."""
    return np.asarray(SEAM_LEVEL * np.minimum(deviation, MOST) + SEAM / 2, dtype=np.float32)


def _slots_by_view(view: Views) -> list[tuple[NDArray[np.int64], NDArray[np.int64]]]:
    """For every view its blocks and the slots it has there."""
    block, slot = np.nonzero(view >= 0)
    owner = view[block, slot]
    order = np.argsort(owner, kind="stable")
    parts = np.split(order, np.flatnonzero(np.diff(owner[order])) + 1)
    return [(block[part], slot[part]) for part in parts if len(part)]


@dataclass(frozen=True)
class _Field:
    """Of n blocks, row by row: costs, seam costs and views (n, slots), the slot chosen (n,) as it stands.

    place: (n,), -1, to work with.
    """

    columns: int
    own: Grid
    leave: Grid
    view: Views
    chosen: NDArray[np.int64]
    place: NDArray[np.int64]


def _grow(block: NDArray[np.int64], slot: NDArray[np.int64], field: _Field) -> bool:
    """Gives a view, in place, the blocks that make the sum least; `block`, `slot`: where it can be. Whether any."""
    import maxflow

    from recon.texture.kernels import expansion

    given = field.columns, field.own, field.leave, field.view, field.chosen, field.place
    gain, first, second, capacity = expansion(block, slot, *given)
    if not (gain < 0).any():
        return False
    graph = maxflow.Graph[float](len(block), len(first))
    nodes = graph.add_nodes(len(block))
    graph.add_grid_tedges(nodes, np.maximum(gain, 0), np.maximum(-gain, 0))
    graph.add_edges(first, second, capacity, np.zeros_like(capacity))
    graph.maxflow()
    taken = graph.get_grid_segments(nodes) & (field.chosen[block] != slot)
    field.chosen[block[taken]] = slot[taken]
    return bool(taken.any())
