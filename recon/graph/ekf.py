"""The paper's filter: SLAM with wall lines and an extended Kalman filter (section 2.4), as a baseline to the graph.

Scan by scan: the motion predicts the pose, segments find their walls by Mahalanobis distance, the filter fuses them,
and what fits no wall starts a new one. Poses are those of the moment: nothing that is learnt later mends them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array, wrap_angle
from recon.graph.association import GATE, MAX_TURN, REACH, flatness
from recon.graph.estimate import MapEstimate, WallLine
from recon.graph.filter_state import FilterState, Pairing
from recon.graph.filter_walls import FilterWalls
from recon.graph.line import FLATNESS, Lines
from recon.graph.merge import merge_labels
from recon.graph.motion import Motion, remaining_information
from recon.graph.nearest import NONE
from recon.graph.observation import WallObservations
from recon.graph.odometry import OdometryModel, fit_odometry
from recon.graph.optimise import EXPECTED
from recon.graph.result import unshadowed
from recon.sequence.trajectory import Trajectory

Ints = NDArray[np.int64]

MAX_OFFSET = 3.0
"""m: no pose is so uncertain that a segment further off a wall's line belongs to it."""
TIDY_EVERY = 10
"""Scans from one search for walls that are one, and for those to be given up, to the next."""
PATIENCE = 50
"""Scans that a wall which was seen too rarely stays for."""
MAX_WALLS = 1000
"""Walls in the state; of more, those not seen for longest are given up as they are, since the cost of a scan grows
with the square of their number."""
LEAST_REDUNDANCY = 20
"""Fewer residuals than this say nothing about how good the segments are."""


def solve_filter(
    trajectory: Trajectory,
    motion: Motion,
    observations: WallObservations,
    odometry: Trajectory | None = None,
) -> MapEstimate:
    """Poses at every scan and wall lines from an extended Kalman filter; arguments and result as `solve_graph`.

    The poses and their standard deviations are the filter's at each scan, the walls' are those after the last one; the
    odometry's scale is taken as known. A first pass finds out how good the segments are, as the graph's first solution
    does; the second one counts.
    """
    model = fit_odometry(odometry, trajectory, motion) if odometry is not None and len(motion) else None
    motion = motion.held(trajectory.timestamps)
    first = _Filter(trajectory, motion, observations, model, (1.0, 1.0))
    first.run()
    return _Filter(trajectory, motion, observations, model, first.variance_factors()).run()


@dataclass(frozen=True)
class _Measured:
    """What a scan match, and odometry where there is any, say of one motion: means (3,), information (3, 3)."""

    match: Array
    match_information: Array
    odometry: Array
    odometry_information: Array

    @staticmethod
    def between(scan: int, motion: Motion, odometry: OdometryModel | None) -> _Measured:
        """From scan - 1 to `scan`."""
        k = scan - 1
        match, information = motion.relative[k], np.linalg.inv(motion.covariance[k])
        if odometry is None or not odometry.inside[k]:
            return _Measured(match, information, match, np.zeros((3, 3)))
        other = np.linalg.inv(odometry.motion.covariance[k])
        return _Measured(match, information, odometry.motion.relative[k], other)

    def fused(self, match_information: Array) -> tuple[Array, Array]:
        """Mean (3,) and covariance (3, 3) of both, the match having this information."""
        covariance = np.asarray(np.linalg.inv(match_information + self.odometry_information), dtype=np.float64)
        off = self.odometry - self.match
        off[2] = wrap_angle(off[2])
        return self.match + covariance @ (self.odometry_information @ off), covariance


class _Filter:
    """One pass over the scans."""

    def __init__(
        self,
        trajectory: Trajectory,
        motion: Motion,
        observations: WallObservations,
        odometry: OdometryModel | None,
        variance: tuple[float, float],
    ) -> None:
        self._timestamps, self._motion, self._odometry = trajectory.timestamps, motion, odometry
        segments = Lines.of_observations(observations, np.zeros((len(trajectory), 3)))
        self._image = observations.image >= 0
        factor = np.where(self._image, variance[1], variance[0])[:, None, None]
        self._segments = replace(segments, covariance=factor * (segments.covariance + flatness(segments)))
        order = np.argsort(observations.pose, kind="stable")
        cuts = np.searchsorted(observations.pose[order], np.arange(1, len(trajectory)))
        self._rows = np.split(order, cuts)
        self._state, self._walls = FilterState(trajectory.poses[0]), FilterWalls(observations)
        self._poses, self._sigmas = np.zeros((len(trajectory), 3)), np.zeros((len(trajectory), 3))
        self._given_up: list[WallLine] = []
        self._residuals = np.zeros((len(observations), 2))  # squared, and what it should be

    def run(self) -> MapEstimate:
        for scan, rows in enumerate(self._rows):
            self._step(scan, rows)
            self._poses[scan] = self._state.pose
            self._sigmas[scan] = np.sqrt(np.maximum(np.diag(self._state.covariance)[:3], 0.0))
            if scan % TIDY_EVERY == TIDY_EVERY - 1:
                self._merge()
                self._give_up(scan)
        self._merge()
        walls = self._given_up + self._walls.lines(self._state, np.ones(len(self._state), np.bool_))
        return MapEstimate(
            Trajectory(np.asarray(self._timestamps, dtype=np.float64), self._poses),
            self._sigmas,
            unshadowed(walls),
            None if self._odometry is None else self._odometry.scale,
            {kind: float(np.sqrt(np.mean(r[:, 0] / 2))) for kind, r in self._fused().items() if len(r)},
        )

    def variance_factors(self) -> tuple[float, float]:
        """How much larger squared errors of LiDAR and of image segments are than expected, robust by clipping."""
        factors = []
        for residuals in self._fused().values():
            factor, expected = 1.0, float(residuals[:, 1].sum())
            for _ in range(10 if expected > LEAST_REDUNDANCY else 0):  # the clip moves with the factor
                factor *= float(np.minimum(residuals[:, 0] / factor, 9.0).sum()) * 2 / EXPECTED / expected
            factors.append(float(np.clip(factor, 0.02, 100.0)))
        return factors[0], factors[1]

    def _fused(self) -> dict[str, Array]:
        """Squared residuals and what they should be (n, 2) of the segments that were fused, by kind."""
        fused = self._residuals[:, 1] > 0
        return {"lidar": self._residuals[fused & ~self._image], "image": self._residuals[fused & self._image]}

    def _step(self, scan: int, rows: Ints) -> None:
        """Predict, associate, fuse, start new walls."""
        segments, state = self._segments[rows], self._state
        labels, offset = np.full(len(rows), NONE, dtype=np.int64), np.zeros(3)
        if scan > 0:
            labels, offset = self._predict(scan, segments)
        old = np.flatnonzero(labels != NONE)
        if len(old) or offset.any():
            found = state.update(Pairing.of_segments(segments[old], labels[old]), offset)
            self._residuals[rows[old]] = np.stack(found, axis=1)
        in_map = state.in_map(segments)
        for k in old:
            self._extend(int(labels[k]), in_map[k : k + 1], int(rows[k]), scan)
        new = np.flatnonzero(labels == NONE)
        state.add(segments[new])
        self._walls.add(rows[new], scan)

    def _predict(self, scan: int, segments: Lines) -> tuple[Ints, Array]:
        """Walls (K,) of the segments, and the prediction (3,) less the pose at which the filter is to linearise.

        Segments and match come from the same points: all that the match says finds the walls, but only what it knows
        beyond their segments moves the pose.
        """
        state, measured = self._state, _Measured.between(scan, self._motion, self._odometry)
        mean, covariance = measured.fused(measured.match_information)
        turn = state.predict(mean, covariance)
        labels = self._associate(segments)
        old = np.flatnonzero(labels != NONE)
        of_walls = state.pose_information(Pairing.of_segments(segments[old], labels[old]))
        beyond = remaining_information(measured.match_information, turn.T @ of_walls @ turn)
        prediction, wide = measured.fused(beyond)
        state.widen(turn @ (wide - covariance) @ turn.T)
        return labels, turn @ (prediction - mean)

    def _associate(self, segments: Lines) -> Ints:
        """(K,) the wall nearest to each segment by Mahalanobis distance, NONE beyond the gate."""
        if not len(segments) or not len(self._state):
            return np.full(len(segments), NONE, dtype=np.int64)
        distance = self._state.distances(segments, REACH, MAX_TURN, MAX_OFFSET)
        best = np.argmin(distance, axis=1)
        return np.where(distance[np.arange(len(best)), best] <= GATE, best, NONE)

    def _extend(self, wall: int, line: Lines, row: int, scan: int) -> None:
        """The wall reaches as far as `line`, a segment that saw it."""
        state = self._state
        x, y, yaw = state.frames[wall]
        along = float(np.cos(yaw) * (line.middle[0, 0] - x) + np.sin(yaw) * (line.middle[0, 1] - y))
        self._walls.see(row, wall, along, scan)
        half = float(line.half[0])
        self._walls.moved(wall, state.stretch(wall, along - half, along + half))

    def _merge(self) -> None:
        """Walls that are one become one, of both walls' certainty."""
        state = self._state
        joint = state.covariance[3:, 3:].reshape(len(state), 2, len(state), 2)
        group = merge_labels(state.walls, lambda first, second: joint[first, :, second])
        kept = np.ones(len(state), np.bool_)
        for label in np.flatnonzero(np.bincount(group) > 1):
            members = np.flatnonzero(group == label)
            first = int(members[np.argmax(state.half[members])])
            for other in members[members != first].tolist():
                along, half = state.unite(first, other, FLATNESS), float(state.half[other])
                self._walls.join(first, other, along)
                self._walls.moved(first, state.stretch(first, along - half, along + half))
                kept[other] = False
        state.keep(kept)
        self._walls.keep(kept)

    def _give_up(self, scan: int) -> None:
        """Walls that were seen too rarely go, and, where there are too many, those that were not seen for longest."""
        state, walls = self._state, self._walls
        kept = walls.confirmed | (walls.last > scan - PATIENCE)
        if (excess := int(kept.sum()) - MAX_WALLS) > 0:
            old = np.zeros(len(state), np.bool_)
            old[np.argsort(np.where(kept, walls.last, scan + 1), kind="stable")[:excess]] = True
            self._given_up += walls.lines(state, old)
            kept &= ~old
        state.keep(kept)
        walls.keep(kept)
