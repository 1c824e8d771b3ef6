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
from recon.layout.line import PlanLine, coverage

WALL_SHARE = 0.5
"""An edge between two inside cells is a wall from this supported share on."""
PASSAGE = 2.2
"""m, gaps up to this width between two stretches of one wall part rooms ..."""
BESIDE_GAP = 0.5
"""... if these are, together, this share of the gap long."""
SMALLEST = 1.0
"""m^2"""
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
    parting = both & (wall | glance | _walled(cells, spans, lines))
    link = both & ~parting
    count = len(cells.polygons)
    graph = coo_array((np.ones(link.sum()), (cells.left[link], cells.right[link])), shape=(count, count))
    _, label = connected_components(graph, directed=False)
    found = []
    for k in np.unique(label[inside]):
        members = np.flatnonzero((label == k) & inside)
        polygon = shapely.union_all(cells.polygons[members])
        if polygon.geom_type == "Polygon" and polygon.area >= SMALLEST:
            found.append(Region(members, polygon))
    found.sort(key=lambda region: -region.polygon.area)
    kept = [region for region in found if _is_room(region, cells, support, path)]
    return kept or found[:1], both & wall


def _closed(support: Array) -> Array:
    """Supported stretches (K, 2) of a line joined over gaps of a door's width, if there is enough wall beside."""
    joined = [list(support[0])]
    for low, high in support[1:]:
        gap = low - joined[-1][1]
        if gap <= PASSAGE and (joined[-1][1] - joined[-1][0]) + (high - low) >= BESIDE_GAP * gap:
            joined[-1][1] = high
        else:
            joined.append([low, high])
    return np.array(joined)


def _walled(cells: Cells, spans: Array, lines: list[PlanLine]) -> NDArray[np.bool_]:
    """(E,) edges that a wall covers, with its doors and passages."""
    walled = np.zeros(len(cells.edges), np.bool_)
    for line, on in zip(lines, cells.of_lines(len(lines)), strict=True):
        if len(line.support) and len(on):
            low, high = spans[on].T
            walled[on] = coverage(_closed(line.support), low, high) >= WALL_SHARE * (high - low)
    return walled


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
