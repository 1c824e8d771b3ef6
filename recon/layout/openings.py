"""Doors and passages, read off the returns and rays along each wall."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array
from recon.layout.evidence import FreeSpace
from recon.layout.recess import DEPTH, WIDTH
from recon.layout.returns import Returns
from recon.layout.swing import Swings
from recon.model import Opening, OpeningType, Wall

BIN = 0.05
"""m along the wall."""
MIN_RETURNS = 3
"""Returns in a bin before it says anything."""
BRIDGED = 3
"""Bins without a say within an opening."""
LONGEST_LEAF = 1.4
LONGEST_PASSAGE = 3.0
"""m; a wider gap is no opening in a wall."""
BESIDE = 0.10
"""m before and behind a wall where free space says that rays went through it."""
JAMB = 0.2
"""m beyond a gap's bins, where the wall beside it ends ..."""
ALL_BUT = 0.98
"""... as this share of its returns says: the others are strays."""
TOP = 2.0
"""m, of openings whose head nothing has measured."""

Stretch = tuple[OpeningType, float, float]


def find_openings(walls: list[Wall], returns: Returns, space: FreeSpace, path: Array) -> list[Opening]:
    """Recessed leaves (returns a little behind a wall) and gaps (rays through it) as openings, in order of walls.

    Inferred walls have no leaves, but rays through them are openings in them too. A gap is a door if its open leaf
    stands at one of its ends, in either face of the wall, else a passage: a door whose leaf was taken off, or nobody
    saw, is told from a passage by nothing. path: (N, 2) m, where the platform drove: doors there are open.
    """
    out: list[Opening] = []
    swings = Swings(walls, space)
    for wall in walls:
        if wall.length < WIDTH[0]:
            continue
        gaps = _gaps(wall, returns, space, swings)
        leaves = [] if wall.source == "inferred" else _leaves(wall, returns)
        leaves = [leaf for leaf in leaves if not any(_overlap(leaf, gap) for gap in gaps)]
        driven = _crossings(wall, path)
        for kind, low, high in leaves + gaps:
            start, end = wall.start + low * wall.direction, wall.start + high * wall.direction
            is_open = (kind, low, high) in gaps or bool(np.any((driven > low) & (driven < high)))
            out.append(Opening(len(out), kind, wall.id, start, end, 0.0, TOP, is_open and kind == "door"))
    return out


def _overlap(one: Stretch, other: Stretch) -> bool:
    """Whether two stretches share half of the shorter one."""
    shared = min(one[2], other[2]) - max(one[1], other[1])
    return shared > 0.5 * min(one[2] - one[1], other[2] - other[1])


def _crossings(wall: Wall, path: Array) -> Array:
    """Where along the wall (m) the platform drove through it."""
    across = (path - wall.start) @ wall.normal
    along = (path - wall.start) @ wall.direction
    k = np.flatnonzero(across[:-1] * across[1:] < 0)
    part = across[k] / (across[k] - across[k + 1])
    return np.asarray(along[k] + part * (along[k + 1] - along[k]))


def _leaves(wall: Wall, returns: Returns) -> list[Stretch]:
    """Stretches along the wall where rays from before it end behind it at a leaf's depth."""
    along, across, starts = returns.beside(wall.start, wall.end, DEPTH[1])
    before = (starts - wall.start) @ wall.normal > 0
    along, across = along[before], across[before]
    count = max(1, int(np.ceil(wall.length / BIN)))
    bins = np.minimum((along / BIN).astype(np.int64), count - 1)
    behind = across < -DEPTH[0]
    votes = np.stack([np.bincount(bins[behind == b], minlength=count) for b in (False, True)])
    recessed = (votes[1] >= MIN_RETURNS) & (votes[1] > votes[0])
    known = votes.sum(axis=0) >= MIN_RETURNS
    out: list[Stretch] = []
    for a, b in _runs(recessed, known):
        here = behind & (along >= (a - 1) * BIN) & (along <= (b + 1) * BIN)
        low, high = np.quantile(along[here], [0.01, 0.99])
        if WIDTH[0] <= high - low <= WIDTH[1] and _has_jambs(a, b, recessed, known):
            out.append(("door", float(low), float(high)))
    return out


def _gaps(wall: Wall, returns: Returns, space: FreeSpace, swings: Swings) -> list[Stretch]:
    """Stretches along the wall that rays went through."""
    count = max(1, int(np.ceil(wall.length / BIN)))
    middle = (np.arange(count) + 0.5) * BIN
    foot = wall.start + middle[:, None] * wall.direction
    across_wall = np.arange(BESIDE, -1.6 * BESIDE, -BIN)
    through = np.all([space.is_free(foot + y * wall.normal) for y in across_wall], axis=0)
    along, across, _ = returns.beside(wall.start, wall.end, BESIDE)
    bins = np.minimum((along[np.abs(across) < DEPTH[0]] / BIN).astype(np.int64), count - 1)
    solid = np.bincount(bins, minlength=count) >= MIN_RETURNS
    open_ = through & ~solid
    out: list[Stretch] = []
    for a, b in _runs(open_, open_ | solid):
        low, high = a * BIN, min(b * BIN, wall.length)
        known = open_ | solid
        if WIDTH[0] <= high - low <= LONGEST_PASSAGE and (wall.source == "inferred" or _has_jambs(a, b, open_, known)):
            low, high = _to_jambs(low, high, along[np.abs(across) < DEPTH[0]])
            is_door = high - low <= LONGEST_LEAF and swings.has_leaf(wall, low, high)
            out.append(("door" if is_door else "passage", low, high))
    return out


def _to_jambs(low: float, high: float, along: Array) -> tuple[float, float]:
    """The gap from `low` to `high` m along a wall, carried on to where returns (n,) on the wall end at its jambs."""
    before = along[(along > low - JAMB) & (along < low + BIN)]
    after = along[(along > high - BIN) & (along < high + JAMB)]
    if len(before) >= MIN_RETURNS:
        low = float(np.quantile(before, ALL_BUT))
    if len(after) >= MIN_RETURNS:
        high = float(np.quantile(after, 1 - ALL_BUT))
    return low, high


def _runs(flag: NDArray[np.bool_], known: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Runs [a, b) of set bins, joined over up to `BRIDGED` bins that say nothing."""
    change = np.flatnonzero(np.diff(np.concatenate([[0], flag.astype(np.int8), [0]])))
    runs: list[tuple[int, int]] = []
    for a, b in zip(change[::2], change[1::2], strict=True):
        if runs and a - runs[-1][1] <= BRIDGED and not known[runs[-1][1] : a].any():
            runs[-1] = (runs[-1][0], int(b))
        else:
            runs.append((int(a), int(b)))
    return runs


def _has_jambs(a: int, b: int, flag: NDArray[np.bool_], known: NDArray[np.bool_]) -> bool:
    """Whether wall was seen within four bins of both ends of a run, or of one and nothing was seen at the other."""
    solid = known & ~flag
    left, right = bool(solid[max(a - 4, 0) : a].any()), bool(solid[b : b + 4].any())
    return (left or not known[max(a - 4, 0) : a].any()) and (right or not known[b : b + 4].any()) and (left or right)
