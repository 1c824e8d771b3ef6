"""Rooms: the inside, split at walls and at gaps of a door's width in them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from recon.geometry import Array
from recon.layout.cells import Cells
from recon.layout.evidence import FreeSpace
from recon.layout.line import PlanLine, coverage, crossings, union

WALL_SHARE = 0.5
"""An edge between two inside cells is a wall from this supported share on."""
PASSAGE = 2.2
"""m, gaps up to this width between two stretches of one wall part rooms ..."""
BESIDE_GAP = 0.5
"""... if these are, together, this share of the gap long."""
NARROWEST = 0.6
"""m, of a corridor."""
THROUGH = 0.3
"""m of a wall on either side of a line that it goes through."""
AWAY, ALL_BUT = 0.6, 0.9
"""m of a wall that goes away from a line, deeper than walls are thick, and the share of it that was seen ..."""
JAMB = 0.2
"""... from this near, m, to a gap's end on: the side wall of a corridor ..."""
WIDEST_DOOR = 1.4
"""... where rays went through more than a door's width, m."""
SAMPLES = 60
"""Places in a gap where rays are looked for."""
STEEP = float(np.sin(np.radians(15.0)))
SMALLEST = 1.0
"""m^2"""
SMALLEST_BEHIND = 3.0
"""m^2; smaller spaces behind a doorway are niches of the room before it."""
SUPPORTED = 0.6
"""Share of a room's outline that walls support, for rooms that the platform did not enter."""
CORRIDOR_ASPECT = 6.0
CORRIDOR_WIDTH = 3.5


@dataclass(frozen=True)
class Region:
    """Cells of one room (indices) and their union, a shapely polygon that may have holes."""

    cells: NDArray[np.int64]
    polygon: shapely.Polygon


def regions(
    cells: Cells,
    lines: list[PlanLine],
    inside: NDArray[np.bool_],
    support: Array,
    spans: Array,
    glanced: NDArray[np.bool_],
    path: Array,
    space: FreeSpace,
) -> tuple[list[Region], NDArray[np.bool_]]:
    """Rooms, largest first, and (E,) the edges that are walls between inside cells.

    support: (E,) m of each edge. spans: (E, 2) positions along its line. glanced: (C,) cells that are mostly seen
    through a door or slit; the lines of walls part them from others. path: (N, 2) m, where the platform was: spaces
    that it did not enter must be closed by walls to be rooms.
    """
    both = (cells.left >= 0) & (cells.right >= 0)
    both &= inside[cells.left] & inside[cells.right]
    wall = support >= WALL_SHARE * np.maximum(cells.lengths, 1e-9)
    has_wall = np.isin(cells.line, cells.line[wall])
    glance = has_wall & (glanced[cells.left] != glanced[cells.right])
    parting = both & (wall | glance | _walled(cells, spans, lines, space))
    doorways = both & ~parting & _gated(cells, spans, lines)
    label = _components(cells, both & ~parting & ~doorways)
    label = _with_niches(cells, label, doorways, both & ~wall, inside, support, path)
    found = [region for k in np.unique(label[inside]) if (region := _region(cells, (label == k) & inside)) is not None]
    found.sort(key=lambda region: -region.polygon.area)
    kept = [region for region in found if _is_room(region, cells, support, path)]
    return kept or found[:1], both & wall


def _components(cells: Cells, link: NDArray[np.bool_]) -> NDArray[np.int64]:
    """(C,) number of the connected component of every cell, over the edges in `link` (E,)."""
    count = len(cells.polygons)
    graph = coo_array((np.ones(link.sum()), (cells.left[link], cells.right[link])), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)


def _region(cells: Cells, members: NDArray[np.bool_]) -> Region | None:
    """The cells set in `members` (C,) as a region; None where they are too small for one."""
    polygon = shapely.union_all(cells.polygons[members])
    if polygon.geom_type != "Polygon" or polygon.area < SMALLEST:
        return None
    return Region(np.flatnonzero(members), polygon)


def _with_niches(
    cells: Cells,
    label: NDArray[np.int64],
    doorways: NDArray[np.bool_],
    bare: NDArray[np.bool_],
    inside: NDArray[np.bool_],
    support: Array,
    path: Array,
) -> NDArray[np.int64]:
    """Labels (C,) of spaces, those behind a doorway that are no rooms of their own joined to the largest before it.

    doorways: (E,) edges. bare: (E,) edges between inside cells without a wall; the threshold between the two faces of a
    wall, which opens to two spaces, stays apart.
    """
    label = label.copy()
    area = shapely.area(cells.polygons)
    sides = np.stack([cells.left, cells.right], axis=1)
    pairs = label[sides[doorways]]
    size = np.bincount(label[inside], area[inside], len(area))
    for k in sorted(np.unique(pairs).tolist(), key=lambda n: size[n]):
        pairs = pairs[pairs[:, 0] != pairs[:, 1]]
        before = np.unique(pairs[(pairs == k).any(axis=1)])
        before = before[before != k]
        around = label[sides[bare & (label[sides] == k).any(axis=1)]]
        is_threshold = size[k] < SMALLEST and len(np.unique(around[around != k])) > 1
        if not len(before) or is_threshold:
            continue
        region = _region(cells, (label == k) & inside)
        if region is None or size[k] < SMALLEST_BEHIND or not _is_room(region, cells, support, path):
            into = int(before[np.argmax(size[before])])
            label[label == k] = into
            pairs[pairs == k] = into
            size[into] += size[k]
    return label


def _closed(line: PlanLine, through: Array, leaving: Array, space: FreeSpace) -> Array:
    """Supported stretches (K, 2) of a line joined over gaps of a door's width, if there is enough wall beside.

    Between two walls that go through the line in such a gap (`through` (n,)) is a corridor, and no door; beside one
    that goes away from the line at a wide gap's end (`leaving` (m,)) a corridor begins.
    """
    joined = [list(line.support[0])]
    for low, high in line.support[1:]:
        last = joined[-1]
        gap = low - last[1]
        beside = (last[1] - last[0]) + (high - low) >= BESIDE_GAP * gap
        between = through[(last[1] < through) & (through < low)]
        crossed = len(between) > 0 and np.ptp(between) > NARROWEST
        passed = gap * space.is_free(line.point(np.linspace(last[1], low, SAMPLES))).mean()
        mouth = passed > WIDEST_DOOR and np.abs(leaving[:, None] - [last[1], low]).min(initial=np.inf) <= JAMB
        if gap <= PASSAGE and beside and not crossed and not mouth:
            last[1] = high
        else:
            joined.append([low, high])
    return np.array(joined)


def _crossed(lines: list[PlanLine]) -> list[tuple[Array, Array]]:
    """For every line the places in its gaps, and at their ends, where walls go through it and away from it."""
    position, sine = crossings(lines)
    seen = np.array([len(line.support) > 0 for line in lines])
    out = []
    for k, line in enumerate(lines):
        narrow = line.support[1:, 0] - line.support[:-1, 1] <= PASSAGE
        low, high = line.support[:-1, 1][narrow] - JAMB, line.support[1:, 0][narrow] + JAMB
        at = position[k][:, None]
        near = np.flatnonzero((sine[k] > STEEP) & seen & ((low < at) & (at < high)).any(axis=1))
        runs = np.array([_run(lines[n].support, position[n, k]) for n in near]).reshape(-1, 2, 2)
        through = (runs[:, :, 0] > THROUGH / 2).all(axis=1)
        leaving = (runs[:, :, 1] > ALL_BUT * AWAY).any(axis=1)
        out.append((position[k, near[through]], position[k, near[leaving]]))
    return out


def _run(support: Array, place: float) -> Array:
    """(2, 2) m of wall before and after a place on a line, within `THROUGH` and within `AWAY` of it."""
    reach = np.array([THROUGH, AWAY])
    at = np.full(2, place)
    return np.stack([coverage(support, at - reach, at), coverage(support, at, at + reach)])


def _walled(cells: Cells, spans: Array, lines: list[PlanLine], space: FreeSpace) -> NDArray[np.bool_]:
    """(E,) edges that a wall covers, with its doors and passages."""
    walled = np.zeros(len(cells.edges), np.bool_)
    for line, on, places in zip(lines, cells.of_lines(len(lines)), _crossed(lines), strict=True):
        if len(line.support) and len(on):
            low, high = spans[on].T
            walled[on] = coverage(_closed(line, *places, space), low, high) >= WALL_SHARE * (high - low)
    return walled


def _gated(cells: Cells, spans: Array, lines: list[PlanLine]) -> NDArray[np.bool_]:
    """(E,) edges in doorways, with what is seen of the walls beside them."""
    gated = np.zeros(len(cells.edges), np.bool_)
    for line, on in zip(lines, cells.of_lines(len(lines)), strict=True):
        if len(line.gates) and len(on):
            low, high = spans[on].T
            wall = coverage(union(np.concatenate([line.support, line.gates])), low, high)
            gated[on] = (wall >= WALL_SHARE * (high - low)) & (coverage(line.gates, low, high) > 0)
    return gated


def _is_room(region: Region, cells: Cells, support: Array, path: Array) -> bool:
    if shapely.contains_xy(region.polygon, path[:, 0], path[:, 1]).any():
        return True
    inside = np.zeros(len(cells.polygons) + 1, np.bool_)  # the last: the outside, index -1
    inside[region.cells] = True
    rim = inside[cells.left] != inside[cells.right]
    return bool(support[rim].sum() >= SUPPORTED * cells.lengths[rim].sum())


def room_names(polygons: list[shapely.Polygon]) -> list[str]:
    """`corridor` for what is long and narrow, else `room 1`, `room 2` ..."""
    names, corridors, rooms = [], 0, 0
    for polygon in polygons:
        aspect = polygon.length**2 / (4 * polygon.area)  # (w + l)^2 / (w l) of a rectangle: 4 if square
        if aspect >= CORRIDOR_ASPECT and 2 * polygon.area / polygon.length <= CORRIDOR_WIDTH:
            corridors += 1
            names.append("corridor" if corridors == 1 else f"corridor {corridors}")
        else:
            rooms += 1
            names.append(f"room {rooms}")
    return names
