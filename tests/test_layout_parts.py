"""Parts of the layout against independent computations."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
import shapely
import shapely.affinity
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from recon.geometry import Array
from recon.layout.cells import cut_plane
from recon.layout.labelling import BOUNDARY, FREE, GLANCED, UNSEEN, UNSUPPORTED, label_cells
from recon.layout.line import NONE, PlanLine, clip, coverage, subtract, total, union
from recon.layout.polygons import SMALLEST_HOLE, room_rings, simple_polygons
from recon.layout.rays import count_rays
from recon.layout.rooms import room_names

LOW, HIGH = np.array([-6.0, -6.0]), np.array([16.0, 16.0])


def plan_lines(seed: int, count: int) -> list[PlanLine]:
    """Random stretches, mostly along two directions (so that many all but meet), some askew."""
    rng = np.random.default_rng(seed)
    base, out = rng.uniform(0, np.pi), []
    for _ in range(count):
        angle = base + rng.integers(4) * np.pi / 2 + (rng.uniform(0, 6) if rng.random() < 0.3 else 0.0)
        direction = np.array([np.cos(angle), np.sin(angle)])
        stretch = np.sort(rng.uniform(-4, 4, 2))[None]
        out.append(PlanLine(rng.uniform(0, 10, 2), direction, stretch, NONE, 0.01, 0.01, "lidar", 3))
    return out


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10_000), st.integers(1, 25))
def test_cells_tile_the_box(seed: int, count: int) -> None:
    lines = plan_lines(seed, count)
    cells = cut_plane(lines, LOW, HIGH)
    assert sum(p.area for p in cells.polygons) == pytest.approx(22.0**2, abs=1e-2)
    assert shapely.union_all(cells.polygons).area == pytest.approx(22.0**2, abs=1e-2)
    for edge, line, left in zip(cells.edges, cells.line, cells.left, strict=True):
        a, b = cells.vertices[edge]
        middle = (a + b) / 2
        if line >= 0:
            assert abs(lines[line].offset(middle[None])[0]) < 0.01
        if left >= 0:
            assert cells.polygons[left].distance(shapely.Point(middle)) < 1e-6


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10_000))
def test_labels_are_the_cheapest_of_all(seed: int) -> None:
    rng = np.random.default_rng(seed)
    lines = plan_lines(seed, 4)
    cells = cut_plane(lines, LOW, HIGH)
    n = len(cells.polygons)
    assume(n <= 12)
    area = shapely.area(cells.polygons)
    visited, glanced = area * rng.uniform(0, 0.5, n), area * rng.uniform(0, 0.5, n)
    support = np.zeros((len(cells.edges), 4))
    support[:, 0] = cells.lengths * rng.uniform(0, 1, len(cells.edges)) * (cells.line >= 0)

    def energy(inside: NDArray[np.bool_]) -> float:
        cost = FREE * visited[~inside].sum() + GLANCED * glanced[~inside].sum()
        cost += UNSEEN * (area - visited - glanced)[inside].sum()
        padded = np.append(inside, False)
        cut = padded[cells.left] != padded[cells.right]
        edge = UNSUPPORTED * (cells.lengths - support[:, 0]) + BOUNDARY * cells.lengths
        return float(cost + edge[cut].sum())

    found = label_cells(cells, lines, visited, glanced, support)
    best = min(energy(np.array(labels)) for labels in product([False, True], repeat=n))
    assert energy(found) == pytest.approx(best, rel=1e-6)


intervals = st.lists(st.tuples(st.integers(0, 40), st.integers(1, 10)), max_size=8).map(
    lambda pairs: np.array([(a, a + length) for a, length in pairs], float).reshape(-1, 2)
)


@given(intervals, intervals)
def test_intervals_as_sets_of_unit_steps(first: Array, second: Array) -> None:
    def steps(pairs: Array) -> set[int]:
        return {k for a, b in pairs for k in range(int(a), int(b))}

    one, two = union(first), union(second)
    assert steps(one) == steps(first) and total(one) == len(steps(first))
    assert np.all(one[1:, 0] > one[:-1, 1])
    assert steps(subtract(one, two)) == steps(first) - steps(second)
    assert steps(clip(one, 5, 20)) == steps(first) & set(range(5, 20))
    assert coverage(one, np.array([5.0]), np.array([20.0]))[0] == len(steps(first) & set(range(5, 20)))


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10_000))
def test_rays_pass_the_cells_on_their_way(seed: int) -> None:
    a, b = np.random.default_rng(seed).uniform(0.5, 19.5, (2, 1, 2))
    hits, passes = count_rays(a, b, np.zeros((20, 20), np.bool_))
    assert hits.sum() == 1 and hits[int(b[0, 1]), int(b[0, 0])] == 1
    dense = a + np.linspace(0, 1, 4001)[:, None] * (b - a)
    seen = {(int(y), int(x)) for x, y in dense}
    walked = {(int(y), int(x)) for y, x in np.argwhere(passes + hits)}
    assert seen <= walked and len(walked) == 1 + int(np.abs(b.astype(int) - a.astype(int)).sum())


def test_rays_stop_before_an_obstacle() -> None:
    blocked = np.zeros((5, 20), np.bool_)
    blocked[2, 10] = True
    hits, passes = count_rays(np.array([[1.5, 2.5]]), np.array([[18.5, 2.5]]), blocked)
    assert hits.sum() == 0 and passes[2, 1:10].all() and passes[2, 10:].sum() == 0


def test_holes_are_cut_across_or_filled() -> None:
    outline = shapely.box(0, 0, 20, 10)
    holes = [shapely.box(3, 3, 8, 7), shapely.box(11, 3, 17, 7)]
    parts = simple_polygons(outline.difference(shapely.union_all(holes)))
    assert all(part.is_valid and len(part.interiors) == 0 for part in parts)
    assert sum(part.area for part in parts) == pytest.approx(200 - 20 - 24, abs=1e-3)
    assert shapely.union_all(parts).area == pytest.approx(200 - 20 - 24, abs=1e-3)
    column = simple_polygons(outline.difference(shapely.box(5, 5, 5.5, 5.5)))
    assert len(column) == 1 and column[0].area == pytest.approx(200)


def _with_holes(seed: int) -> shapely.Polygon:
    """A hall at any angle with up to five holes: blocks, L and C shapes, in each other and apart."""
    rng, holes = np.random.default_rng(seed), []
    for _ in range(rng.integers(1, 6)):
        (w, h), (x, y) = rng.uniform(0.3, 8, 2), rng.uniform(1, 20, 2)
        hole = shapely.affinity.rotate(shapely.box(x, y, x + w, y + h), 90 * rng.random() * (rng.random() < 0.5))
        if rng.random() < 0.4:
            hole = hole.difference(shapely.affinity.translate(hole, *(rng.uniform(-0.6, 0.6, 2) * [w, h])))
        holes.append(hole)
    if rng.random() < 0.3:
        holes += [shapely.LineString([(10, 5), (20, 5), (20, 15), (10, 15)]).buffer(0.7, cap_style="flat")]
    hall = shapely.box(0, 0, 30, 30).difference(shapely.union_all(holes))
    return shapely.affinity.rotate(max(shapely.get_parts(hall), key=shapely.area), rng.uniform(0, 90))


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 100_000))
@example(1198)  # a cut that ends 2 mm beside a corner
def test_cut_up_rooms_are_simple_disjoint_and_whole(seed: int) -> None:
    room = _with_holes(seed)
    filled = [hole for hole in map(shapely.Polygon, room.interiors) if hole.area < SMALLEST_HOLE]
    parts = [shapely.Polygon(ring) for ring in room_rings([room])]
    assert all(part.is_valid and part.exterior.is_ccw for part in parts)
    area = room.area + sum(hole.area for hole in filled)
    assert sum(part.area for part in parts) == pytest.approx(area, abs=1e-3)
    assert shapely.union_all(parts).area == pytest.approx(area, abs=1e-3)
    assert all(a.intersection(b).area < 1e-6 for i, a in enumerate(parts) for b in parts[:i])


def test_a_ring_corridor_is_cut_at_its_narrowest() -> None:
    ring = shapely.box(0, 0, 20, 10).difference(shapely.box(3, 2, 15, 9))
    parts = room_parts(ring)
    assert sum(part.length for part in parts) == pytest.approx(ring.length + 2 * (1.0 + 2.0))
    assert sum(part.area for part in parts) == pytest.approx(ring.area)


def room_parts(*rooms: shapely.Polygon) -> list[shapely.Polygon]:
    return [shapely.Polygon(ring) for ring in room_rings(rooms)]


def test_a_small_room_within_a_room_is_not_filled() -> None:
    kiosk = shapely.box(5, 5, 6.2, 6.2)
    parts = room_parts(shapely.box(0, 0, 12, 10).difference(kiosk), kiosk)
    assert shapely.union_all(parts).area == pytest.approx(120) and sum(p.area for p in parts) == pytest.approx(120)
    assert min(part.area for part in parts) == pytest.approx(kiosk.area)


def test_touching_rooms_share_their_corners() -> None:
    long, short = room_parts(shapely.box(0, 0, 10, 3), shapely.Polygon([(2, 2.9995), (6, 3.0), (6, 7), (2, 7)]))
    assert long.intersection(short).area < 1e-9
    assert {(2.0, 2.9995), (6.0, 3.0)} <= set(long.exterior.coords)


def test_names_tell_corridors_from_rooms() -> None:
    shapes = [shapely.box(0, 0, 14, 2.2), shapely.box(0, 0, 5, 4), shapely.box(0, 0, 9, 1.5), shapely.box(0, 0, 20, 18)]
    assert room_names(shapes) == ["corridor", "room 1", "corridor 2", "room 2"]
