"""Ceiling heights from the edges between walls and ceiling that images show, heads of openings from theirs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from recon.facing import facing_rooms
from recon.geometry import Array, Pose3
from recon.layout.edges import Edges, View, find_edges, shown_lengths, uprights
from recon.layout.heads import measured_heads
from recon.model import Layout, Room, Wall
from recon.sequence.camera import Camera
from recon.vision.frame import FrameLines

LOWEST, HIGHEST = 2.15, 8.0
"""m; below are the heads of doors."""
STEP = 0.005
WIDTH = 0.02
"""m, least standard deviation of an edge's height in the vote."""
NEAR = 0.06
"""m, edges this close to a height are that height's."""
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
HIGHEST_DEFAULT, DEFAULT_STEP = 4.0, 0.1
"""m: without a ceiling found, it is taken to be above what images show of walls without an edge, up to here."""
HINT = 0.15
"""Share of the wall tops in view that edges cover at a height that may be an unseen ceiling's."""
GRID = 0.02
"""m; wall tops in view are counted for heights this far apart."""


def measure_heights(
    layout: Layout, frames: Sequence[FrameLines | None], map_from_camera: Sequence[Pose3 | None], camera: Camera
) -> Layout:
    """The layout with the ceilings and the heads of openings that images show, each with its standard deviation.

    frames and map_from_camera (None: not known) have the same length; camera: of the frames, its K counts. What no
    image tells stays as it is. A room has a ceiling of its own where its walls show one; what most of these, by area,
    agree on is the building's if its walls together do not tell. If nothing tells, the default is no lower than walls
    are seen to go on.
    """
    seen = [(f, p) for f, p in zip(frames, map_from_camera, strict=True) if f is not None and p is not None and len(f)]
    views = seen[:: max(1, int(np.ceil(len(seen) / MAX_FRAMES)))]
    if not views or not layout.walls:
        return layout
    evidence = _Evidence(layout.walls, views, camera)
    height, sigma = evidence.ceiling(np.ones(len(layout.walls), np.bool_))
    owner = facing_rooms(layout)
    rooms = []
    for k, room in enumerate(layout.rooms):
        own, own_sigma = evidence.ceiling(owner == k, height)
        rooms.append(room if own is None else replace(room, ceiling_height=own, sigma_ceiling=own_sigma))
    if height is None:
        height, sigma = _common(rooms)
    openings = measured_heads(layout.openings, layout.walls, evidence.level)
    default = evidence.open_above(layout.default_ceiling_height) if height is None else layout.default_ceiling_height
    return replace(
        layout,
        rooms=tuple(rooms),
        openings=openings,
        ceiling_height=height,
        sigma_ceiling=sigma,
        default_ceiling_height=default,
    )


def _common(rooms: list[Room]) -> tuple[float | None, float | None]:
    """The height that the largest area of rooms has, and its standard deviation."""
    known = [(room.ceiling_height, room.sigma_ceiling, room.area) for room in rooms if room.ceiling_height is not None]
    if not known:
        return None, None
    share = [sum(area for other, _, area in known if abs(other - height) <= NEAR) for height, _, _ in known]
    return known[int(np.argmax(share))][:2]


class _Evidence:
    """Edges and upright lines that views show on walls."""

    def __init__(self, walls: Sequence[Wall], views: Sequence[View], camera: Camera) -> None:
        self._walls, self._views, self._camera = walls, views, camera
        self.level = find_edges(walls, views, camera)
        self._edges = self.level.sure(LOWEST, HIGHEST)
        self._uprights, self._upright_wall = uprights(walls, views, camera)
        self._shown: dict[float, Array] = {}

    def ceiling(self, mask: NDArray[np.bool_], expected: float | None = None) -> tuple[float | None, float | None]:
        """Height of the ceiling over the walls of a mask (W,) and its standard deviation, m; None when it is not seen.

        Level lines vote for their height. The ceiling is the height that several frames and walls agree on, at which
        most of the wall tops in view show an edge, and through which no upright line goes: heads of doors and boards
        cover little and uprights pass them, lines on the ceiling itself scatter. There is no answer where a second
        height does nearly as well, but if one of them is `expected` that one is the answer.
        """
        edges, upright = self._edges.where(mask[self._edges.wall]), self._uprights[mask[self._upright_wall]]
        scored = []
        for height in _peaks(edges):
            near = edges.where(np.abs(edges.height - height) <= NEAR)
            if not _is_supported(near, height, upright):
                continue
            covered = near.covered()
            coverage = covered / max(float(self._shown_at(height)[mask].sum()), covered)
            if coverage >= MIN_COVERAGE:
                scored.append((covered * coverage, height))
        if not scored:
            return None, None
        best, height = max(scored)
        rivals = [(score, other) for score, other in scored if abs(other - height) > 2 * NEAR]
        if expected is not None and any(abs(other - expected) <= NEAR for _, other in scored):
            height = min((other for _, other in scored), key=lambda other: abs(other - expected))
        elif any(score > RIVAL * best for score, _ in rivals):
            return None, None
        return _estimate(edges, height)

    def open_above(self, default: float) -> float:
        """The least height, m, from `default` on where a ceiling may be that no image shows; `default` where none is.

        Where images show much of the walls at a height and no edge, the ceiling is higher.
        """
        for height in np.arange(default, HIGHEST_DEFAULT + DEFAULT_STEP / 2, DEFAULT_STEP):
            shown = float(self._shown_at(height).sum())
            near = self._edges.where(np.abs(self._edges.height - height) <= NEAR)
            if shown <= MIN_LENGTH or near.covered() > HINT * shown:
                return round(float(height), 3)
        return default

    def _shown_at(self, height: float) -> Array:
        """(W,) m of wall tops in view, to the nearest `GRID` of height."""
        key = round(height / GRID) * GRID
        if key not in self._shown:
            self._shown[key] = shown_lengths(self._walls, self._views, self._camera, key)
        return self._shown[key]


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
    return height, float(np.hypot(*edges.deviation(height, weight)))
