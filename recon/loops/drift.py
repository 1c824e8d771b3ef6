"""How uncertain two poses are to one another: along the surest way through the graph of measurements (compiled)."""

from __future__ import annotations

import heapq
import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from recon.geometry import Array
from recon.graph.edges import Edges

Ints = NDArray[np.int64]

LEVER = 10.0
"""m: what a heading uncertainty counts as when ways are compared."""


@njit(cache=True)
def compose_covariance(a: Array, cov_a: Array, b: Array, cov_b: Array) -> Array:
    """(3, 3) covariance of a composed with b, of [x, y, yaw] in the frame of each one's earlier pose."""
    c, s = math.cos(a[2]), math.sin(a[2])
    first, turn = np.eye(3), np.eye(3)
    first[0, 2], first[1, 2] = -(s * b[0] + c * b[1]), c * b[0] - s * b[1]
    turn[0, 0], turn[0, 1], turn[1, 0], turn[1, 1] = c, -s, s, c
    return first @ cov_a @ first.T + turn @ cov_b @ turn.T


@njit(cache=True)
def compose(a: Array, b: Array) -> Array:
    """a_from_b (3,) and b_from_c (3,) give a_from_c."""
    c, s = math.cos(a[2]), math.sin(a[2])
    yaw = (a[2] + b[2] + math.pi) % (2 * math.pi) - math.pi
    return np.array([a[0] + c * b[0] - s * b[1], a[1] + s * b[0] + c * b[1], yaw])


@njit(cache=True)
def chain_between(relative: Array, covariance: Array, cuts: Ints) -> tuple[Array, Array]:
    """Composed motions (M-1, 3) and covariances (M-1, 3, 3) between scans `cuts` (M,) of a chain of N-1 motions."""
    poses, spread = np.zeros((len(cuts) - 1, 3)), np.zeros((len(cuts) - 1, 3, 3))
    for m in range(len(cuts) - 1):
        for k in range(cuts[m], cuts[m + 1]):
            spread[m] = compose_covariance(poses[m], spread[m], relative[k], covariance[k])
            poses[m] = compose(poses[m], relative[k])
    return poses, spread


class Drift:
    """Relative covariances between the nodes of a graph of measurements.

    The covariance along one way of measurements is never smaller than that of the whole graph, so a window made of it
    is wide enough.
    """

    def __init__(self, nodes: int, edges: Edges) -> None:
        first, second = np.concatenate([edges.first, edges.second]), np.concatenate([edges.second, edges.first])
        order = np.argsort(first, kind="stable")
        self._start = np.searchsorted(first[order], np.arange(nodes + 1))
        self._other = second[order]
        self._edge = order % max(len(edges), 1)
        self._variance = np.ascontiguousarray(edges.covariance[:, [0, 1, 2], [0, 1, 2]])

    def spread(self, node: int, poses: Array, most: float, wanted: Ints) -> Array:
        """(W, 2) variances [position m^2, the worse axis; heading rad^2] of the `wanted` (W,) nodes seen from `node`.

        Infinite where `most` (m^2, a heading at `LEVER` counted too) is exceeded on every way.
        """
        return _surest(self._start, self._other, self._edge, self._variance, poses, node, most, wanted)


@njit(cache=True)
def _surest(
    start: Ints, other: Ints, edge: Ints, variance: Array, poses: Array, node: int, most: float, wanted: Ints
) -> Array:
    """Dijkstra's ways, until all wanted nodes are reached.

    Along each: sums of position variance, heading variance, and the moments that make levers.
    """
    count = len(start) - 1
    cost = np.full(count, math.inf)
    # position variance, heading variance, and heading variance times the place it acts from (x, y) and its square
    sums = np.zeros((count, 5))
    cost[node] = 0.0
    waiting, left = np.zeros(count, np.bool_), len(wanted)
    for j in wanted:
        waiting[j] = True
    heap = [(0.0, node)]
    while heap and left > 0:
        so_far, k = heapq.heappop(heap)
        if so_far > most:
            break
        if so_far > cost[k]:
            continue
        if waiting[k]:
            waiting[k] = False
            left -= 1
        for i in range(start[k], start[k + 1]):
            j, v = other[i], variance[edge[i]]
            position = max(v[0], v[1])
            reached = so_far + position + LEVER * LEVER * v[2]
            if reached < cost[j]:
                cost[j] = reached
                x, y = poses[k, 0], poses[k, 1]
                sums[j, 0] = sums[k, 0] + position
                sums[j, 1] = sums[k, 1] + v[2]
                sums[j, 2] = sums[k, 2] + v[2] * x
                sums[j, 3] = sums[k, 3] + v[2] * y
                sums[j, 4] = sums[k, 4] + v[2] * (x * x + y * y)
                heapq.heappush(heap, (reached, j))
    out = np.full((len(wanted), 2), math.inf)
    for i, j in enumerate(wanted):
        if waiting[j]:
            continue
        x, y = poses[j, 0], poses[j, 1]
        lever = sums[j, 4] - 2 * (x * sums[j, 2] + y * sums[j, 3]) + (x * x + y * y) * sums[j, 1]
        out[i, 0], out[i, 1] = sums[j, 0] + max(lever, 0.0), sums[j, 1]
    return out
