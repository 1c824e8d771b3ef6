"""A drive through every room of a plan that stays clear of walls and objects."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array
from recon.simulate.check import free_space
from recon.simulate.openings import Niche
from recon.simulate.plan import Plan

if TYPE_CHECKING:
    from shapely.geometry import Polygon

CELL = 0.12
"""m; raster of the search."""


@dataclass(frozen=True)
class Grid:
    """Free cells as a graph. points: (N, 2) m, plan frame; graph: sparse (N, N) costs; free: where a drive may go."""

    points: Array
    graph: Any
    free: Polygon

    def nearest(self, point: Array) -> int:
        """The cell nearest to a point."""
        return int(np.argmin(((self.points - point) ** 2).sum(axis=1)))

    def search(self, start: int) -> tuple[Array, NDArray[np.int32]]:
        """Costs (N,) from a cell and predecessors (N,)."""
        from scipy.sparse.csgraph import dijkstra

        cost, before = dijkstra(self.graph, indices=np.array([start]), return_predecessors=True)
        return cost[0], before[0]


def random_route(plan: Plan, found: list[Niche], clearance: float, rng: np.random.Generator) -> list[Array] | None:
    """Way points (2,) through all rooms, nearest first, round each of them, back to the first; None: no way."""
    free = free_space(plan, found).buffer(-clearance)
    if free.is_empty:
        return None
    grid = _grid(free)
    rounds = [_round(plan, r, grid, rng) for r in range(len(plan.rooms))]
    if any(not stops for stops in rounds):
        return None
    at = rounds[0][0]
    way, left = [at], list(range(1, len(rounds))) or [0]
    while left:
        cost, _ = grid.search(at)
        reached = [min((cost[s], s) for s in rounds[r]) for r in left]
        best = int(np.argmin([c for c, _ in reached]))
        if not np.isfinite(reached[best][0]):
            return None
        stops, first = rounds[left.pop(best)], reached[best][1]
        k = stops.index(first)
        for stop in (*stops[k:], *stops[:k], first):
            way, at = way + _cells(grid, at, stop), stop
    for stop in rounds[0][1:] + rounds[0][:1]:
        way, at = way + _cells(grid, at, stop), stop
    return _pulled(grid.free, grid.points[way])


def _grid(free: Polygon) -> Grid:
    import shapely
    from scipy.sparse import coo_array

    x0, y0, x1, y1 = free.bounds
    x, y = np.meshgrid(np.arange(x0, x1, CELL), np.arange(y0, y1, CELL))
    inside = shapely.contains_xy(free, x, y)
    number = np.cumsum(inside).reshape(inside.shape) - 1
    points = np.stack([x[inside], y[inside]], axis=1)
    depth = shapely.distance(free.boundary, shapely.points(points))
    dear = 1.0 + np.exp(-depth / 0.3)
    rows, columns, costs = [], [], []
    for dy, dx in ((0, 1), (1, 0), (1, 1), (1, -1)):
        a = inside[: inside.shape[0] - dy, max(0, -dx) : inside.shape[1] - max(0, dx)]
        b = inside[dy:, max(0, dx) : inside.shape[1] + min(0, dx)]
        both = a & b
        i = number[: inside.shape[0] - dy, max(0, -dx) : inside.shape[1] - max(0, dx)][both]
        j = number[dy:, max(0, dx) : inside.shape[1] + min(0, dx)][both]
        length = CELL * np.hypot(dx, dy) * (dear[i] + dear[j]) / 2
        rows += [i, j]
        columns += [j, i]
        costs += [length, length]
    n = len(points)
    graph = coo_array((np.concatenate(costs), (np.concatenate(rows), np.concatenate(columns))), shape=(n, n)).tocsr()
    return Grid(points, graph, free)


def _round(plan: Plan, room: int, grid: Grid, rng: np.random.Generator) -> list[int]:
    """Cells on a tour round the middle of a room; the ends of a long narrow one."""
    from shapely import Polygon

    space = grid.free.intersection(Polygon(plan.rooms[room].polygon))
    if space.is_empty:
        return []
    ring = _largest(space)
    step = 0.45 * np.sqrt(ring.area / np.pi)
    smaller = ring.buffer(-step)
    while smaller.is_empty and step > 0.05:
        step *= 0.7
        smaller = ring.buffer(-step)
    outline = _largest(smaller if not smaller.is_empty else ring).exterior
    shares = (np.arange(4) + rng.uniform(0, 1)) / 4
    points = [outline.interpolate(s, normalized=True) for s in shares]
    if rng.random() < 0.5:
        points = points[::-1]
    return [grid.nearest(np.array([p.x, p.y])) for p in points]


def _largest(shape: Any) -> Any:
    return max(shape.geoms, key=lambda part: part.area) if hasattr(shape, "geoms") else shape


def _cells(grid: Grid, start: int, end: int) -> list[int]:
    """Cells after `start` up to and including `end` on the cheapest way."""
    _, before = grid.search(end)
    out = []
    while start != end:
        start = int(before[start])
        out.append(start)
    return out


def _pulled(free: Polygon, points: Array) -> list[Array]:
    """Fewer way points: each leg goes on as long as it stays in the free space and near the way found."""
    import shapely

    shapely.prepare(free)
    out, i = [points[0]], 0
    while i < len(points) - 1:
        j = i + 1
        while j + 1 < len(points) and _straight(free, points[i : j + 2]):
            j += 1
        out.append(points[j])
        i = j
    return out


def _straight(free: Polygon, points: Array) -> bool:
    """Whether the leg from the first to the last point is free and no point lies 0.3 m or more off it."""
    import shapely

    leg = shapely.LineString(points[[0, -1]])
    if leg.length < 1e-9:
        return False
    return bool(free.covers(leg) and shapely.distance(leg, shapely.points(points)).max() < 0.3)
