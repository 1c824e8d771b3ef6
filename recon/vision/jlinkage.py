"""J-linkage: lines that share vanishing points (Toldo and Fusiello 2008; Tardif 2009; paper, section 2.2)."""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array


def draw_pairs(weights: Array, count: int, rng: np.random.Generator) -> NDArray[np.int64]:
    """Random minimal sets (count, 2): two different lines each, drawn in proportion to `weights` (N,), N >= 2."""
    cumulative = np.cumsum(weights) / np.sum(weights)
    first = np.searchsorted(cumulative, rng.random(count), side="right")
    second = np.searchsorted(cumulative, rng.random(count), side="right")
    n = len(weights)
    first, second = np.minimum(first, n - 1), np.minimum(second, n - 1)
    second = np.where(second == first, (second + rng.integers(1, n, count)) % n, second)
    return np.stack([first, second], axis=1)


def j_linkage(preferences: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Cluster index (N,) of every line from the preference matrix (N, M): which line agrees with which hypothesis.

    The two clusters of least Jaccard distance are merged, the preference set of a cluster being the intersection of its
    members', until all clusters are disjoint (distance 1). Clusters are numbered by size, the largest is 0.
    """
    n, m = preferences.shape
    if n == 0:
        return np.zeros(0, np.int64)
    words = np.zeros((n, 8 * -(-max(m, 1) // 64)), np.uint8)
    packed = np.packbits(preferences, axis=1)
    words[:, : packed.shape[1]] = packed
    owner = _agglomerate(words.view(np.uint64))
    _, index, sizes = np.unique(owner, return_inverse=True, return_counts=True)
    rank = np.empty(len(sizes), np.int64)
    rank[np.argsort(-sizes, kind="stable")] = np.arange(len(sizes))
    return rank[index]


@numba.njit(cache=True)
def _popcount(word: np.uint64) -> np.int64:
    """Number of bits set."""
    w = word - ((word >> np.uint64(1)) & np.uint64(0x5555555555555555))
    w = (w & np.uint64(0x3333333333333333)) + ((w >> np.uint64(2)) & np.uint64(0x3333333333333333))
    w = (w + (w >> np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    return np.int64((w * np.uint64(0x0101010101010101)) >> np.uint64(56))


@numba.njit(cache=True)
def _jaccard(rows: NDArray[np.uint64], i: int, j: int) -> float:
    """1 - |a and b| / |a or b| of rows i and j, 1 for two empty sets."""
    both, either = 0, 0
    for k in range(rows.shape[1]):
        both += _popcount(rows[i, k] & rows[j, k])
        either += _popcount(rows[i, k] | rows[j, k])
    return 1.0 - both / either if both > 0 else 1.0


@numba.njit(cache=True)
def _nearest(rows: NDArray[np.uint64], alive: NDArray[np.bool_], i: int) -> tuple[int, float]:
    """The cluster after i nearest to cluster i, and its distance."""
    at, least = -1, 1.0
    for j in range(i + 1, len(rows)):
        if alive[j]:
            d = _jaccard(rows, i, j)
            if d < least:
                at, least = j, d
    return at, least


@numba.njit(cache=True)
def _agglomerate(rows: NDArray[np.uint64]) -> NDArray[np.int64]:
    """Merge rows (N, W) in place until disjoint; (N,) the first member of every row's cluster.

    Each cluster remembers its nearest later one: after a merge only those that named one of the two look again.
    """
    n = len(rows)
    owner, at = np.empty(n, np.int64), np.empty(n, np.int64)
    alive, least = np.ones(n, np.bool_), np.empty(n)
    for i in range(n):
        owner[i] = i
        at[i], least[i] = _nearest(rows, alive, i)
    while True:
        i = int(np.argmin(least))
        if least[i] >= 1.0:
            return owner
        j = at[i]
        for w in range(rows.shape[1]):
            rows[i, w] &= rows[j, w]
        alive[j], least[j] = False, 1.0
        for k in range(n):
            if owner[k] == j:
                owner[k] = i
            if not alive[k]:
                continue
            if k == i or at[k] == i or at[k] == j:
                at[k], least[k] = _nearest(rows, alive, k)
            elif k < i:  # the new cluster may be nearer than the old one was
                d = _jaccard(rows, k, i)
                if d < least[k] or (d == least[k] and i < at[k]):
                    at[k], least[k] = i, d
