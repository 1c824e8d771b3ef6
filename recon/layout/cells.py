"""The plane cut by lines into cells."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from recon.geometry import Array
from recon.layout.line import PlanLine, crossings, union

SNAP = 0.001
"""m, crossings closer than this are one corner."""
STUB = 0.8
"""m that a stretch goes on past the wall it ends at: what it ends at may be furniture before the corner."""
FURTHEST = 15.0
"""m that a stretch goes on where it meets no wall: a wall is continued in its own part of the building."""
EDGE = 0.02
"""m that it goes on past the box around everything (so that the crossing is found)."""
REACH = 0.05
"""m, a supported stretch stops lines that pass its end this closely."""
STEEP = float(np.sin(np.radians(15.0)))
"""A line that meets a wall more flatly is not stopped by it."""
PARALLEL = 1e-6
STOPPING = 1.0
"""m, a stretch shorter than this stops no other line."""


@dataclass(frozen=True)
class Cells:
    """Polygons that lines cut the plane into, and the edges between them.

    polygons: C shapely polygons, disjoint. vertices: (V, 2) m. edges: (E, 2) vertex indices.
    line: (E,) index of the line an edge lies on, -1 for the frame around everything.
    left, right: (E,) cell on the left and right of an edge from its first to its second vertex, -1 for the outside;
    edges run in the direction of their line.
    """

    polygons: NDArray[np.object_]
    vertices: Array
    edges: NDArray[np.int64]
    line: NDArray[np.int64]
    left: NDArray[np.int64]
    right: NDArray[np.int64]

    @property
    def lengths(self) -> Array:
        """(E,) m."""
        return np.asarray(np.linalg.norm(self.vertices[self.edges[:, 1]] - self.vertices[self.edges[:, 0]], axis=1))

    def spans(self, lines: list[PlanLine]) -> Array:
        """(E, 2) start and end of each edge as positions along its line; nan on the frame."""
        out = np.full((len(self.edges), 2), np.nan)
        for line, on in zip(lines, self.of_lines(len(lines)), strict=True):
            out[on] = line.along(self.vertices[self.edges[on]].reshape(-1, 2)).reshape(-1, 2)
        return out

    def of_lines(self, count: int) -> list[NDArray[np.int64]]:
        """Edges on each of `count` lines."""
        order = np.argsort(self.line, kind="stable")
        return np.split(order, np.searchsorted(self.line[order], np.arange(count + 1)))[1:-1]

    def corners(self, ring: shapely.LinearRing) -> NDArray[np.int64]:
        """(n,) vertices along the ring of a union of cells, the first not repeated."""
        return np.asarray(self._tree.query(np.asarray(ring.coords)[:-1])[1], dtype=np.int64)

    def edges_between(self, start: NDArray[np.int64], end: NDArray[np.int64]) -> NDArray[np.int64]:
        """(n,) the edge that joins each two vertices, either way round."""
        low, high = np.minimum(start, end), np.maximum(start, end)
        key, order = self._keys
        return order[np.searchsorted(key, low * len(self.vertices) + high)]

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self.vertices)

    @cached_property
    def _keys(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """One sorted number for every edge, and the edges in this order."""
        key = self.edges.min(axis=1) * len(self.vertices) + self.edges.max(axis=1)
        order = np.argsort(key)
        return key[order], order


def cut_plane(lines: list[PlanLine], low: Array, high: Array) -> Cells:
    """Cells of the box `low` to `high` (2,) m, cut by the stretches of `lines`, each drawn out to the next wall."""
    frame = _frame(low, high)
    everything = lines + frame
    position, sine = crossings(everything)
    stopped = sine > STEEP
    stopped[:, len(lines) :] = sine[:, len(lines) :] > PARALLEL  # the frame stops every line
    stretches = _stretches(everything, len(lines), position, stopped)
    points, owner, along = _cuts(everything, stretches, position, sine > PARALLEL)
    vertex, vertices = _snapped(points)
    edges, line = _chain(vertex, owner, along, stretches)
    line[line >= len(lines)] = -1
    return _faces(vertices, edges, line)


def _frame(low: Array, high: Array) -> list[PlanLine]:
    """Four sides of the box as lines, supported along their whole length (so that nothing leaves it)."""
    corners = np.array([[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]])
    sides = []
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        length = float(np.linalg.norm(b - a))
        sides.append(PlanLine(a, (b - a) / length, np.array([[0.0, length]]), np.zeros((0, 2)), 0, 0, "inferred", 0))
    return sides


def _stretches(lines: list[PlanLine], n: int, position: Array, crossing: NDArray[np.bool_]) -> list[Array]:
    """Per line the stretches (K, 2) to draw: the supported ones and frontiers, on to the first wall that they meet."""
    supports = [line.support for line in lines]
    stops = np.zeros_like(crossing)
    for j, support in enumerate(supports):
        walls = support[support[:, 1] - support[:, 0] >= STOPPING]
        t = position[j]
        stops[:, j] = crossing[:, j] & np.any(
            (t[:, None] >= walls[:, 0] - REACH) & (t[:, None] <= walls[:, 1] + REACH), axis=1
        )
    out = []
    for i, support in enumerate(supports[:n]):
        ahead = np.sort(position[i][stops[i]])
        drawn = [(_before(ahead, a), _after(ahead, b)) for a, b in np.concatenate([support, lines[i].frontier])]
        out.append(union(np.array(drawn)))
    return out + supports[n:]


def _before(stops: Array, a: float) -> float:
    return -_after(-stops[::-1], -a)


def _after(stops: Array, b: float) -> float:
    """Where a stretch that was seen up to `b` ends: past all walls about there, else past the next one (sorted)."""
    k = int(np.searchsorted(stops, b + REACH))
    if k == 0 or stops[k - 1] < b - REACH:
        k = min(k + 1, len(stops))
    return float(min(stops[k - 1] + STUB, stops[-1] + EDGE, b + FURTHEST))


def _cuts(
    lines: list[PlanLine], stretches: list[Array], position: Array, crossing: NDArray[np.bool_]
) -> tuple[Array, NDArray[np.int64], Array]:
    """Crossings of drawn stretches: points (P, 2), each listed for both of its lines (owner (P,), position (P,))."""
    drawn = np.zeros_like(crossing)
    for k, s in enumerate(stretches):
        t = position[k]
        drawn[k] = np.any((t[:, None] >= s[:, 0] - SNAP) & (t[:, None] <= s[:, 1] + SNAP), axis=1)
    i, j = np.nonzero(crossing & drawn & drawn.T)
    origin = np.array([line.origin for line in lines])
    direction = np.array([line.direction for line in lines])
    first = np.minimum(i, j)  # one formula for both listings: the very same point
    second = np.maximum(i, j)
    points = origin[first] + position[first, second][:, None] * direction[first]
    return points, i.astype(np.int64), position[i, j]


def _snapped(points: Array) -> tuple[NDArray[np.int64], Array]:
    """Vertex of each point (P,) and vertices (V, 2): points within `SNAP` of each other become their mean."""
    pairs = cKDTree(points).query_pairs(SNAP, output_type="ndarray")
    graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(points), len(points)))
    count, component = connected_components(graph, directed=False)
    label = np.asarray(component, dtype=np.int64)
    weight = np.bincount(label, minlength=count)
    mean = np.stack([np.bincount(label, points[:, k], count) / weight for k in range(2)], axis=1)
    return label, mean


def _chain(
    vertex: NDArray[np.int64], owner: NDArray[np.int64], along: Array, stretches: list[Array]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Edges (E, 2) between neighbouring vertices of each drawn stretch, and their lines (E,); no edge twice."""
    order = np.lexsort((along, owner))
    i, j = order[:-1], order[1:]
    middle = (along[i] + along[j]) / 2
    same = (owner[i] == owner[j]) & (vertex[i] != vertex[j])
    starts = np.searchsorted(owner[order], np.arange(len(stretches) + 1))
    for k, s in enumerate(stretches):
        part = slice(starts[k], max(starts[k + 1] - 1, starts[k]))
        t = middle[part, None]
        same[part] &= np.any((s[:, 0] <= t) & (t <= s[:, 1]), axis=1)
    i, j = i[same], j[same]
    edges = np.stack([vertex[i], vertex[j]], axis=1)
    _, first = np.unique(np.sort(edges, axis=1), axis=0, return_index=True)
    first.sort()
    return edges[first], owner[i][first]


def _faces(vertices: Array, edges: NDArray[np.int64], line: NDArray[np.int64]) -> Cells:
    """Cells from edges: polygons are traced by shapely and matched to the edges by their corners."""
    polygons = shapely.get_parts(shapely.polygonize(shapely.linestrings(vertices[edges])))
    # the cell on the left of the way round, round its holes too
    rings, cell = shapely.get_rings(shapely.orient_polygons(polygons), return_index=True)
    points, ring = shapely.get_coordinates(rings, return_index=True)
    corner = np.asarray(cKDTree(vertices).query(points)[1], dtype=np.int64)
    step = ring[:-1] == ring[1:]
    start, end, owner = corner[:-1][step], corner[1:][step], cell[ring[:-1][step]]
    key, count = edges[:, 0] * len(vertices) + edges[:, 1], len(vertices)
    order = np.argsort(key)
    sides = []
    for way in (start * count + end, end * count + start):
        at = np.minimum(np.searchsorted(key[order], way), len(key) - 1)
        found = key[order][at] == way
        side = np.full(len(edges), -1, np.int64)
        side[order[at[found]]] = owner[found]
        sides.append(side)
    left, right = sides
    used = (left >= 0) | (right >= 0)
    return Cells(polygons, vertices, edges[used], line[used], left[used], right[used])
