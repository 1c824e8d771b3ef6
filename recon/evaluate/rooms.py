"""Rooms, corners and angles as Floor-SP (Chen et al., ICCV 2019), MonteFloor and HEAT (CVPR 2022) score floorplans."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from recon.evaluate.score import Score, match
from recon.geometry import Array
from recon.model import Room

if TYPE_CHECKING:
    import shapely

MIN_IOU = 0.5
THRESHOLDS = (0.1, 0.2)
"""m between a corner and its counterpart."""
FIELD_THRESHOLD = 10 / 256 * 1.2
"""The field's 10 pixels of 256, as a share of the longer side of the true plan: its images have a margin of a tenth."""
MAX_ANGLE = 5.0
"""Degrees between the inner angles of a corner and its counterpart."""
OVERLAP = 0.05
"""m: rooms that overlap by more than twice this are wrong, both; the field shrinks them by two pixels of 256."""
STRAIGHT = 1e-3
"""m: a vertex this near to the line through its neighbours is none."""


@dataclass(frozen=True)
class CornerScores:
    """Corners of matched rooms within `threshold` m of their counterparts, and those whose angle is right as well."""

    threshold: float
    corners: Score
    angles: Score


@dataclass(frozen=True)
class RoomScores:
    """How the rooms agree.

    iou: median over matched rooms (nan without any). area_error: median over matched rooms of |estimate - truth| over
    truth; total_area_error: of the sums over all rooms, signed. corners: at THRESHOLDS and last the field's threshold.
    """

    rooms: Score
    iou: float
    area_error: float
    total_area_error: float
    corners: tuple[CornerScores, ...]

    def to_json(self) -> dict[str, Any]:
        """Plain values; the field's threshold is the last of `corners` and `angles`."""
        kinds = {
            kind: [{"threshold": c.threshold} | getattr(c, kind).to_json() for c in self.corners]
            for kind in ("corners", "angles")
        }
        areas = {"area_error": _plain(self.area_error), "total_area_error": self.total_area_error}
        return {"rooms": self.rooms.to_json() | {"iou": _plain(self.iou)} | areas} | kinds


def room_scores(estimate: tuple[Room, ...], truth: tuple[Room, ...]) -> RoomScores:
    """Rooms as `matched_rooms` pairs them; `truth` is not empty. Both in one frame.

    Corners and angles of rooms without a counterpart are
    found ones that are wrong, or true ones that were missed.
    """
    mine, theirs = polygons(estimate), polygons(truth)
    iou = overlaps(mine, theirs)
    pairs = matched_rooms(estimate, truth)
    rows, columns = np.array(pairs, dtype=np.int64).reshape(-1, 2).T
    areas, true_areas = (np.array([p.area for p in which]) for which in (mine, theirs))
    errors = np.abs(areas[rows] - true_areas[columns]) / true_areas[columns]
    low, high = (f([f(r.polygon, axis=0) for r in truth], axis=0) for f in (np.min, np.max))
    thresholds = (*THRESHOLDS, float(np.max(high - low)) * FIELD_THRESHOLD)
    return RoomScores(
        Score(len(mine), len(theirs), len(pairs)),
        float(np.median(iou[rows, columns])) if pairs else float("nan"),
        float(np.median(errors)) if pairs else float("nan"),
        float(areas.sum() / true_areas.sum() - 1.0),
        tuple(_corner_scores(estimate, truth, pairs, t) for t in thresholds),
    )


def matched_rooms(estimate: tuple[Room, ...], truth: tuple[Room, ...]) -> list[tuple[int, int]]:
    """Indices of rooms paired one to one, the intersection over their union above MIN_IOU.

    An estimated room that overlaps another estimated one has no counterpart.
    """
    mine = polygons(estimate)
    rows, columns = match(1.0 - overlaps(mine, polygons(truth)), np.nextafter(1.0 - MIN_IOU, 0.0))
    alone = ~_overlapping(mine)[rows]
    return list(zip(rows[alone].tolist(), columns[alone].tolist(), strict=True))


def polygons(rooms: tuple[Room, ...]) -> tuple[shapely.Geometry, ...]:
    """Valid polygons of rooms."""
    import shapely

    return tuple(shapely.Polygon(room.polygon).buffer(0) for room in rooms)


def overlaps(mine: tuple[shapely.Geometry, ...], theirs: tuple[shapely.Geometry, ...]) -> Array:
    """(M, N) intersection over union of every polygon of one list with every one of the other."""
    import shapely

    iou = np.zeros((len(mine), len(theirs)))
    for i, polygon in enumerate(mine):
        shared = shapely.area(shapely.intersection(polygon, list(theirs)))
        iou[i] = shared / np.maximum(polygon.area + shapely.area(list(theirs)) - shared, 1e-12)
    return iou


def corners_of(polygon: Array) -> tuple[Array, Array]:
    """Corners (K, 2) of a counter-clockwise ring (n, 2) without vertices on a straight line; inner angles (K,), deg."""
    ring = polygon
    while len(ring) > 3:
        before, after = np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0)
        chord = after - before
        length = np.maximum(np.linalg.norm(chord, axis=1), 1e-12)
        off = np.abs(chord[:, 0] * (ring - before)[:, 1] - chord[:, 1] * (ring - before)[:, 0]) / length
        if off.min() > STRAIGHT:
            break
        ring = np.delete(ring, int(off.argmin()), axis=0)
    arriving, leaving = ring - np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0) - ring
    cross = arriving[:, 0] * leaving[:, 1] - arriving[:, 1] * leaving[:, 0]
    return ring, 180.0 - np.degrees(np.arctan2(cross, np.sum(arriving * leaving, axis=1)))


def _overlapping(rooms: tuple[shapely.Geometry, ...]) -> NDArray[np.bool_]:
    import shapely

    shrunk = [p.buffer(-OVERLAP) for p in rooms]
    out = np.zeros(len(rooms), dtype=bool)
    for i, polygon in enumerate(shrunk):
        hit = shapely.area(shapely.intersection(polygon, shrunk)) > 0.0
        hit[i] = False
        out[i] = bool(hit.any())
    return out


def _corner_scores(
    estimate: tuple[Room, ...], truth: tuple[Room, ...], pairs: list[tuple[int, int]], threshold: float
) -> CornerScores:
    """Corners of matched rooms one to one by distance; then those whose inner angles differ by at most MAX_ANGLE."""
    mine, theirs = ([corners_of(room.polygon) for room in rooms] for rooms in (estimate, truth))
    near = square = 0
    for i, j in pairs:
        distance = np.linalg.norm(mine[i][0][:, None] - theirs[j][0][None], axis=2)
        rows, columns = match(distance, threshold)
        near += len(rows)
        square += int(np.sum(np.abs(mine[i][1][rows] - theirs[j][1][columns]) <= MAX_ANGLE))
    found, true = (sum(len(corners) for corners, _ in rings) for rings in (mine, theirs))
    return CornerScores(threshold, Score(found, true, near), Score(found, true, square))


def _plain(value: float) -> float | None:
    return value if np.isfinite(value) else None
