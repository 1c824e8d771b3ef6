"""How high doors and passages are: level image lines on the wall just above them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from recon.layout.edges import Edges
from recon.layout.line import total, union
from recon.model import Opening, Wall
from recon.plan import opening_span

LOWEST, HIGHEST = 1.7, 3.0
"""m, of heads."""
BESIDE = 0.2
"""m that a head's line may go on past the jambs: casings."""
COVERED = 0.5
"""Share of the opening's width that lines at a height cover, at least."""
NEAR = 0.025
"""m, edges this close to a height are that height's."""
WIDTH = 0.008
"""m, least standard deviation of an edge's height in the vote."""
RIVAL = 0.6
"""Heights with this share of the most votes may be the head."""
MIN_FRAMES = 3


def measured_heads(openings: Sequence[Opening], walls: Sequence[Wall], edges: Edges) -> tuple[Opening, ...]:
    """Openings with `top` and `sigma_top` where level lines show their head; `edges`: of these walls.

    Where none does, `top` is the median of the heads found on openings of the same type, if there are any.
    """
    index = {wall.id: k for k, wall in enumerate(walls)}
    edges = edges.sure(LOWEST, HIGHEST)
    found: list[tuple[float, float] | None] = []
    for opening in openings:
        k = index[opening.wall]
        found.append(_head(opening, walls[k], edges.where(edges.wall == k)))
    known: dict[str, list[float]] = {}
    for opening, head in zip(openings, found, strict=True):
        if head is not None:
            known.setdefault(opening.type, []).append(head[0])
    out = []
    for opening, head in zip(openings, found, strict=True):
        if head is not None:
            opening = replace(opening, top=head[0], sigma_top=head[1])
        elif opening.type in known:
            opening = replace(opening, top=float(np.median(known[opening.type])))
        out.append(opening)
    return tuple(out)


def _head(opening: Opening, wall: Wall, edges: Edges) -> tuple[float, float] | None:
    """Height of the head and its standard deviation, m; None where no line shows it.

    Edges on the wall itself keep their height from wherever they are seen; those of casings, leaves and lintels, which
    lie before or behind it, seem to wander. Of the heights that keep, the lowest is the head.
    """
    low, high = opening_span(opening, wall)
    edges = edges.where((edges.span[:, 0] > low - BESIDE) & (edges.span[:, 1] < high + BESIDE))
    votes = np.array([_votes(edges, height, low, high) for height in edges.height])
    if not len(votes) or votes.max() == 0:
        return None
    rivals = edges.height[votes >= RIVAL * votes.max()]
    height = float(rivals.min())
    near = edges.where(np.abs(edges.height - height) <= NEAR)
    weight = near.length / np.maximum(near.sigma, WIDTH) ** 2
    mean = float(np.average(near.height, weights=weight))
    choice = np.ptp(rivals) / np.sqrt(12)  # uniform among the rivals
    return mean, float(np.linalg.norm([*near.deviation(mean, weight), choice]))


def _votes(edges: Edges, height: float, low: float, high: float) -> float:
    """m of lines, over frames, about a height; 0 where they do not cover the opening or come from one frame only."""
    near = edges.where(np.abs(edges.height - height) <= NEAR)
    if len(np.unique(near.frame)) < MIN_FRAMES or total(union(np.clip(near.span, low, high))) < COVERED * (high - low):
        return 0.0
    return float(near.length @ np.exp(-0.5 * ((near.height - height) / WIDTH) ** 2))
