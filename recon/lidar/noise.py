"""The scanner's range noise, from its own scans, so that one default serves cheap and good scanners."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from recon.config import LidarConfig
from recon.geometry import Array
from recon.lidar.line_fit import GRAZING_NOISE
from recon.lidar.points import scan_points
from recon.lidar.split_and_merge import find_segments
from recon.sequence.sequence import Scans

SCANS_USED = 50
MIN_RESIDUALS = 200
LEAST = 0.003
"""m: no scanner is trusted to be better than this."""
MOST = 0.08
"""m: no scanner is taken to be worse."""
FALLBACK = 0.01
"""m, where there is no surface to learn from."""
MAD_TO_SIGMA = 1.4826


def with_noise(scans: Scans, config: LidarConfig) -> LidarConfig:
    """The configuration with `range_sigma` estimated from the scans where it is 0."""
    return config if config.range_sigma > 0 else replace(config, range_sigma=estimate_range_sigma(scans))


def estimate_range_sigma(scans: Scans) -> float:
    """One standard deviation of the range noise, m.

    First from triples of neighbouring beams (on a flat wall 1/range is a cosine of the bearing, so the middle one
    follows from the outer two), which needs no segments; then from the distances of returns to the lines found with
    that, which also sees noise that neighbouring beams share. Medians, so clutter hardly counts.
    """
    chosen = np.unique(np.linspace(0, len(scans) - 1, min(len(scans), SCANS_USED)).astype(np.int64))
    sigma = _deviation([_triple_residuals(scans, int(i)) for i in chosen], FALLBACK)
    config = LidarConfig(range_sigma=sigma)
    return _deviation([_line_residuals(scans, int(i), config) for i in chosen], sigma)


def _deviation(residuals: list[Array], fallback: float) -> float:
    together = np.concatenate([np.zeros(0), *residuals])
    if len(together) < MIN_RESIDUALS:
        return fallback
    return float(np.clip(MAD_TO_SIGMA * np.median(np.abs(together)), LEAST, MOST))


def _triple_residuals(scans: Scans, index: int) -> Array:
    """Range residuals (m), of unit factor in the noise, of beams between two others on one surface."""
    ranges, valid = scans.ranges[index].astype(np.float64), scans.valid(index)
    step = abs(float(scans.angle_increment))
    before, middle, behind = ranges[:-2], ranges[1:-1], ranges[2:]
    smooth = valid[:-2] & valid[1:-1] & valid[2:]
    # not on grazing walls, where one beam's step changes the range by more than the noise
    smooth[smooth] = np.abs(before[smooth] - behind[smooth]) < 4.0 * step * middle[smooth] + 0.02
    before, middle, behind = before[smooth], middle[smooth], behind[smooth]
    expected = 2.0 * np.cos(step) / (1.0 / before + 1.0 / behind)
    spread = np.sqrt(1.0 + 0.25 * (expected / before) ** 4 + 0.25 * (expected / behind) ** 4)
    return np.asarray((middle - expected) / spread)


def _line_residuals(scans: Scans, index: int, config: LidarConfig) -> Array:
    """Distances (m) to fitted lines, of unit factor in the range noise, where the beam meets the wall steeply."""
    points = scan_points(scans, index)
    lines, _, _, owner, _ = find_segments(points, config)
    on_line = np.flatnonzero(owner >= 0)
    xy, line = points.xy[on_line], lines[owner[on_line]]
    delta = line[:, 2:4] - line[:, 0:2]
    normal = np.stack([-delta[:, 1], delta[:, 0]], axis=1) / np.linalg.norm(delta, axis=1, keepdims=True)
    distance = np.sum(normal * (xy - line[:, 0:2]), axis=1)
    cosine = np.abs(np.sum(normal * xy, axis=1)) / np.linalg.norm(xy, axis=1)
    return np.asarray((distance / np.sqrt(cosine**2 + GRAZING_NOISE**2))[cosine > 0.5])
