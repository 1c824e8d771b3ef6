"""Rounds of looking for closures: near ones first, whose solution makes the windows of the next ones smaller."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.config import LidarConfig
from recon.geometry import Array, between2
from recon.graph.edges import Edges
from recon.loops.agreement import agreeing
from recon.loops.closure import Closer, Closure
from recon.loops.drift import Drift
from recon.loops.pose_graph import solve_consistent
from recon.loops.submap import Submaps
from recon.loops.workers import threaded

Ints = NDArray[np.int64]

REACHES = ((2.0, 2), (4.0, 2), (8.0, 2), (15.0, 3))
"""m, the largest window, and rounds with it as long as they find something."""
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
NEAREST = 64
"""Older submaps nearby that are looked at for these, however often a place was visited."""
APART = 2
"""Submaps between two candidates."""
MOVED = 1.0
"""m that the prediction must have moved for a pair to be tried again."""


@dataclass(frozen=True)
class Candidate:
    """Submap `second` may show the same as the older one `first`: guess (3,) of where it lies there, window (2,) m, rad
    on either side of it."""

    first: int
    second: int
    guess: Array
    window: Array


class LoopSearch:
    """Poses (M, 3) of the submaps and the closures found so far."""

    def __init__(self, submaps: Submaps, poses: Array, chain: Edges, config: LidarConfig, workers: int = 1) -> None:
        self._submaps, self._chain, self._workers = submaps, chain, workers
        self._poses, self._config = poses, config
        self._start = poses[submaps.anchor_scans]
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
        closers = [Closer(self._submaps, self._poses, self._config) for _ in range(self._workers)]
        for reach, rounds in REACHES:
            for _ in range(rounds):
                new = _search(self.candidates(reach), closers)
                if not new:
                    break
                self._found.extend(new)
                self._settle()

    def candidates(self, reach: float) -> list[Candidate]:
        """Pairs that were not yet tried where they are now thought to be, with windows of at most `reach` m."""
        from scipy.spatial import cKDTree

        drift = Drift(len(self.nodes), Edges.concatenate([self._chain, self.closures]))
        tree = cKDTree(self.nodes[:, :2])
        out = []
        for second in range(len(self.nodes)):
            near = np.array(tree.query_ball_point(self.nodes[second, :2], NEAR + reach), dtype=np.int64)
            old = near[self._submaps.driven[second] - self._submaps.driven[near] > GAP]
            distance = np.hypot(*(self.nodes[old, :2] - self.nodes[second, :2]).T)
            order = np.lexsort((old, distance))[:NEAREST]
            spread = drift.spread(second, self.nodes, (reach / SIGMAS) ** 2 * 10, old[order])
            out += self._chosen(second, old[order], distance[order], spread, reach)
        return out

    def _chosen(self, second: int, old: Ints, distance: Array, spread: Array, reach: float) -> list[Candidate]:
        """Of the older submaps (W,), nearest first, those that may show the same place."""
        window = SIGMAS * np.sqrt(spread)
        chosen: list[int] = []
        out = []
        for k in np.flatnonzero((window[:, 0] <= reach) & (distance - window[:, 0] < NEAR)):
            first = int(old[k])
            if any(abs(first - c) <= APART for c in chosen):
                continue
            chosen.append(first)
            guess = between2(self.nodes[first], self.nodes[second])
            before = self._tried.get((first, second))
            if before is None or np.hypot(*(before[:2] - guess[:2])) >= MOVED:
                self._tried[first, second] = guess
                out.append(Candidate(first, second, guess, np.clip(window[k], LEAST_WINDOW, (reach, MOST_TURN))))
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


def _search(candidates: list[Candidate], closers: list[Closer]) -> list[Closure]:
    """The candidates that were found; every closer looks for a run of them, with grids of its own."""
    runs = np.array_split(np.arange(len(candidates)), len(closers))

    def look(number: int) -> list[Closure | None]:
        mine = [candidates[i] for i in runs[number]]
        return [closers[number].find(c.second, c.first, c.guess, c.window) for c in mine]

    found = threaded(look, list(range(len(runs))), len(runs))
    return [closure for run in found for closure in run if closure is not None]
