"""Things on the floor that are no walls."""

from __future__ import annotations

import cv2
import numpy as np
import shapely

from recon.layout.evidence import FreeSpace
from recon.model import FloorObject, Wall

CLEARANCE = 0.12
"""m from a wall; returns nearer than this are the wall's."""
JOIN = 0.15
"""m between returns of one thing."""
SMALLEST = 0.05
"""m, of a footprint's diameter."""


def floor_objects(walls: list[Wall], rooms: list[shapely.Polygon], space: FreeSpace) -> list[FloorObject]:
    """Convex footprints of what stopped rays inside the rooms and away from walls."""
    points = space.centres(space.blocked)
    if not rooms or len(points) == 0:
        return []
    inner = shapely.union_all([room.buffer(-CLEARANCE) for room in rooms])
    lines = shapely.MultiLineString([np.stack([wall.start, wall.end]) for wall in walls])
    free = shapely.contains_xy(inner, points[:, 0], points[:, 1])
    free &= shapely.distance(shapely.points(points), lines) > CLEARANCE
    mask = np.zeros(space.free.shape, np.uint8)
    mask[space.index(points[free])] = 1
    size = 2 * max(1, round(JOIN / 2 / space.resolution)) + 1
    joined = cv2.dilate(mask, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size)))
    count, label = cv2.connectedComponents(joined, connectivity=8)
    owner = label[space.index(points[free])]
    out: list[FloorObject] = []
    for k in range(1, count):
        own = points[free][owner == k]
        hull = shapely.MultiPoint(own).convex_hull.buffer(space.resolution / 2, join_style="mitre")
        if len(own) and np.ptp(own, axis=0).max() + space.resolution >= SMALLEST:
            out.append(FloorObject(len(out), np.asarray(shapely.orient_polygons(hull).exterior.coords)[:-1]))
    return out
