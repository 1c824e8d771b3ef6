"""Simulated scans of wall segments, and what holds of every layout made from them."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import shapely

from recon.config import LayoutConfig
from recon.geometry import Array
from recon.graph.estimate import MapEstimate, WallLine
from recon.layout.build import build_layout
from recon.model import Layout
from recon.sequence.sequence import Scans
from recon.sequence.trajectory import Trajectory

Point = tuple[float, float]
BEAMS = 540


def cast(segments: Array, poses: Array, reach: float, seed: int = 0) -> Scans:
    """Scans (full turn, sigma 1 cm) of segments (S, 2, 2) from poses (N, 3)."""
    rng = np.random.default_rng(seed)
    bearings = -np.pi + 2 * np.pi / BEAMS * np.arange(BEAMS)
    a, d = segments[:, 0], segments[:, 1] - segments[:, 0]
    ranges = np.full((len(poses), BEAMS), np.inf)
    for i, (x, y, yaw) in enumerate(poses):
        ray = np.stack([np.cos(bearings + yaw), np.sin(bearings + yaw)], axis=1)
        cross = ray[:, None, 0] * d[:, 1] - ray[:, None, 1] * d[:, 0]
        to = a - (x, y)
        with np.errstate(divide="ignore", invalid="ignore"):
            t = (to[:, 0] * d[:, 1] - to[:, 1] * d[:, 0]) / cross
            s = (to[None, :, 0] * ray[:, None, 1] - to[None, :, 1] * ray[:, None, 0]) / cross
        t = np.where((t > 0) & (s >= 0) & (s <= 1), t, np.inf).min(axis=1)
        ranges[i] = np.where(t < reach, t + rng.normal(0, 0.01, BEAMS), np.inf)
    times = np.arange(len(poses), dtype=np.float64) / 10
    return Scans(times, ranges.astype(np.float32), -np.pi, 2 * np.pi / BEAMS, 0.1, reach)


def line(start: Point, end: Point, *seen: Point, sigma: float = 0.004) -> WallLine:
    """A wall line from start to end, free space on the left; seen: stretches in m from the start (default: all)."""
    a, b = np.array(start, float), np.array(end, float)
    length = float(np.linalg.norm(b - a))
    middle, yaw = (a + b) / 2, np.arctan2(*(b - a)[::-1])
    stretches = np.array(seen or [(0.0, length)]) - length / 2
    return WallLine(np.array([*middle, yaw]), stretches, sigma, 0.001, "lidar", 50)


def ring(*corners: Point) -> list[WallLine]:
    return [line(a, b) for a, b in pairwise([*corners, corners[0]])]


def drive(*points: Point, step: float = 0.2) -> Array:
    """Poses (N, 3) along way points."""
    parts = []
    for a, b in pairwise(np.array(points, float)):
        n = max(2, int(np.linalg.norm(b - a) / step))
        parts.append(np.column_stack([np.linspace(a, b, n), np.full(n, np.arctan2(*(b - a)[::-1]))]))
    return np.concatenate(parts)


def estimated(walls: list[WallLine], poses: Array) -> MapEstimate:
    times = np.arange(len(poses), dtype=np.float64) / 10
    return MapEstimate(Trajectory(times, poses), np.full((len(poses), 3), 0.005), tuple(walls))


def chain(*points: Point) -> list[tuple[Point, Point]]:
    return list(pairwise(points))


def layout_of(
    solid: list[tuple[Point, Point]], walls: list[WallLine], poses: Array, reach: float = 12.0
) -> tuple[Layout, Scans]:
    scans = cast(np.array(solid, float), poses, reach)
    return build_layout(estimated(walls, poses), scans, LayoutConfig()), scans


def check_sound(layout: Layout, scans: Scans, poses: Array) -> None:
    """What holds of every layout: simple, counter-clockwise, disjoint rooms; no wall where rays passed."""
    polygons = [shapely.Polygon(room.polygon) for room in layout.rooms]
    assert polygons
    for polygon in polygons:
        assert polygon.is_valid and polygon.exterior.is_ccw and polygon.area > 0.5
    for i, a in enumerate(polygons):
        assert all(a.intersection(b).area < 1e-6 for b in polygons[:i])
    assert [wall.id for wall in layout.walls] == list(range(len(layout.walls)))
    assert crossed_share(layout, scans, poses) < 0.01


def crossed_share(layout: Layout, scans: Scans, poses: Array) -> float:
    """Share of rays that go on for more than 20 cm behind a wall outside its openings."""
    bearings = scans.bearings
    count = crossed = 0
    for i in range(0, len(scans), 5):
        ok = np.isfinite(scans.ranges[i])
        start = poses[i, :2]
        step = scans.ranges[i][ok, None] * np.column_stack(
            [np.cos(bearings[ok] + poses[i, 2]), np.sin(bearings[ok] + poses[i, 2])]
        )
        through = np.zeros(len(step), bool)
        for wall in layout.walls:
            toward, away = -(step @ wall.normal), float((start - wall.start) @ wall.normal)
            if away <= 0:
                continue
            with np.errstate(divide="ignore", invalid="ignore"):
                t = np.where(toward > 0, away / toward, np.inf)
                along = (start - wall.start) @ wall.direction + t * (step @ wall.direction)
            t = np.where(np.isfinite(t), t, 2.0)
            hit = (t < 1) & (along > 0.05) & (along < wall.length - 0.05) & (toward * (1 - t) > 0.2)
            for opening in layout.openings:
                if opening.wall == wall.id:
                    low, high = sorted(float((p - wall.start) @ wall.direction) for p in (opening.start, opening.end))
                    hit &= (along < low - 0.1) | (along > high + 0.1)
            through |= hit
        count, crossed = count + len(step), crossed + int(through.sum())
    return crossed / count


def corner_error(polygon: Array, truth: list[Point]) -> float:
    """Largest distance between corners and their nearest true ones, both ways."""
    d = np.linalg.norm(polygon[:, None] - np.array(truth)[None], axis=2)
    return float(max(d.min(axis=0).max(), d.min(axis=1).max()))
