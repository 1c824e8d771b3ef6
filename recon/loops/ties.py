"""Scans tied to what was seen around them at other times, once the poses are nearly right: hundreds of closures."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from recon.config import LidarConfig
from recon.geometry import Array, between2
from recon.graph.edges import Edges
from recon.lidar.icp import align_many
from recon.lidar.localmap import build_map
from recon.loops.submap import Submaps
from recon.loops.workers import threaded

Ints = NDArray[np.int64]

NEAR = 8.0
"""m from a keyframe to the middle of a submap that it is aligned with."""
VISITS = 4
"""Submaps that a keyframe is aligned with."""
NEAREST = 64
"""Submaps that are looked at for these, however often a place was visited."""
BLOCK = 4096
"""Keyframes whose neighbours are looked up at once."""
APART = 2
"""Submaps between two of them."""
GAP = 15.0
"""m driven between two visits: what lies nearer is in the scan match already."""
WIDTH = 0.15
"""m, first width of the alignment's kernel."""
NOISE, NOISE_SIGMAS = 0.03, 3.0
"""m, its last width, or so many times the range noise."""
TRUST = np.diag([25.0, 25.0, 400.0])
"""Information of the present pose (0.2 m, 3 degrees), in the alignment only."""
VAGUE = np.diag([1e-2, 1e-2, 1e-2])
LEAST_OVERLAP, LEAST_MATCHED = 0.5, 15
FLOOR = (0.01, 0.002)
"""m, rad: how far submaps bend."""


def tie(submaps: Submaps, poses: Array, driven: Array, config: LidarConfig, workers: int = 1) -> Edges:
    """Keyframes aligned with the submaps of other visits; poses (N, 3) and driven (N,) m of all scans."""
    partners = _partners(submaps, poses, driven)
    found = threaded(lambda number: _tied(submaps, number, partners[number], poses, config), list(partners), workers)
    return Edges.concatenate([Edges.none(), *found])


def _tied(submaps: Submaps, number: int, keyframes: Ints, poses: Array, config: LidarConfig) -> Edges:
    """Keyframes (m,) aligned with one submap."""
    noise = max(NOISE, NOISE_SIGMAS * config.range_sigma)
    local = build_map(submaps.cloud(number, poses, around=1), np.zeros(2), config)
    anchor, scans = submaps.anchor_scans[number], submaps.scans[keyframes]
    guesses = between2(poses[anchor], poses[scans])
    found = align_many(submaps.clouds, keyframes, local, guesses, TRUST, WIDTH, noise)
    good = np.array([f.overlap >= LEAST_OVERLAP and f.matched >= LEAST_MATCHED for f in found])
    if not good.any():
        return Edges.none()
    relative = np.array([f.pose for f in found])[good]
    information = np.array([f.information for f in found])[good]
    covariance = np.linalg.inv(information + VAGUE) + np.diag(np.array(FLOOR)[[0, 0, 1]] ** 2)
    return Edges(np.full(len(relative), anchor), scans[good], relative, covariance)


def _partners(submaps: Submaps, poses: Array, driven: Array) -> dict[int, Ints]:
    """Keyframes to align with every submap that has any, in the order of the submaps."""
    from scipy.spatial import cKDTree

    anchors = submaps.anchor_scans
    tree = cKDTree(poses[anchors, :2])
    pairs = []
    for low in range(0, len(submaps.scans), BLOCK):
        scans = submaps.scans[low : low + BLOCK]
        _, near = tree.query(poses[scans, :2], k=min(NEAREST, len(anchors)), distance_upper_bound=NEAR)
        near = near.reshape(len(scans), -1)
        pairs.append(_choose(near, driven[anchors], driven[scans]) + np.array([0, low]))
    numbers, keyframes = np.concatenate(pairs).T
    if not len(numbers):
        return {}
    order = np.argsort(numbers, kind="stable")
    cuts = np.flatnonzero(np.diff(numbers[order], prepend=-1))
    groups = np.split(keyframes[order], cuts[1:])
    return {int(numbers[order[cut]]): group for cut, group in zip(cuts, groups, strict=True)}


@njit(cache=True)
def _choose(near: Ints, at_anchors: Array, at_scans: Array) -> Ints:
    """(P, 2) submap and scan: of the submaps `near` (S, k) each scan, nearest first, up to `VISITS` of other visits."""
    out, count = np.empty((VISITS * len(near), 2), np.int64), 0
    for s in range(len(near)):
        first = count
        for number in near[s]:
            if count == first + VISITS or number == len(at_anchors):
                break
            if abs(at_anchors[number] - at_scans[s]) <= GAP:
                continue
            apart = True
            for c in range(first, count):
                apart = apart and abs(number - out[c, 0]) > APART
            if apart:
                out[count, 0], out[count, 1] = number, s
                count += 1
    return out[:count]
