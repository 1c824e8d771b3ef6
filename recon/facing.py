"""Which room each wall faces."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray

from recon.model import Layout, Room

BEFORE = 0.05
"""m before the middle of a wall, where its room is looked for."""


def facing_rooms(layout: Layout, before: float = BEFORE) -> NDArray[np.int64]:
    """(W,) index of the room `before` m in front of the middle of each wall, -1 where there is none."""
    out = np.full(len(layout.walls), -1, np.int64)
    if layout.walls and layout.rooms:
        points = np.array([(wall.start + wall.end) / 2 + before * wall.normal for wall in layout.walls])
        rooms = shapely.STRtree([shapely.Polygon(room.polygon) for room in layout.rooms])
        wall, room = rooms.query(shapely.points(points), predicate="within")
        out[wall] = room
    return out


def rooms_before(layout: Layout) -> dict[int, Room | None]:
    """The room in front of the middle of every wall (by id), None where there is none."""
    faced = zip(layout.walls, facing_rooms(layout).tolist(), strict=True)
    return {wall.id: None if k < 0 else layout.rooms[k] for wall, k in faced}
