"""A small simulator for the graph's tests: plans, drives, noisy segments and motions with exact covariances."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from recon.geometry import Array, apply2, between2, compose2, inverse2
from recon.graph.line import carry
from recon.graph.motion import Motion
from recon.graph.observation import WallObservations
from recon.sequence.trajectory import Trajectory

MOTION_SIGMA = np.array([0.006, 0.006, 0.003])


def polygon(corners: list[tuple[float, float]]) -> Array:
    """(n, 2, 2) walls of a counter-clockwise room, free space on the left."""
    points = np.array(corners, dtype=float)
    return np.stack([points, np.roll(points, -1, axis=0)], axis=1)


def drive(waypoints: list[tuple[float, float]], step: float = 0.25) -> Array:
    """(N, 3) poses along straight legs, heading turned smoothly, the first at the origin of the map."""
    points = np.array(waypoints, dtype=float)
    legs = np.linalg.norm(np.diff(points, axis=0), axis=1)
    way = np.concatenate([[0.0], np.cumsum(legs)])
    at = np.arange(0.0, way[-1], step)
    xy = np.stack([np.interp(at, way, points[:, k]) for k in (0, 1)], axis=1)
    heading = np.unwrap(np.arctan2(*np.gradient(xy, axis=0).T[::-1]))
    smooth = np.convolve(np.pad(heading, 2, mode="edge"), np.full(5, 0.2), mode="valid")
    return np.column_stack([xy, smooth])


@dataclass(frozen=True)
class Drive:
    """What a simulated drive gives: truth (N, 3), where every scan starts, motions, observations, their true walls."""

    truth: Array
    walls: Array
    start: Trajectory
    motion: Motion
    observations: WallObservations
    wall_of: Array


def simulate(
    walls: Array, poses: Array, seed: int, sigma: float = 0.01, beams: int = 270, reach: float = 12.0
) -> Drive:
    """Scans of `walls` (W, 2, 2) from `poses`, one segment a wall and unbroken stretch, as the paper's LiDAR has them.

    The map frame is the first pose's, and `walls` of the result are in it.
    """
    rng = np.random.default_rng(seed)
    walls = apply2(inverse2(poses[0]), walls.reshape(-1, 2)).reshape(-1, 2, 2)
    poses = between2(poses[0], poses)
    rows, ends, covariances, owner = [], [], [], []
    for number, pose in enumerate(poses):
        for wall, segment, covariance in _segments(walls, pose, rng, sigma, beams, reach):
            rows.append(number)
            ends.append(segment)
            covariances.append(covariance)
            owner.append(wall)
    observations = WallObservations(np.array(rows), np.array(ends), np.array(covariances), np.full(len(rows), -1))
    true = between2(poses[:-1], poses[1:])
    measured = true + rng.normal(size=true.shape) * MOTION_SIGMA
    motion = Motion(measured, np.broadcast_to(np.diag(MOTION_SIGMA**2), (len(true), 3, 3)).copy())
    chain = [poses[0]]
    for step in measured:
        chain.append(compose2(chain[-1], step))
    start = Trajectory(np.cumsum(rng.uniform(0.18, 0.22, len(poses))), np.array(chain))
    return Drive(poses, walls, start, motion, observations, np.array(owner))


def _segments(
    walls: Array, pose: Array, rng: np.random.Generator, sigma: float, beams: int, reach: float
) -> list[tuple[int, Array, Array]]:
    bearing = np.linspace(-2.4, 2.4, beams)
    ray = np.stack([np.cos(bearing + pose[2]), np.sin(bearing + pose[2])], axis=1)
    a, along = walls[:, 0] - pose[:2], walls[:, 1] - walls[:, 0]
    cross = ray[:, None, 0] * along[None, :, 1] - ray[:, None, 1] * along[None, :, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = (a[None, :, 0] * along[None, :, 1] - a[None, :, 1] * along[None, :, 0]) / cross
        share = (a[None, :, 0] * ray[:, None, 1] - a[None, :, 1] * ray[:, None, 0]) / cross
    distance[~((share >= 0) & (share <= 1) & (distance > 0.05))] = np.inf
    hit = np.argmin(distance, axis=1)
    ranges = distance[np.arange(beams), hit]
    hit[ranges > reach] = -1
    cuts = np.flatnonzero(np.diff(hit)) + 1
    found = []
    for run in np.split(np.arange(beams), cuts):
        if hit[run[0]] < 0 or len(run) < 8:
            continue
        length = np.linalg.norm(along[hit[run[0]]])
        slope = np.abs(cross[run, hit[run[0]]]) / length  # cosine of incidence
        seen = ranges[run] + rng.normal(size=len(run)) * sigma
        points = np.stack([np.cos(bearing[run]), np.sin(bearing[run])], axis=1) * seen[:, None]
        segment, covariance = _fit(points, sigma * np.maximum(slope, 0.1))
        if np.linalg.norm(segment[1] - segment[0]) > 0.3:
            found.append((int(hit[run[0]]), segment, covariance))
    return found


def _fit(points: Array, noise: Array) -> tuple[Array, Array]:
    """Weighted line through points whose noise across it is known.

    They come counter-clockwise, so that the scanner is on the left on the way from the first to the last.
    """
    weight = noise**-2
    direction = points[-1] - points[0]
    for _ in range(3):
        direction = direction / np.linalg.norm(direction)
        normal = np.array([-direction[1], direction[0]])
        centre = weight @ points / weight.sum()
        s, d = (points - centre) @ direction, (points - centre) @ normal
        direction = direction + normal * (weight @ (s * d)) / (weight @ s**2)
    direction = direction / np.linalg.norm(direction)
    s = (points - centre) @ direction
    covariance = np.diag([1 / weight.sum(), 1 / (weight @ s**2)])
    ends = np.stack([centre + direction * s.min(), centre + direction * s.max()])
    return ends, carry(covariance, np.asarray((s.min() + s.max()) / 2))
