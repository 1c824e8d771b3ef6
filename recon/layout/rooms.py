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
SMALLEST_HOLE = 2.0
"""m^2; smaller holes in a room are things in it, larger ones split it into simple polygons."""
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


def simple_polygons(polygon: shapely.Polygon) -> list[shapely.Polygon]:
    """A polygon as polygons without holes: small holes are filled, at others it is cut across to its outline."""
    holes = [hole for hole in polygon.interiors if shapely.Polygon(hole).area >= SMALLEST_HOLE]
    polygon = shapely.Polygon(polygon.exterior, holes)
    if not holes:
        return [polygon]
    cuts = _cuts(polygon, holes[0])
    parts = shapely.polygonize([shapely.union_all([polygon.boundary, *cuts])]).geoms
    inner = [part for part in parts if polygon.contains(part.representative_point())]
    if len(inner) < 2:
        return [shapely.Polygon(polygon.exterior)]
    return [simple for part in inner for simple in simple_polygons(part)]


def _cuts(polygon: shapely.Polygon, hole: shapely.LinearRing) -> list[shapely.LineString]:
    """The two shortest cuts from a hole to the rest of the boundary that go on along its sides."""
    corners = np.asarray(hole.coords)[:-1]
    reach = 2 * float(np.hypot(*np.subtract(polygon.bounds[2:], polygon.bounds[:2])))
    found: list[tuple[float, int, shapely.LineString]] = []
    for i, corner in enumerate(corners):
        for other in (corners[i - 1], corners[(i + 1) % len(corners)]):
            step = (corner - other) / np.linalg.norm(corner - other)
            inner = shapely.LineString([corner + 1e-6 * step, corner + reach * step]).intersection(polygon)
            first = shapely.get_parts(inner)[:1]
            if len(first) and first[0].distance(shapely.Point(corner)) < 1e-5:
                end = np.asarray(first[0].coords)[-1] + 1e-6 * step
                found.append((float(first[0].length), i, shapely.LineString([corner, end])))
    found.sort(key=lambda cut: cut[:2])
    first_cut = found[:1]
    second = [cut for cut in found[1:] if cut[1] != first_cut[0][1] and not cut[2].intersects(first_cut[0][2])][:1]
    return [cut[2] for cut in first_cut + second]


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
