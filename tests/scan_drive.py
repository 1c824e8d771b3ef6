"""Simulated scans and odometry along given poses, for tests of whole drives."""

from __future__ import annotations

import numpy as np

from recon.geometry import Array, apply2, between2, compose2
from recon.sequence.sequence import Scans
from recon.sequence.trajectory import Trajectory

FULL = 2 * np.pi
INTERVAL = 0.4
"""s between scans."""


def polygon(*corners: tuple[float, float]) -> Array:
    """(n, 2, 2) walls, each from one corner to the next."""
    points = np.array(corners, dtype=float)
    return np.stack([points, np.roll(points, -1, axis=0)], axis=1)


def box(x: float, y: float, width: float, depth: float, yaw: float = 0.0) -> Array:
    """(4, 2, 2) sides of a piece of furniture."""
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * [width / 2, depth / 2]
    return polygon(*(tuple(c) for c in apply2([x, y, yaw], corners)))


OFFICE = np.concatenate(
    [
        polygon((0, 0), (9, 0), (9, 5), (5, 5), (5, 8), (0, 8)),
        box(2, 5, 1.2, 0.6),
        box(7, 3.5, 0.8, 0.8, 0.4),
        box(4.2, 1.0, 0.3, 0.3),
    ]
)


def cast_scans(
    walls: Array, poses: Array, beams: int, field: float, sigma: float, reach: float, seed: int = 0
) -> Scans:
    """One scan of walls (W, 2, 2) from each pose (N, 3); beyond `reach` no return."""
    rng, bearings = np.random.default_rng(seed), -field / 2 + field / beams * np.arange(beams, dtype=np.float64)
    ranges = np.empty((len(poses), beams))
    along = walls[:, 1] - walls[:, 0]
    for k, pose in enumerate(poses):
        beam = np.stack([np.cos(pose[2] + bearings), np.sin(pose[2] + bearings)], axis=1)[:, None]
        to = walls[:, 0] - pose[:2]
        with np.errstate(divide="ignore", invalid="ignore"):
            across = beam[..., 0] * along[:, 1] - beam[..., 1] * along[:, 0]
            distance = (to[:, 0] * along[:, 1] - to[:, 1] * along[:, 0]) / across
            part = (to[:, 0] * beam[..., 1] - to[:, 1] * beam[..., 0]) / across
            hit = (distance > 1e-6) & (part >= 0) & (part <= 1)
        ranges[k] = np.where(hit, distance, np.inf).min(axis=1)
    ranges += rng.normal(0, sigma, ranges.shape)
    ranges[ranges > reach] = np.inf
    stamps = INTERVAL * np.arange(len(poses), dtype=np.float64)
    return Scans(stamps, ranges.astype(np.float32), float(bearings[0]), field / beams, 0.05, reach)


def wheel_odometry(stamps: Array, poses: Array, scale: float, drift: float, seed: int = 1) -> Trajectory:
    """Odometry at the scans' stamps: distances times `scale`, heading off by `drift` rad a metre, a little noise."""
    rng = np.random.default_rng(seed)
    steps = between2(poses[:-1], poses[1:])
    steps[:, 2] += drift * np.hypot(steps[:, 0], steps[:, 1])
    steps = steps * [scale, scale, 1.0] + rng.normal(0, [0.003, 0.002, 0.003], steps.shape)
    out = [np.zeros(3)]
    for step in steps:
        out.append(compose2(out[-1], step))
    return Trajectory(stamps, np.array(out))
