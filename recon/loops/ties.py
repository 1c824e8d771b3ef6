"""Scans tied to what was seen around them at other times, once the poses are nearly right: hundreds of closures."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recon.config import LidarConfig
from recon.geometry import Array, between2
from recon.lidar.icp import align
from recon.lidar.localmap import build_map
from recon.loops.pose_graph import Edges
from recon.loops.submap import Submaps

Ints = NDArray[np.int64]

NEAR = 8.0
"""m from a keyframe to the middle of a submap that it is aligned with."""
VISITS = 4
"""Submaps that a keyframe is aligned with."""
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


def tie(submaps: Submaps, poses: Array, driven: Array, config: LidarConfig) -> Edges:
    """Keyframes aligned with the submaps of other visits; poses (N, 3) and driven (N,) m of all scans."""
    noise = max(NOISE, NOISE_SIGMAS * config.range_sigma)
    parts = []
    for number, keyframes in _partners(submaps, poses, driven).items():
        local = build_map(submaps.cloud(number, poses, around=1), np.zeros(2), config)
        anchor = submaps.anchor_scans[number]
        for k in keyframes:
            scan = submaps.scans[k]
            guess = between2(poses[anchor], poses[scan])
            found = align(submaps.clouds[k], local, guess, guess, TRUST, WIDTH, noise)
            if found.overlap >= LEAST_OVERLAP and found.matched >= LEAST_MATCHED:
                covariance = np.linalg.inv(found.information + VAGUE) + np.diag(np.array(FLOOR)[[0, 0, 1]] ** 2)
                parts.append((anchor, scan, found.pose, covariance))
    if not parts:
        return Edges.none()
    first, second, relative, covariances = zip(*parts, strict=True)
    return Edges(np.array(first), np.array(second), np.array(relative), np.array(covariances))


def _partners(submaps: Submaps, poses: Array, driven: Array) -> dict[int, list[int]]:
    """Keyframes to align with every submap that has any, in the order of the submaps."""
    from scipy.spatial import cKDTree

    middles = poses[submaps.anchor_scans, :2]
    tree = cKDTree(middles)
    at_anchors = driven[submaps.anchor_scans]
    out: dict[int, list[int]] = {}
    for k, scan in enumerate(submaps.scans):
        near = np.array(tree.query_ball_point(poses[scan, :2], NEAR), dtype=np.int64)
        near = near[np.abs(at_anchors[near] - driven[scan]) > GAP]
        chosen: list[int] = []
        for number in near[np.argsort(np.linalg.norm(middles[near] - poses[scan, :2], axis=1), kind="stable")]:
            if all(abs(int(number) - c) > APART for c in chosen):
                chosen.append(int(number))
                out.setdefault(int(number), []).append(k)
            if len(chosen) == VISITS:
                break
    return dict(sorted(out.items()))
