"""Walls in the light of one another: how thick they are, and what their openings leave unseen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import shapely

from recon.layout.line import clip, subtract
from recon.layout.outline import SHORTEST_UNSEEN
from recon.model import Opening, Wall
from recon.plan import opening_span

THICKEST = 0.6
"""m between the two faces of one wall, at most ..."""
THINNEST = 0.03
"""... and at least."""
PARALLEL = np.cos(np.radians(5.0))
SHARED = 0.3
"""Share of the shorter face that is behind the other, at least."""


def with_thickness(walls: Sequence[Wall]) -> list[Wall]:
    """Walls with the distance to the nearest face on their other side; None where none was seen."""
    faces = [wall for wall in walls if wall.source != "inferred" and wall.length > THINNEST]
    tree = shapely.STRtree([shapely.LineString([face.start, face.end]) for face in faces])
    out = []
    for wall in walls:
        if wall.source != "inferred":
            near = tree.query(shapely.LineString([wall.start, wall.end]), predicate="dwithin", distance=THICKEST)
            depths = [_depth(wall, faces[k]) for k in near]
            wall = replace(wall, thickness=min((depth for depth in depths if depth is not None), default=None))
        out.append(wall)
    return out


def _depth(wall: Wall, other: Wall) -> float | None:
    """m from a wall's face to another behind it that faces the other way; None where they are not one wall's."""
    if wall.normal @ other.normal > -PARALLEL:
        return None
    low, high = sorted(float((end - wall.start) @ wall.direction) for end in (other.start, other.end))
    shared = min(high, wall.length) - max(low, 0.0)
    if shared < SHARED * min(wall.length, other.length):
        return None
    middle = wall.start + (max(low, 0.0) + shared / 2) * wall.direction
    depth = float((other.start - middle) @ other.normal)
    return depth if THINNEST <= depth <= THICKEST else None


def without_openings(walls: Sequence[Wall], openings: Sequence[Opening]) -> list[Wall]:
    """Walls whose `unseen` stretches leave out their openings: there nothing is hidden."""
    out = []
    for wall in walls:
        spans = [opening_span(opening, wall) for opening in openings if opening.wall == wall.id]
        if len(wall.unseen) and spans:
            rest = clip(subtract(wall.unseen, np.array(spans)), 0.0, wall.length)
            wall = replace(wall, unseen=rest[np.ptp(rest, axis=1) > SHORTEST_UNSEEN])
        out.append(wall)
    return out
