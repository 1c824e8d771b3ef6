"""Which cells are inside: one energy, one graph cut."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray

from recon.geometry import Array
from recon.layout.cells import Cells
from recon.layout.evidence import FreeSpace
from recon.layout.line import PlanLine, coverage, subtract, union

FREE = 5.0
"""Cost per m^2 of visited free space left outside ..."""
GLANCED = 0.5
"""... and of free space only seen through doors and slits."""
UNSEEN = 0.5
"""Cost per m^2 that no ray reached taken inside."""
SOLID = 1.0
"""Cost per m of wall face whose back is taken inside, or whose front is left outside."""
UNSUPPORTED = 1.0
"""Cost per m of boundary without a wall, along or across the walls around it ..."""
CONTINUED = 0.5
"""... where it goes on from a wall, up to `CONTINUATION` m beyond what was seen of it ..."""
CONTINUATION = 1.5
OBLIQUE = 1.3
"""... and in any other direction."""
BOUNDARY = 0.1
"""Cost per m of any boundary: the simpler outline where nothing else decides."""
IMAGE = 3.0
SAMPLES = 9
AHEAD = (0.1, 0.2, 0.3)
"""m before a wall where the space that it was seen from is looked for."""
BRIDGED = 0.1
"""m, gaps in a wall's support that are not counted."""


def areas(cells: Cells, space: FreeSpace, *masks: NDArray[np.bool_]) -> list[Array]:
    """For every mask (C,) m^2 of each cell that grid cells set in it (their middles) cover."""
    owner = _rasterised(cells, space)
    counts = [np.bincount(owner[mask & (owner >= 0)], minlength=len(cells.polygons)) for mask in masks]
    return [np.asarray(count * space.cell_area) for count in counts]


def _rasterised(cells: Cells, space: FreeSpace) -> NDArray[np.int32]:
    """(rows, columns) the cell that the middle of each grid cell lies in, -1 outside all.

    Scanlines: along every row of middles, each edge it crosses begins the cell on its right.
    """
    rows, columns = space.free.shape
    ends = (cells.vertices[cells.edges] - space.origin) / space.resolution - 0.5  # middles are whole numbers
    rising = ends[:, 1, 1] > ends[:, 0, 1]
    low, high = np.sort(ends[:, :, 1], axis=1).T
    first = np.clip(np.ceil(low), 0, rows).astype(np.int64)
    count = np.clip(np.ceil(high), 0, rows).astype(np.int64) - first  # low <= row < high: level edges are not crossed
    edge = np.repeat(np.arange(len(ends)), count)
    row = first[edge] + np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count)
    (x0, y0), (x1, y1) = ends[edge, 0].T, ends[edge, 1].T
    x = x0 + (row - y0) * (x1 - x0) / (y1 - y0)
    right = np.where(rising, cells.right, cells.left)[edge]
    order = np.lexsort((x, row))
    begins = np.full((rows, columns + 1), -1, np.int32)
    # of several in one place the last, the one furthest to the right, stays
    begins[row[order], np.clip(np.ceil(x[order]), 0, columns).astype(np.int64)] = np.arange(len(order))
    np.maximum.accumulate(begins, axis=1, out=begins)  # crossings are numbered along the rows
    last = begins[:, :columns]
    return np.where(last >= 0, np.append(right[order], -1).astype(np.int32)[last], np.int32(-1))


def supports(cells: Cells, lines: list[PlanLine]) -> Array:
    """(E, 4) m of each edge that is supported at all, only from its left, only from its right, or not but nearly.

    The last is what lies up to `CONTINUATION` beyond support.
    """
    out = np.zeros((len(cells.edges), 4))
    spans = cells.spans(lines)
    for line, on in zip(lines, cells.of_lines(len(lines)), strict=True):
        low, high = spans[on, 0], spans[on, 1]
        bridged = union(line.support + np.array([-BRIDGED, BRIDGED]) / 2)
        out[on, 0] = np.minimum(coverage(bridged, low, high), high - low)
        reached = union(np.concatenate([line.support + np.array([-CONTINUATION, CONTINUATION]), line.hidden]))
        out[on, 3] = np.clip(coverage(reached, low, high) - out[on, 0], 0.0, None)
        out[on, 1] = coverage(subtract(line.front, line.back), low, high)
        out[on, 2] = coverage(subtract(line.back, line.front), low, high)
    return out


def trust(cells: Cells, lines: list[PlanLine], space: FreeSpace, visited: NDArray[np.bool_]) -> Array:
    """(E, 2) what the wall faces on the left and right of each edge count: 1, less if only a glance fell on them.

    Walls whose foot an image showed count `IMAGE` whatever the scanner saw: the floor before them was in view.
    """
    start, end = cells.vertices[cells.edges[:, 0]], cells.vertices[cells.edges[:, 1]]
    step = (end - start) / np.maximum(cells.lengths, 1e-9)[:, None]
    normal = np.stack([-step[:, 1], step[:, 0]], axis=1)
    share = (np.arange(SAMPLES) + 0.5) / SAMPLES
    foot = start[:, None] + share[:, None] * (end - start)[:, None]
    glanced = space.free & ~visited
    out = np.ones((len(start), 2))
    for k, side in enumerate((1.0, -1.0)):
        ahead = [space.index((foot + side * distance * normal[:, None]).reshape(-1, 2)) for distance in AHEAD]
        near, only = np.any([visited[i] for i in ahead], axis=0), np.any([glanced[i] for i in ahead], axis=0)
        out[:, k] -= (only & ~near).reshape(-1, SAMPLES).mean(axis=1)
    from_image = np.array([line.source == "image" for line in lines] + [False])  # the last: the frame
    out[from_image[cells.line]] = IMAGE
    return out


def label_cells(
    cells: Cells, lines: list[PlanLine], visited: Array, glanced: Array, support: Array
) -> NDArray[np.bool_]:
    """(C,) whether each cell is inside: the minimum over labellings of

        sum over cells of     FREE * visited + GLANCED * glanced area outside + UNSEEN * unseen area inside
        + sum over walls of   SOLID * length with its back inside or its front outside
        + sum over edges of   (UNSUPPORTED * length without wall + BOUNDARY * length) between inside and outside,

    found exactly by a minimum cut (Greig, Porteous and Seheult 1989; Boykov and Kolmogorov 2004). The energy is that
    of surface reconstruction by labelling cells (Labatut, Pons and Keriven 2009), in the plane.
    """
    import maxflow

    area = shapely.area(cells.polygons)
    cost_outside = FREE * visited + GLANCED * glanced
    cost_inside = UNSEEN * np.clip(area - visited - glanced, 0.0, None)
    for side, other, k in ((cells.left, cells.right, 1), (cells.right, cells.left, 2)):
        np.add.at(cost_outside, side[side >= 0], SOLID * support[side >= 0, k])
        np.add.at(cost_inside, other[other >= 0], SOLID * support[other >= 0, k])
    oblique = np.array([line.oblique for line in lines] + [False])  # the last: the frame
    price = np.where(oblique[cells.line], OBLIQUE, UNSUPPORTED)
    bare = cells.lengths - support[:, 0] - support[:, 3]
    weight = price * bare + CONTINUED * support[:, 3] + BOUNDARY * cells.lengths
    outer = (cells.left < 0) | (cells.right < 0)
    np.add.at(cost_inside, np.maximum(cells.left, cells.right)[outer], weight[outer])
    graph = maxflow.Graph[float](len(area), len(weight))
    nodes = graph.add_nodes(len(area))
    for c in range(len(area)):
        graph.add_tedge(nodes[c], cost_outside[c], cost_inside[c])
    for a, b, w in zip(cells.left[~outer], cells.right[~outer], weight[~outer], strict=True):
        graph.add_edge(nodes[a], nodes[b], w, w)
    graph.maxflow()
    return np.asarray(graph.get_grid_segments(nodes)) == 0
