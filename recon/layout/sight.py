"""Image lines that lie behind walls: reflections, tops of baseboards and edges of windows taken for a wall's foot."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import shapely

from recon.geometry import Array
from recon.layout.line import PlanLine

SPACING = 0.3
"""m between the places looked from, and between those looked at on a line."""
RANGE = 15.0
"""m, no image shows a foot on the floor from further away."""
SHORT_OF = 0.1
"""m before a line: what it is drawn on may stand there itself."""
SEEN = 0.5
"""Share of a stretch in sight of the path, at least."""


def within_sight(lines: list[PlanLine], path: Array) -> list[PlanLine]:
    """Lines without those stretches of image lines that scanned walls hide from all of the path (N, 2) m."""
    walls = [line.point(part) for line in lines if line.source == "lidar" for part in line.support]
    if not walls:
        return lines
    tree = shapely.STRtree(shapely.linestrings(np.array(walls)))
    places = _thinned(path)
    out = []
    for line in lines:
        if line.source == "image":
            line = replace(
                line,
                front=_seen(line, line.front, line.normal, places, tree),
                back=_seen(line, line.back, -line.normal, places, tree),
            )
        if len(line.front) or len(line.back):
            out.append(line)
    return out


def _thinned(path: Array) -> Array:
    """One place a square of side `SPACING`, in order."""
    _, first = np.unique(np.floor(path / SPACING).astype(np.int64), axis=0, return_index=True)
    return np.asarray(path[np.sort(first)])


def _seen(line: PlanLine, stretches: Array, normal: Array, places: Array, tree: shapely.STRtree) -> Array:
    """The stretches (K, 2), seen from where `normal` points to, of which enough is in sight of a place (P, 2)."""
    before = places[((places - line.origin) @ normal) > SHORT_OF]
    kept = [low_high for low_high in stretches if _share(line, low_high, normal, before, tree) >= SEEN]
    return np.array(kept).reshape(-1, 2)


def _share(line: PlanLine, stretch: Array, normal: Array, places: Array, tree: shapely.STRtree) -> float:
    count = max(2, int(np.ceil((stretch[1] - stretch[0]) / SPACING)))
    feet = line.point(stretch[0] + (np.arange(count) + 0.5) / count * (stretch[1] - stretch[0])) + SHORT_OF * normal
    seen = 0
    for foot in feet:
        near = places[np.linalg.norm(places - foot, axis=1) <= RANGE]
        rays = shapely.linestrings(np.stack([near, np.broadcast_to(foot, near.shape)], axis=1))
        hidden = np.unique(tree.query(rays, predicate="crosses")[0]) if len(near) else np.zeros(0)
        seen += len(hidden) < len(near)
    return seen / count
