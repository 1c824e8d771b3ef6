"""Closures: a submap found again in an older one, verified, with a covariance that knows what the match cannot tell."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass

import numpy as np

from recon.config import LidarConfig
from recon.geometry import Array, between2, inverse2, wrap_angle
from recon.lidar.cloud import Cloud
from recon.lidar.icp import Alignment, align
from recon.lidar.localmap import LocalMap
from recon.loops.branch_and_bound import search
from recon.loops.free_space import contradicted
from recon.loops.submap import Submaps
from recon.loops.target import Target, make_query, make_target

LEAST_SCORE = 0.3
"""Mean likelihood below which a place is not looked at further."""
LEAST_OVERLAP = 0.25
"""Share of the searched cloud that must lie on the older submap."""
LEAST_BACK = 0.2
"""Share of the older submap's own cloud that must lie on the newer one (it may see further)."""
LEAST_AGREEMENT = 0.85
"""Of what either saw where the other had seen as well, the share that is there for both: not where one saw through."""
MOST_MISS = (0.3, 0.05)
"""m, rad: how far the way back may lead beside the start."""
TIE = 0.85
"""Part of the best score, or overlap, from which a second place is as likely."""
WIDTH = 0.2
"""m, first width of the alignment's kernel."""
NOISE = 0.05
"""m, last width: submaps are not rigid to the millimetre."""
FLOOR = (0.02, 0.004)
"""m, rad: how far submaps bend."""
VAGUE = np.diag([1e-2, 1e-2, 1e-2])
"""Information of the guess: a metre and more, so that it only decides what nothing else does."""
THIN = 0.2
"""m: walls may be as thin, and what the search lays on one side of them may belong on the other."""
CACHED = 32
"""Targets that are kept."""


@dataclass(frozen=True)
class Closure:
    """Submap `second` seen from submap `first`: relative (3,), covariance (3, 3) of [x, y, yaw] in the first's frame.

    overlap: share of the second's cloud that lies on the first.
    """

    first: int
    second: int
    relative: Array
    covariance: Array
    overlap: float


class Closer:
    """Looks for submaps in others; keeps the grids it made."""

    def __init__(self, submaps: Submaps, poses: Array, config: LidarConfig) -> None:
        self._submaps, self._poses, self._config = submaps, poses, config
        self._targets: OrderedDict[int, Target] = OrderedDict()
        self._queries: OrderedDict[int, Cloud] = OrderedDict()

    def find(self, second: int, first: int, guess: Array, window: Array) -> Closure | None:
        """Submap `second` within `window` (m, rad) of the guess (3,) in the frame of submap `first`, None if it is not
        there."""
        target, query = self._target(first), self._query(second)
        found = search(query.xy, target.pyramid, guess, window, LEAST_SCORE)
        if found is None:
            return None
        aligned, *others = _aligned(query, target.local, found.pose)
        if aligned.overlap < LEAST_OVERLAP:
            return None
        back = inverse2(aligned.pose)
        reverse = align(self._query(first), self._target(second).local, back, back, VAGUE, WIDTH, NOISE)
        if reverse.overlap < LEAST_BACK or not self._agree(second, first, aligned, reverse):
            return None
        # the way back must lead to the same place
        miss = between2(aligned.pose, inverse2(reverse.pose))
        if np.hypot(miss[0], miss[1]) > MOST_MISS[0] or abs(miss[2]) > MOST_MISS[1]:
            return None
        covariance = np.asarray(np.linalg.inv(aligned.information + VAGUE) + np.diag(np.array(FLOOR)[[0, 0, 1]] ** 2))
        other = search(query.xy, target.pyramid, guess, window, TIE * found.score, found)
        if other is not None:
            covariance += _between(found.pose, other.pose)
        for beside in others:
            if beside.overlap >= TIE * aligned.overlap:
                covariance += _between(aligned.pose, beside.pose)
        covariance += np.outer(miss, miss)
        return Closure(first, second, aligned.pose, covariance, aligned.overlap)

    def _agree(self, second: int, first: int, aligned: Alignment, reverse: Alignment) -> bool:
        """Whether neither submap stands where the other saw nothing, but for people and what was moved."""
        there, here = self._target(first), self._target(second)
        against = contradicted(self._query(second).xy, aligned.pose, there.local, there.free)
        against += contradicted(self._query(first).xy, reverse.pose, here.local, here.free)
        both = aligned.overlap + reverse.overlap
        return both >= LEAST_AGREEMENT * (both + against)

    def _target(self, number: int) -> Target:
        if number not in self._targets:
            self._targets[number] = make_target(self._submaps, number, self._poses, self._config)
        self._targets.move_to_end(number)
        while len(self._targets) > CACHED:
            self._targets.popitem(last=False)
        return self._targets[number]

    def _query(self, number: int) -> Cloud:
        if number not in self._queries:
            self._queries[number] = make_query(self._submaps, number, self._poses, self._config)
        self._queries.move_to_end(number)
        while len(self._queries) > CACHED:
            self._queries.popitem(last=False)
        return self._queries[number]


def _aligned(query: Cloud, local: LocalMap, guess: Array) -> list[Alignment]:
    """The alignment from the guess (3,) and those from either side of it, where it is known least; most overlap first.

    Grids know no sides: the two faces of a wall between rooms look like one. And what lies along a corridor's walls
    may fit as well a step further.
    """
    found = align(query, local, guess, guess, VAGUE, WIDTH, NOISE)
    if found.overlap < LEAST_OVERLAP:
        return [found]
    axis = np.append(np.linalg.eigh(found.information[:2, :2])[1][:, 0], 0.0)
    starts = found.pose + THIN * axis, found.pose - THIN * axis
    others = [align(query, local, start, start, VAGUE, WIDTH, NOISE) for start in starts]
    return sorted([found, *others], key=lambda a: -a.overlap)


def _between(best: Array, other: Array) -> Array:
    """Covariance of not knowing which of two places it is."""
    apart = other - best
    apart[2] = wrap_angle(apart[2])
    return np.outer(apart, apart)
