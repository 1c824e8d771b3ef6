"""Which free space the platform could have driven to: the rest was only glanced at through doors and slits."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array
from recon.layout.evidence import FreeSpace
from recon.layout.line import PlanLine
from recon.layout.stretches import Stretches

HALF_WIDTH = 0.5
"""m; what lies behind gaps narrower than twice this was not visited unless the path leads there."""
NEAR_WALL = 0.15
"""m, obstacles further from every wall are furniture: they close no passage ..."""
FURNITURE = 0.25
"""... and are this much larger than what was seen of them, m."""
POCKET = 1.5
"""m^2; smaller spaces behind such gaps are corners of the room itself."""


def visited_space(space: FreeSpace, walls: list[PlanLine], path: Array) -> NDArray[np.bool_]:
    """(rows, columns) free cells that connect to the path (N, 2) m by ways wider than a door.

    What no ray reached between free cells (between the rays that a far wall returned, say) counts as way.
    """
    things = space.centres(space.blocked)
    away = Stretches(walls).distance(things) > NEAR_WALL
    furniture, wall = np.zeros((2, *space.free.shape), np.uint8)
    furniture[space.index(things[away])] = 1
    wall[space.index(things[~away])] = 1
    _draw(wall, walls, space)
    furniture = cv2.dilate(furniture, _disc(FURNITURE, space))
    disc = _disc(HALF_WIDTH, space)
    closed = cv2.morphologyEx(space.free.astype(np.uint8) | furniture, cv2.MORPH_CLOSE, disc)
    core = cv2.erode(closed & (1 - wall), disc)
    trail = np.zeros_like(core)
    trail[space.index(path)] = 1
    trail = cv2.dilate(trail, disc)
    _, label = cv2.connectedComponents(core, connectivity=8)
    reached = np.unique(label[(trail > 0) & (core > 0)])
    grown = cv2.dilate((np.isin(label, reached) & (core > 0)).astype(np.uint8) | trail, disc)
    beyond = (space.free & (grown == 0)).astype(np.uint8)
    _, label, statistics, _ = cv2.connectedComponentsWithStats(beyond, connectivity=4)
    large = statistics[:, cv2.CC_STAT_AREA] * space.cell_area > POCKET
    return np.asarray(space.free & ((beyond == 0) | ~large[label]))


def _draw(mask: NDArray[np.uint8], walls: list[PlanLine], space: FreeSpace) -> None:
    """Sets the cells along the supported stretches of walls."""
    for wall in walls:
        ends = [wall.point(stretch) for stretch in wall.support]
        pixels = [np.round((e - space.origin) / space.resolution - 0.5).astype(np.int32)[:, None] for e in ends]
        cv2.polylines(mask, pixels, False, 1, 2)


def _disc(radius: float, space: FreeSpace) -> NDArray[np.uint8]:
    reach = max(1, round(radius / space.resolution))
    return np.asarray(cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1)), dtype=np.uint8)
