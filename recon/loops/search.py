"""Rounds of looking for closures: near ones first, whose solution makes the windows of the next ones smaller."""

from __future__ import annotations

import numpy as np

from recon.config import LidarConfig
from recon.geometry import Array, between2
from recon.loops.agreement import agreeing
from recon.loops.closure import Closer, Closure
from recon.loops.drift import Drift
from recon.loops.pose_graph import Edges, solve_consistent
from recon.loops.submap import Submaps

REACHES = (2.0, 2.0, 4.0, 4.0, 8.0, 8.0, 15.0, 15.0, 15.0)
"""m, the largest window of each round."""
SIGMAS = 3.0
"""Standard deviations that a window covers."""
LEAST_WINDOW = (0.5, 0.05)
"""m, rad."""
MOST_TURN = np.pi
NEAR = 6.0
"""m between the middles of two submaps that see the same."""
GAP = 15.0
"""m driven between two visits."""
CANDIDATES = 6
"""Older submaps that a submap is searched for in, a round."""
APART = 2
"""Submaps between two candidates."""
MOVED = 1.0
"""m that the prediction must have moved for a pair to be tried again."""


class LoopSearch:
    """Poses (M, 3) of the submaps and the closures found so far."""

    def __init__(self, submaps: Submaps, poses: Array, chain: Edges, config: LidarConfig) -> None:
        self._submaps, self._chain = submaps, chain
        self._start = poses[submaps.anchor_scans]
        self._closer = Closer(submaps, poses, config)
        self._tried: dict[tuple[int, int], Array] = {}
        self._found: list[Closure] = []
        self.nodes = self._start.copy()
        self.closures = Edges.none()

    @property
    def rejected(self) -> int:
        """Closures that looked right one by one and were not."""
        return len(self._found) - len(self.closures)

    def run(self) -> None:
        """All rounds."""
        for reach in REACHES:
            new = self._round(reach)
            if new:
                self._found.extend(new)
                self._settle()

    def _round(self, reach: float) -> list[Closure]:
        drift = Drift(len(self.nodes), Edges.concatenate([self._chain, self.closures]))
        new = []
        for second in range(len(self.nodes)):
            spread = drift.spread(second, self.nodes, (reach / SIGMAS) ** 2 * 10)
            for first, guess in self._candidates(second, spread, reach):
                window = np.clip(SIGMAS * np.sqrt(spread[first]), LEAST_WINDOW, (reach, MOST_TURN))
                found = self._closer.find(second, first, guess, window)
                if found is not None:
                    new.append(found)
        return new

    def _candidates(self, second: int, spread: Array, reach: float) -> list[tuple[int, Array]]:
        """Older submaps that may show the same place, nearest first, with the prediction (3,) of where it is there."""
        driven = self._submaps.driven
        window = SIGMAS * np.sqrt(spread[:second, 0])
        old = np.flatnonzero((driven[second] - driven[:second] > GAP) & (window <= reach))
        guess = between2(self.nodes[old], self.nodes[second])
        distance = np.hypot(guess[:, 0], guess[:, 1])
        chosen: list[int] = []
        out = []
        for k in np.argsort(distance, kind="stable"):
            first = int(old[k])
            if distance[k] - window[first] >= NEAR or any(abs(first - c) <= APART for c in chosen):
                continue
            chosen.append(first)
            before = self._tried.get((first, second))
            if before is None or np.hypot(*(before[:2] - guess[k, :2])) >= MOVED:
                self._tried[first, second] = guess[k]
                out.append((first, guess[k]))
            if len(chosen) == CANDIDATES:
                break
        return out

    def _settle(self) -> None:
        """The closures that belong together, and the poses that follow."""
        everything = Edges(
            np.array([c.first for c in self._found]),
            np.array([c.second for c in self._found]),
            np.array([c.relative for c in self._found]),
            np.array([c.covariance for c in self._found]),
        )
        likely = everything[agreeing(everything, self._start, self._submaps.driven)]
        self.nodes, kept = solve_consistent(self.nodes, self._chain, likely)
        self.closures = likely[kept]
