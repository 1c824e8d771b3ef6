"""Covariances of poses and walls, from the linearised factor graph."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from recon.geometry import Array
from recon.graph.linear import LinearGraph

Ints = NDArray[np.int64]


class Covariance:
    """The inverse of the information matrix, as far as it is asked for.

    Every variable is a Pose2 of three numbers in its own frame (x, y, yaw); variable k has rows 3k to 3k+2. GTSAM
    eliminates them in an order found by nested dissection, which leaves a sparse triangular root R of the information,
    R^T R, of 3 by 3 blocks. What is needed of the inverse follows from it without ever being dense: the variables' own
    blocks by the recursion of Takahashi et al. (1973), blocks between two variables by a solution along their ways
    to the root of the elimination tree, which nested dissection keeps short.
    """

    def __init__(self, graph: LinearGraph) -> None:
        net, variables = graph.eliminate(), graph.variables
        rows = [net.at(i) for i in range(variables)]
        keys = [row.keys() for row in rows]
        self._at = np.empty(variables, np.int64)
        self._at[[k[0] for k in keys]] = np.arange(variables)
        self._start = np.concatenate([[0], np.cumsum([len(k) - 1 for k in keys])]).astype(np.int64)
        self._own = np.linalg.inv(np.array([row.R() for row in rows]))
        column = self._at[np.array([other for k in keys for other in k[1:]], dtype=np.int64)]
        beside = np.concatenate([np.zeros((3, 0)), *(row.S() for row in rows)], axis=1)
        number = np.repeat(np.arange(variables), np.diff(self._start))
        sort = np.lexsort((column, number))
        self._column = column[sort]
        self._beside = np.ascontiguousarray(beside.reshape(3, -1, 3).transpose(1, 0, 2)[sort])
        self._unknown = np.zeros((variables, 3, 0))

    def add_unknown(self, pull: Array, sigma: float) -> None:
        """Widen by a number that was estimated apart, with standard deviation `sigma`.

        pull: (3V, 1) `LinearGraph.pull` of how much one unit of it moves the residuals.
        """
        more = -sigma * self._solve(pull).reshape(-1, 3, 1)
        self._unknown = np.concatenate([self._unknown, more], axis=2)

    def blocks(self) -> Array:
        """(V, 3, 3) marginal covariance of every variable."""
        own = _marginals(self._start, self._column, self._own, self._beside)[self._at]
        return np.asarray(own + self._unknown @ self._unknown.transpose(0, 2, 1))

    def between(self, first: Ints, second: Ints) -> Array:
        """(P, 3, 3) cross-covariance of pairs of variables `first` and `second` (P,)."""
        order = np.argsort(second, kind="stable")
        out = np.empty((len(order), 3, 3))
        out[order] = _cross(
            self._start, self._column, self._own, self._beside, self._at[first[order]], self._at[second[order]]
        )
        return np.asarray(out + self._unknown[first] @ self._unknown[second].transpose(0, 2, 1))

    def leverage(self, pull: Array) -> float:
        """Degrees of freedom that the solution takes from some factors: the trace of J S J^T of their rows J.

        Estimated with random signs (Hutchinson 1990). pull: (3V, P) their `LinearGraph.random_pull`.
        """
        return float(np.sum(pull * self._solve(pull)) / pull.shape[1])

    def _solve(self, right: Array) -> Array:
        """The inverse of the information times `right` (3V, n)."""
        columns = right.reshape(len(self._at), 3, -1)
        ordered = np.empty_like(columns)
        ordered[self._at] = columns
        _solve_rows(self._start, self._column, self._own, self._beside, ordered)
        return np.asarray(ordered[self._at].reshape(right.shape))


@njit(cache=True)
def _find(column: Ints, low: int, high: int, wanted: int) -> int:
    """Where the sorted `column` holds what is wanted, between low and high."""
    while low < high:
        middle = (low + high) // 2
        if column[middle] < wanted:
            low = middle + 1
        else:
            high = middle
    return low


@njit(cache=True)
def _add(out: Array, a: Array, b: Array, sign: float) -> None:
    """Adds `sign` times a (3, 3) by b (3, n); written out, since BLAS is slow on matrices this small."""
    for j in range(b.shape[1]):
        for i in range(3):
            out[i, j] += sign * (a[i, 0] * b[0, j] + a[i, 1] * b[1, j] + a[i, 2] * b[2, j])


@njit(cache=True)
def _multiply(a: Array, b: Array) -> None:
    """Replaces b (3, n) by a (3, 3) times it."""
    for j in range(b.shape[1]):
        x, y, z = b[0, j], b[1, j], b[2, j]
        for i in range(3):
            b[i, j] = a[i, 0] * x + a[i, 1] * y + a[i, 2] * z


@njit(cache=True)
def _marginals(start: Ints, column: Ints, own: Array, beside: Array) -> Array:
    """(V, 3, 3) diagonal blocks of (R^T R)^-1, from the last row up; own: inverses of R's diagonal blocks."""
    out, off, gain = np.zeros_like(own), np.zeros_like(beside), beside.copy()
    for i in range(len(own) - 1, -1, -1):
        low, high = start[i], start[i + 1]
        for k in range(low, high):
            _multiply(own[i], gain[k])
        for k in range(low, high):
            p = column[k]
            _add(off[k], gain[k], out[p], -1.0)
            place = start[p]
            for m in range(k + 1, high):
                place = _find(column, place, start[p + 1], column[m])
                _add(off[k], gain[m], off[place].T, -1.0)
                _add(off[m], gain[k], off[place], -1.0)
        _add(out[i], own[i], own[i].T, 1.0)
        for k in range(low, high):
            _add(out[i], off[k], gain[k].T, -1.0)
        out[i] = (out[i] + out[i].T) / 2
    return out


@njit(cache=True)
def _cross(start: Ints, column: Ints, own: Array, beside: Array, first: Ints, second: Ints) -> Array:
    """(P, 3, 3) blocks (first, second) of (R^T R)^-1; pairs sorted by `second`."""
    count = len(own)
    out, forward, back = np.empty((len(first), 3, 3)), np.zeros((count, 3, 3)), np.zeros((count, 3, 3))
    done, way = np.full(count, -1, np.int64), np.empty(count, np.int64)
    low = 0
    while low < len(first):
        s, high = second[low], low
        i, forward[s] = s, np.eye(3)
        while i >= 0:  # R^-T times unit vectors: nothing but the way to the root of the elimination tree
            _multiply(own[i].T, forward[i])
            for k in range(start[i], start[i + 1]):
                _add(forward[column[k]], beside[k].T, forward[i], -1.0)
            i = column[start[i]] if start[i + 1] > start[i] else -1
        while high < len(first) and second[high] == s:
            steps, i = 0, first[high]
            while i >= 0 and done[i] != s:
                way[steps], done[i], steps = i, s, steps + 1
                i = column[start[i]] if start[i + 1] > start[i] else -1
            for j in range(steps - 1, -1, -1):  # and R^-1 times that, from the root down
                i = way[j]
                back[i] = forward[i]
                for k in range(start[i], start[i + 1]):
                    _add(back[i], beside[k], back[column[k]], -1.0)
                _multiply(own[i], back[i])
            out[high] = back[first[high]]
            high += 1
        i = s
        while i >= 0:
            forward[i] = 0.0
            i = column[start[i]] if start[i + 1] > start[i] else -1
        low = high
    return out


@njit(cache=True)
def _solve_rows(start: Ints, column: Ints, own: Array, beside: Array, right: Array) -> None:
    """Replaces `right` (V, 3, n) by (R^T R)^-1 times it."""
    for i in range(len(own)):
        _multiply(own[i].T, right[i])
        for k in range(start[i], start[i + 1]):
            _add(right[column[k]], beside[k].T, right[i], -1.0)
    for i in range(len(own) - 1, -1, -1):
        for k in range(start[i], start[i + 1]):
            _add(right[i], beside[k], right[column[k]], -1.0)
        _multiply(own[i], right[i])
