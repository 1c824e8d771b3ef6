"""Ceiling height from the edges between walls and ceiling that images show."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from recon.geometry import Array, Pose3
from recon.layout.edges import Edges, find_edges, shown_lengths, uprights
from recon.model import Layout
from recon.sequence.camera import Camera
from recon.vision.frame import FrameLines

LOWEST, HIGHEST = 2.15, 8.0
"""m; below are the heads of doors."""
STEP = 0.005
WIDTH = 0.02
"""m, least standard deviation of an edge's height in the vote."""
NEAR = 0.06
"""m, edges this close to a height are that height's."""
MAX_SIGMA = 0.06
"""m, edges known worse than this do not vote."""
MIN_FRAMES = 3
MIN_WALLS = 2
MIN_LENGTH = 4.0
"""m of edge in all, over frames."""
MIN_COVERAGE = 0.3
"""Share of the wall tops in view at a height that edges cover; heads of doors and boards cover less."""
MAX_CROSSED = 0.25
"""Upright lines that go on through a height, for each frame that votes for it."""
RIVAL = 0.7
"""Another height with this share of the best one's score leaves the question open."""
MAX_FRAMES = 400
SYSTEMATIC = 0.004
"""rad, what all images share: the error of the camera's tilt."""


def measure_ceiling(
    layout: Layout, frames: Sequence[FrameLines | None], map_from_camera: Sequence[Pose3 | None], camera: Camera
) -> tuple[float | None, float | None]:
    """Height of the ceiling above the floor and its standard deviation, m; (None, None) when images do not tell.

    Image lines that are level on a wall's plane vote for their height. The ceiling is the height that several frames
    and walls agree on, at which most of the wall tops in view show an edge, and through which no upright line goes:
    heads of doors and boards cover little and uprights pass them, lines on the ceiling itself scatter. There is no
    answer where a second height does nearly as well. frames and map_from_camera (None: not known) have the same
    length; camera: of the frames, its K counts.
    """
    seen = [(f, p) for f, p in zip(frames, map_from_camera, strict=True) if f is not None and p is not None and len(f)]
    views = seen[:: max(1, int(np.ceil(len(seen) / MAX_FRAMES)))]
    walls = layout.walls
    if not views or not walls:
        return None, None
    edges = find_edges(walls, views, camera)
    edges = edges.where((edges.height >= LOWEST) & (edges.height <= HIGHEST) & (edges.sigma <= MAX_SIGMA))
    tops = uprights(walls, views, camera)
    scored = []
    for height in _peaks(edges):
        near = edges.where(np.abs(edges.height - height) <= NEAR)
        if not _is_supported(near, height, tops):
            continue
        covered = near.covered()
        coverage = covered / max(float(shown_lengths(walls, views, camera, height).sum()), covered)
        if coverage >= MIN_COVERAGE:
            scored.append((covered * coverage, height))
    if not scored:
        return None, None
    best, height = max(scored)
    if any(score > RIVAL * best and abs(other - height) > 2 * NEAR for score, other in scored):
        return None, None
    return _estimate(edges, height)


def _is_supported(edges: Edges, height: float, uprights_: Array) -> bool:
    """Whether enough frames, walls and metres have an edge at a height and few upright lines (N, 2) pass it."""
    frames = len(np.unique(edges.frame))
    if frames < MIN_FRAMES or len(np.unique(edges.wall)) < MIN_WALLS or float(edges.length.sum()) < MIN_LENGTH:
        return False
    crossing = (uprights_[:, 0] < height - 3 * NEAR) & (uprights_[:, 1] > height + 3 * NEAR)
    return int(crossing.sum()) <= MAX_CROSSED * frames


def _peaks(edges: Edges) -> list[float]:
    """Heights that edges agree on (local maxima of their votes), highest first."""
    if len(edges.height) == 0:
        return []
    grid = np.arange(LOWEST - 4 * WIDTH, float(edges.height.max()) + 4 * WIDTH, STEP)
    votes = np.zeros(len(grid))
    sigma = np.maximum(edges.sigma, WIDTH)
    for z, s, w in zip(edges.height, sigma, np.minimum(edges.length, 2.0), strict=True):
        votes += w * np.exp(-0.5 * ((grid - z) / s) ** 2)
    top = (votes[1:-1] >= votes[:-2]) & (votes[1:-1] > votes[2:])
    return [float(h) for h in grid[1:-1][top][::-1]]


def _estimate(edges: Edges, height: float) -> tuple[float, float]:
    """Robust weighted mean of the edges about a height, and its standard deviation; a frame counts once."""
    for _ in range(10):
        deviation = (edges.height - height) / np.maximum(edges.sigma, WIDTH)
        weight = edges.length / np.maximum(edges.sigma, WIDTH) ** 2
        weight = weight * np.clip(1 - (deviation / 4.685) ** 2, 0.0, None) ** 2  # Tukey's biweight
        height = float(np.average(edges.height, weights=weight))
    edges, weight = edges.where(weight > 0), weight[weight > 0]
    spread = float(np.sqrt(np.average((edges.height - height) ** 2, weights=weight)))
    shared = SYSTEMATIC * float(np.average(edges.range, weights=weight))
    return height, float(np.hypot(max(spread, 0.005) / np.sqrt(len(np.unique(edges.frame))), shared))
