"""From scan matching to a trajectory that is consistent wherever a place is visited again."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.config import LidarConfig
from recon.geometry import Array, between2, compose2, driven2, wrap_angle
from recon.graph.edges import Edges
from recon.lidar.cloud import make_cloud
from recon.lidar.clouds import Clouds
from recon.lidar.matching import ScanMatching
from recon.lidar.noise import with_noise
from recon.lidar.points import scan_points
from recon.loops.drift import chain_between
from recon.loops.pose_graph import solve
from recon.loops.search import LoopSearch
from recon.loops.submap import Submaps, choose_keyframes, make_submaps
from recon.loops.ties import tie
from recon.memory import give_back
from recon.sequence.sequence import Scans
from recon.sequence.trajectory import Trajectory

Ints = NDArray[np.int64]

BEND = (0.01, 0.001)
"""m a metre and rad a metre driven, beyond the scan matches' covariances: errors that neighbouring matches share."""
FREE_BEND = (0.02, 0.001)
"""The same without odometry; matches in doubt, which may have slid along a corridor, say so themselves."""
KERNEL = 2.0
"""Normalised residual at which ties lose their hold."""
CHAIN_KERNEL = 3.0
"""The same of scan matches: a few are grossly wrong, which several closures show."""
PASSES = 2
"""Times that scans are tied to the map and the poses solved."""


@dataclass(frozen=True)
class ClosedLoops:
    """trajectory: poses at every scan. closures: between submaps, first and second being scans. ties: scans to places
    of other visits. rejected: closures that looked right one by one and contradict the others."""

    trajectory: Trajectory
    closures: Edges
    ties: Edges
    rejected: int

    @staticmethod
    def none(trajectory: Trajectory, rejected: int = 0) -> ClosedLoops:
        """A drive on which no place is visited again."""
        return ClosedLoops(trajectory, Edges.none(), Edges.none(), rejected)

    @property
    def seen_again(self) -> Edges:
        """Scans tied to the map of other visits; where none could be, the closures between submaps."""
        return self.ties if len(self.ties) else self.closures


def close_loops(scans: Scans, matching: ScanMatching, config: LidarConfig, workers: int = 1) -> ClosedLoops:
    """Finds where the drive visits places again, and the poses that agree with that.

    Submaps are searched for in older ones (Hess et al. 2016) within windows that follow from the drift since; closures
    that do not agree with one another are dropped, as a set; with the poses that follow every keyframe is aligned with
    what other visits saw around it, and the pose graph of all scans is solved. workers: threads; they never change the
    result.
    """
    trajectory = matching.trajectory
    poses = trajectory.poses
    submaps = _submaps(scans, matching, with_noise(scans, config))
    if len(submaps) < 2:
        return ClosedLoops.none(trajectory)
    steps = between2(poses[:-1], poses[1:])
    search = LoopSearch(submaps, poses, _chain_of_submaps(submaps, steps, matching), config, workers)
    search.run()
    give_back()  # its grids are gone, the pose graph of all scans is as large
    if not len(search.closures):
        return ClosedLoops.none(trajectory, search.rejected)
    anchors = submaps.anchor_scans
    found = search.closures
    closures = Edges(anchors[found.first], anchors[found.second], found.relative, found.covariance)
    numbers = np.arange(len(poses))
    chain = Edges(numbers[:-1], numbers[1:], steps, matching.covariances)
    poses = solve(_moved_along(poses, anchors, search.nodes), chain, closures, KERNEL, CHAIN_KERNEL)
    ties = Edges.none()
    for _ in range(PASSES):
        ties = tie(submaps, poses, driven2(steps), config, workers)
        poses = solve(poses, chain, Edges.concatenate([closures, ties]), KERNEL, CHAIN_KERNEL)
    return ClosedLoops(Trajectory(trajectory.timestamps, poses), closures, ties, search.rejected)


def _submaps(scans: Scans, matching: ScanMatching, config: LidarConfig) -> Submaps:
    keyframes = choose_keyframes(matching.trajectory.poses, ~matching.failed)
    velocity = matching.velocities if scans.time_increment > 0 else [None] * len(scans)
    clouds = Clouds.pack(make_cloud(scan_points(scans, int(k), velocity[k]), config) for k in keyframes)
    return make_submaps(keyframes, clouds, matching.trajectory.poses)


def _chain_of_submaps(submaps: Submaps, steps: Array, matching: ScanMatching) -> Edges:
    """From every submap to the next, as uncertain as the scan matches between them."""
    relative, covariance = chain_between(steps, matching.covariances, submaps.anchor_scans)
    bend = BEND if matching.odometry is not None else FREE_BEND
    way = np.diff(submaps.driven)[:, None]
    covariance = covariance + ((np.array(bend)[[0, 0, 1]] * way) ** 2)[:, None] * np.eye(3)
    numbers = np.arange(len(submaps))
    return Edges(numbers[:-1], numbers[1:], relative, covariance)


def _moved_along(poses: Array, anchors: Ints, nodes: Array) -> Array:
    """All poses (N, 3) moved with the anchors between which they lie, which now are at `nodes` (M, 3)."""
    scan = np.arange(len(poses))
    before = np.clip(np.searchsorted(anchors, scan, side="right") - 1, 0, len(anchors) - 2)
    start, end = anchors[before], anchors[before + 1]
    part = np.clip((scan - start) / (end - start), 0.0, 1.0)[:, None]
    forward = compose2(nodes[before], between2(poses[start], poses))
    miss = compose2(nodes[before + 1], between2(poses[end], poses)) - forward
    miss[:, 2] = wrap_angle(miss[:, 2])
    out = forward + part * miss
    out[:, 2] = wrap_angle(out[:, 2])
    return out
