"""Symbols of doors, passages and windows. Which way a door swings is not measured, and not drawn."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from recon.geometry import Array
from recon.model import Layout, Opening
from recon.plan.drawing import Fill, Polyline
from recon.plan.layers import DOOR, GLAZING, PASSAGE
from recon.plan.walls import opening_depths, opening_ends

LEAF = 0.04
"""m; thickness of a drawn leaf."""
GLASS = 0.03
"""m between the lines of a drawn pane."""
TWO_LEAVES = 1.3
"""m; wider doors are drawn with two leaves."""
_BACK_TO_BACK = np.cos(np.radians(10.0))
_SHARED = 0.5  # of the narrower of two openings that are one


@dataclass(frozen=True)
class Pierced:
    """An opening through a wall: ends on its face, `front`, and on the other, `back` (2, 2), in the same direction.

    leaf: share of the way from front to back at which the leaf or glass stands.
    """

    opening: Opening
    front: Array
    back: Array
    leaf: float

    @property
    def width(self) -> float:
        """m, on the front."""
        return float(np.linalg.norm(self.front[1] - self.front[0]))


def pierced(layout: Layout) -> list[Pierced]:
    """Every opening once: those that two rooms have in the two faces of one wall are joined."""
    walls = {wall.id: wall for wall in layout.walls}
    ends = np.array([opening_ends(o, walls[o.wall]) for o in layout.openings]).reshape(-1, 2, 2)
    normals = np.array([walls[o.wall].normal for o in layout.openings]).reshape(-1, 2)
    depths = np.array(opening_depths(layout))
    out: list[Pierced] = []
    joined: set[int] = set()
    for i, opening in enumerate(layout.openings):
        if i in joined:
            continue
        back, partner = ends[i] - depths[i] * normals[i], _partner(i, ends, normals, depths)
        if partner is not None and partner not in joined:
            joined.add(partner)
            back = ends[partner][::-1]
        through = float(np.linalg.norm(back.mean(axis=0) - ends[i].mean(axis=0)))
        leaf = 0.5 if opening.depth is None else float(np.clip(opening.depth / max(through, 1e-6), 0.0, 1.0))
        out.append(Pierced(opening, ends[i], back, leaf))
    return out


def draw_openings(layout: Layout) -> Iterator[Polyline | Fill]:
    """The symbols, each marked with its opening."""
    for hole in pierced(layout):
        if hole.opening.type == "door":
            yield from _door(hole)
        elif hole.opening.type == "window":
            yield from _window(hole)
        else:
            yield Polyline(PASSAGE, hole.front, source=hole.opening)
            yield Polyline(PASSAGE, hole.back, source=hole.opening)


def _door(hole: Pierced) -> Iterator[Polyline | Fill]:
    """Closed leaves between the jambs, and the edges of the wall before and behind."""
    for line in (hole.front, hole.back):
        yield Polyline(DOOR, line, source=hole.opening, thin=True)
    ends, across = _inside(hole, LEAF)
    stops = [0.0, 0.5, 1.0] if hole.width > TWO_LEAVES else [0.0, 1.0]
    for a, b in pairwise(stops):
        leaf = ends[0] + np.array([[a], [b]]) * (ends[1] - ends[0])
        ring = np.concatenate([leaf - across, leaf[::-1] + across])
        yield Fill(DOOR, (ring,), DOOR.rgb, DOOR.colour)
        yield Polyline(DOOR, ring, True, hole.opening)


def _window(hole: Pierced) -> Iterator[Polyline | Fill]:
    """A pane between the faces of the wall."""
    for line in (hole.front, hole.back):
        yield Polyline(GLAZING, line, source=hole.opening, thin=True)
    ends, across = _inside(hole, GLASS)
    for line in (ends - across, ends + across):
        yield Polyline(GLAZING, line, source=hole.opening)


def _inside(hole: Pierced, thickness: float) -> tuple[Array, Array]:
    """Ends (2, 2) of what stands in the opening, and half its thickness (2,) to the back; it stays within the wall."""
    way = (hole.back - hole.front).mean(axis=0)
    depth = max(float(np.linalg.norm(way)), 1e-6)
    half = min(thickness, depth) / 2
    share = float(np.clip(hole.leaf, half / depth, 1 - half / depth))
    return hole.front + share * (hole.back - hole.front), way / depth * half


def _partner(i: int, ends: Array, normals: Array, depths: Array) -> int | None:
    """The opening in the other face of the wall behind opening i; the nearest one, where there are several."""
    middle = ends.mean(axis=1)
    way = ends[i, 1] - ends[i, 0]
    width = float(np.linalg.norm(way))
    along = (ends - ends[i, 0]) @ (way / max(width, 1e-9))
    shared = np.minimum(along.max(axis=1), width) - np.maximum(along.min(axis=1), 0.0)
    behind = (middle[i] - middle) @ normals[i]
    fits = normals @ normals[i] < -_BACK_TO_BACK
    fits &= (behind > 0) & (behind < depths[i] + 0.1)
    fits &= shared > _SHARED * np.minimum(width, np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1))
    return int(np.flatnonzero(fits)[behind[fits].argmin()]) if fits.any() else None
