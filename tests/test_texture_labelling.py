"""Which view every block shows: the sum of costs against exact answers."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import maximum_flow

from recon.texture.candidates import KEPT
from recon.texture.labelling import choose_views, seam_cost

Grid = NDArray[np.float32]
Views = NDArray[np.int32]
Problem = tuple[Grid, Views, Grid, tuple[int, int]]


def problem(seed: int, shape: tuple[int, int], views: int, most: int) -> Problem:
    """Random costs; every block is seen by some of the views, at most `most`, or by none."""
    rng = np.random.default_rng(seed)
    n = shape[0] * shape[1]
    cost, view = np.full((n, KEPT), np.inf, np.float32), np.full((n, KEPT), -1, np.int32)
    for block in range(n):
        mine = rng.permutation(views)[: rng.integers(0 if seed % 2 else 1, most + 1)]
        view[block, : len(mine)] = mine
        cost[block, : len(mine)] = rng.uniform(0, rng.choice([1.0, 4.0]), len(mine))
    deviation = np.where(view >= 0, rng.uniform(0, 40, view.shape), 0).astype(np.float32)
    return cost, view, deviation, shape


def total(task: Problem, chosen: Views) -> float:
    """Costs of a choice (rows, columns) and of its seams, counted one by one."""
    cost, view, deviation, (rows, columns) = task
    seam = seam_cost(deviation)
    slots = {}
    out = 0.0
    for row, column in product(range(rows), range(columns)):
        block = row * columns + column
        if view[block, 0] >= 0:
            slots[row, column] = int(np.flatnonzero(view[block] == chosen[row, column])[0])
            out += cost[block, slots[row, column]]
    for (row, column), slot in slots.items():
        for beside in ((row, column + 1), (row + 1, column)):
            if beside in slots and chosen[beside] != chosen[row, column]:
                out += seam[row * columns + column, slot] + seam[beside[0] * columns + beside[1], slots[beside]]
    return out


def independent(task: Problem) -> Views:
    """The cheapest view of every block by itself."""
    cost, view, _, shape = task
    return np.asarray(view[np.arange(len(view)), cost.argmin(axis=1)]).reshape(shape)


def best_of_all(task: Problem) -> float:
    """By trying every choice."""
    _, view, _, shape = task
    choices = [views[views >= 0].tolist() or [-1] for views in view]
    return min(total(task, np.array(c, np.int32).reshape(shape)) for c in product(*choices))


def least_cut(task: Problem) -> float:
    """The exact least total where every block is seen by the views 0 and 1: a minimum cut (SciPy's, integers)."""
    cost, view, deviation, (rows, columns) = task
    by_view = np.argsort(view[:, :2], axis=1)
    own = np.take_along_axis(cost[:, :2], by_view, axis=1).astype(float)
    seam = np.take_along_axis(seam_cost(deviation)[:, :2], by_view, axis=1).astype(float)
    n = rows * columns
    edges = [(n, block, own[block, 1]) for block in range(n)] + [(block, n + 1, own[block, 0]) for block in range(n)]
    for block in range(n):  # a block on the source's side shows view 0
        for other in ([block + 1] if (block + 1) % columns else []) + (
            [block + columns] if block + columns < n else []
        ):
            edges += [(block, other, seam[block, 0] + seam[other, 1]), (other, block, seam[other, 0] + seam[block, 1])]
    first, second, capacity = zip(*edges, strict=True)
    whole = np.round(1e6 * np.array(capacity)).astype(np.int32)
    graph = sparse.csr_array((whole, (first, second)), shape=(n + 2, n + 2))
    return float(maximum_flow(graph, n, n + 1).flow_value) / 1e6


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 2**31), st.integers(1, 12), st.integers(1, 12), st.integers(1, 12))
def test_never_worse_than_the_best_of_each_block(seed: int, rows: int, columns: int, views: int) -> None:
    task = problem(seed, (rows, columns), views, min(views, KEPT))
    chosen = choose_views(*task)
    assert chosen.shape == (rows, columns)
    assert np.array_equal(chosen < 0, task[1][:, 0].reshape(rows, columns) < 0), "a view wherever there is one"
    assert total(task, chosen) <= total(task, independent(task)) + 1e-3


def test_near_the_best_of_all_choices() -> None:
    """Three views on small grids: within 3 % each, 0.5 % on average, where blocks by themselves are 10 % off."""
    tasks = [problem(seed, (3, 3), 4, 3) for seed in range(60)]
    best = np.array([best_of_all(task) for task in tasks])
    found = np.array([total(task, choose_views(*task)) for task in tasks])
    alone = np.array([total(task, independent(task)) for task in tasks])
    assert np.all(found >= best - 1e-4) and np.all(found <= 1.03 * best + 1e-4)
    assert found.sum() < 1.005 * best.sum()
    assert alone.sum() > 1.1 * best.sum(), "problems where seams matter"


@pytest.mark.parametrize("seed", range(6))
def test_two_views_are_solved_exactly(seed: int) -> None:
    rng = np.random.default_rng(seed)
    shape = (12, 15)
    n = shape[0] * shape[1]
    cost, view = np.full((n, KEPT), np.inf, np.float32), np.full((n, KEPT), -1, np.int32)
    view[:, :2] = rng.permuted(np.tile([0, 1], (n, 1)), axis=1)
    cost[:, :2] = rng.uniform(0, 3, (n, 2))
    task = cost, view, rng.uniform(0, 20, view.shape).astype(np.float32), shape
    assert total(task, choose_views(*task)) == pytest.approx(least_cut(task), abs=1e-3)
    assert total(task, independent(task)) > 1.02 * least_cut(task)
