"""The scanner: exact rays against the building's slice at the scanner's height, then a real scanner's faults."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array
from recon.sequence.sequence import Scans
from recon.simulate.building import Building
from recon.simulate.drive import Drive
from recon.simulate.plan import PlanLidar

JUMP = 0.3
"""m between neighbouring beams that makes a mixed return possible."""
CELL = 0.75
"""m, side of the cells that rays walk through."""
BLOCK = 4000
"""Scans that are made at once: a long drive needs no more memory than this many."""


@dataclass(frozen=True)
class Slice:
    """What the scan plane cuts: segments (M, 4) x0, y0, x1, y1, plan frame, m; glass (M,); surface (M,) its index."""

    segments: Array
    glass: NDArray[np.bool_]
    surface: NDArray[np.int64]


def cut(building: Building, height: float) -> Slice:
    """The building's vertical surfaces at `height` m above the floor."""
    segments, glass, owner = [], [], []
    for i, surface in enumerate(building.surfaces):
        if surface.axis_v[2] != 1.0:
            continue
        for corners in surface.vertices.reshape(-1, 4, 2):
            if corners[0, 1] <= height - surface.origin[2] < corners[2, 1]:
                ends = surface.origin[:2] + corners[:2, :1] * surface.axis_u[:2]
                segments.append(ends.ravel())
                glass.append(surface.kind == "glass")
                owner.append(i)
    return Slice(np.array(segments).reshape(-1, 4), np.array(glass, dtype=bool), np.array(owner, dtype=np.int64))


def cast(scene: Slice, origins: Array, directions: Array) -> tuple[Array, NDArray[np.int64]]:
    """Distances (N,) m and indices (N,) of the segments hit along unit directions (N, 2); inf and -1 where none is."""
    from recon.simulate.kernels import bin_segments, cast_segments

    ends = scene.segments.reshape(-1, 2)
    if not len(ends):
        return np.full(len(origins), np.inf), np.full(len(origins), -1, np.int64)
    corner = ends.min(axis=0)
    shape = np.floor(np.ptp(ends, axis=0) / CELL).astype(np.int64) + 1
    start, items = bin_segments(scene.segments, corner, shape, CELL)
    rays = np.ascontiguousarray(origins), np.ascontiguousarray(directions)
    distance, index = cast_segments(scene.segments, start, items, corner, shape, CELL, *rays)
    return distance, index


def scan_times(settings: PlanLidar, drive: Drive, rng: np.random.Generator) -> Array:
    """Times (N,) s from the start of the drive of each scan's first beam, slightly irregular."""
    period = 1.0 / settings.rate
    times = np.arange(0.0, max(drive.duration - settings.scan_time, 0.0) + 1e-9, period)
    return np.maximum(times + rng.uniform(0.0, 0.06 * period, len(times)), 0.0)


def simulate_lidar(building: Building, drive: Drive, times: Array, start: float, rng: np.random.Generator) -> Scans:
    """Scans at `times` (N,) s from the start of the drive, with time stamps moved by `start` s."""
    settings = building.plan.lidar
    full = settings.fov_deg >= 360.0
    fov = np.radians(settings.fov_deg)
    step = fov / (settings.beams if full else settings.beams - 1)
    bearings = -fov / 2 + step * np.arange(settings.beams)
    increment = settings.scan_time / (settings.beams - 1)
    scene = cut(building, settings.height)
    ranges = np.empty((len(times), settings.beams), np.float32)
    intensities = np.zeros(ranges.shape, np.float32) if settings.intensities else None
    for low in range(0, len(times), BLOCK):
        block = slice(low, low + BLOCK)
        poses = drive.at((times[block, None] + increment * np.arange(settings.beams)).ravel())
        angle = poses[:, 2] + np.tile(bearings, len(times[block]))
        directions = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        distance, index = cast(scene, poses[:, :2], directions)
        exact = np.where((index >= 0) & scene.glass[index], np.inf, distance).reshape(-1, settings.beams)
        ranges[block] = _measure(exact, settings, rng)
        if intensities is not None:
            seen = _intensities(scene, index, directions).reshape(exact.shape)
            intensities[block] = np.where(np.isfinite(ranges[block]), seen, 0.0)
    limits = settings.range_min, settings.range_max
    return Scans(times + start, ranges, float(bearings[0]), float(step), *limits, increment, intensities)


def _measure(exact: Array, settings: PlanLidar, rng: np.random.Generator) -> NDArray[np.float32]:
    """Noise, mixed returns at jumps, outliers, drop-outs and the range limits; (N, B) in and out."""
    ranges = exact + rng.normal(0.0, settings.sigma, exact.shape)
    after = np.roll(exact, -1, axis=1)
    with np.errstate(invalid="ignore"):
        jump = np.isfinite(exact) & np.isfinite(after) & (np.abs(after - exact) > JUMP)
    jump &= rng.random(exact.shape) < settings.mixed
    share = rng.random(exact.shape)
    ranges[jump] = exact[jump] + share[jump] * (after[jump] - exact[jump])
    outlier = np.isfinite(ranges) & (rng.random(exact.shape) < settings.outlier)
    ranges[outlier] *= rng.random(exact.shape)[outlier]
    ranges[rng.random(exact.shape) < settings.dropout] = np.inf
    ranges[ranges > settings.range_max] = np.inf
    ranges[ranges < settings.range_min] = np.nan
    return ranges.astype(np.float32)


def _intensities(scene: Slice, index: NDArray[np.int64], directions: Array) -> Array:
    """Cosine of the angle of incidence times a reflectance that differs between surfaces, in [0, 1]."""
    along = scene.segments[index, 2:] - scene.segments[index, :2]
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    cosine = np.abs(along[:, 0] * directions[:, 1] - along[:, 1] * directions[:, 0])
    reflectance = 0.4 + 0.6 * ((scene.surface[index] * 0.618034) % 1.0)
    return np.asarray(cosine * reflectance)
