"""Correlative scan matching: the best pose in a whole window, whatever the guess (compiled).

Two levels of resolution as in Olson, "Real-time correlative scan matching", ICRA 2009: each coarse cell holds the
maximum of the fine cells it stands for, so that a coarse score bounds the fine scores from above.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from recon.geometry import Array
from recon.lidar.cloud import Cloud
from recon.lidar.localmap import LocalMap

Ints = NDArray[np.int64]

FINE = 0.05
"""m, cell of the fine level."""
STRIDE = 4
"""Fine cells a coarse cell is wide."""
TURN = math.radians(1.0)
"""rad between the headings tried."""
BLUR = 0.06
"""m, standard deviation of the likelihood around a map point."""
MAX_POINTS = 120
APART = (0.3, math.radians(5.0))
"""m, rad between two places that an alignment from one would not tell apart."""
PRIOR_WEIGHT = 0.01
"""What the squared normalised distance from the prior costs, in shares of the scan's points."""


def search(
    cloud: Cloud, local: LocalMap, prior: Array, prior_information: Array, window: Array, places: int = 1
) -> Array:
    """Poses (places, 3) at which most of the cloud lies on the map, within `window` (m, rad) (2,) of the prior (3,).

    The best comes first; each other one is the best that is `APART` from those before it. The distance from the prior
    (information (3, 3), map frame) decides between places that look alike.
    """
    thin = max(1, -(-len(cloud) // MAX_POINTS))
    xy, grid = cloud.xy[::thin].copy(), _likelihood(local.points, local.corner)
    shifts, turns = int(window[0] / (FINE * STRIDE)) + 1, int(window[1] / TURN)
    cells = np.zeros((2 * turns + 1, len(xy), 2), np.int64)
    bounds = _bounds(xy, _coarse(grid), local.corner, prior, prior_information, shifts, turns, cells)
    order = np.argsort(-bounds, kind="stable")
    poses = np.empty((places, 3))
    for k in range(places):
        poses[k] = _best(grid, cells, bounds, order, prior, prior_information, shifts, turns, poses[:k])
    return poses


@njit(cache=True)
def _likelihood(points: Array, corner: Array) -> Array:
    """Fine grid of exp(-d^2 / 2 blur^2), d being the distance from the cell to the nearest map point."""
    margin = int(3 * BLUR / FINE) + 1
    size_u, size_v = 0, 0
    for i in range(len(points)):
        size_u = max(size_u, int((points[i, 0] - corner[0]) / FINE))
        size_v = max(size_v, int((points[i, 1] - corner[1]) / FINE))
    grid = np.zeros((size_u + 1 + margin, size_v + 1 + margin))
    for i in range(len(points)):
        pu, pv = (points[i, 0] - corner[0]) / FINE, (points[i, 1] - corner[1]) / FINE
        for u in range(max(0, int(pu) - margin), min(grid.shape[0], int(pu) + margin + 1)):
            for v in range(max(0, int(pv) - margin), min(grid.shape[1], int(pv) + margin + 1)):
                square = ((u + 0.5 - pu) ** 2 + (v + 0.5 - pv) ** 2) * FINE * FINE
                grid[u, v] = max(grid[u, v], math.exp(-0.5 * square / BLUR**2))
    return grid


@njit(cache=True)
def _coarse(grid: Array) -> Array:
    """(H + STRIDE - 1, W + STRIDE - 1): [u, v] is the maximum of grid[u - STRIDE + 1 : u + 1, the same for v]."""
    h, w, more = grid.shape[0], grid.shape[1], STRIDE - 1
    rows, out = np.zeros((h + more, w)), np.zeros((h + more, w + more))
    for u in range(h):
        for v in range(w):
            for k in range(STRIDE):
                rows[u + k, v] = max(rows[u + k, v], grid[u, v])
    for u in range(h + more):
        for v in range(w):
            for k in range(STRIDE):
                out[u, v + k] = max(out[u, v + k], rows[u, v])
    return out


@njit(cache=True)
def _bounds(
    xy: Array, coarse: Array, corner: Array, prior: Array, information: Array, shifts: int, turns: int, cells: Ints
) -> Array:
    """Score that no pose of each block (heading, STRIDE x STRIDE shifts) exceeds; writes the points' cells."""
    across = 2 * shifts + 1
    bounds = np.zeros((2 * turns + 1) * across * across)
    for t in range(2 * turns + 1):
        _place(xy, prior, (t - turns) * TURN, corner, cells[t])
        for i in range(across):
            for j in range(across):
                du, dv = (i - shifts) * STRIDE, (j - shifts) * STRIDE
                # the coarse cell at [u + more] covers the fine cells u to u + more, i.e. all shifts of this block
                score = _score(coarse, cells[t], du + STRIDE - 1, dv + STRIDE - 1)
                centre = 0.5 * (STRIDE - 1)
                cost = _prior_cost(du + centre, dv + centre, (t - turns) * TURN, information)
                bounds[(t * across + i) * across + j] = score - cost
    return bounds


@njit(cache=True)
def _best(
    grid: Array, cells: Ints, bounds: Array, order: Ints, prior: Array, information: Array, shifts: int, turns: int,
    others: Array,
) -> Array:  # fmt: skip
    """The best pose (3,) apart from others (k, 3): blocks in the order of their bounds, until none can be better."""
    best, pose, across = -math.inf, prior.copy(), 2 * shifts + 1
    for index in order:
        if bounds[index] <= best:
            break
        t, rest = index // (across * across), index % (across * across)
        first_u, first_v = (rest // across - shifts) * STRIDE, (rest % across - shifts) * STRIDE
        yaw = (t - turns) * TURN
        for du in range(first_u, first_u + STRIDE):
            for dv in range(first_v, first_v + STRIDE):
                if not _is_apart(prior[0] + du * FINE, prior[1] + dv * FINE, prior[2] + yaw, others):
                    continue
                score = _score(grid, cells[t], du, dv) - _prior_cost(float(du), float(dv), yaw, information)
                if score > best:
                    best = score
                    pose[0], pose[1], pose[2] = prior[0] + du * FINE, prior[1] + dv * FINE, prior[2] + yaw
    return pose


@njit(cache=True)
def _is_apart(x: float, y: float, yaw: float, others: Array) -> bool:
    for k in range(len(others)):
        near = math.hypot(x - others[k, 0], y - others[k, 1]) < APART[0]
        if near and abs(yaw - others[k, 2]) < APART[1]:
            return False
    return True


@njit(cache=True)
def _place(xy: Array, prior: Array, yaw: float, corner: Array, cells: Ints) -> None:
    """Writes the fine cells (n, 2) of the points at the prior's place, turned by `yaw` more."""
    c, s = math.cos(prior[2] + yaw), math.sin(prior[2] + yaw)
    for i in range(len(xy)):
        cells[i, 0] = math.floor((c * xy[i, 0] - s * xy[i, 1] + prior[0] - corner[0]) / FINE)
        cells[i, 1] = math.floor((s * xy[i, 0] + c * xy[i, 1] + prior[1] - corner[1]) / FINE)


@njit(cache=True)
def _score(grid: Array, cells: Ints, du: int, dv: int) -> float:
    """Mean of the grid over the cells (n, 2) shifted by du, dv."""
    total = 0.0
    for i in range(len(cells)):
        u, v = cells[i, 0] + du, cells[i, 1] + dv
        if 0 <= u < grid.shape[0] and 0 <= v < grid.shape[1]:
            total += grid[u, v]
    return total / max(1, len(cells))


@njit(cache=True)
def _prior_cost(du: float, dv: float, yaw: float, information: Array) -> float:
    offset, cost = (du * FINE, dv * FINE, yaw), 0.0
    for a in range(3):
        for b in range(3):
            cost += offset[a] * information[a, b] * offset[b]
    return PRIOR_WEIGHT * cost
