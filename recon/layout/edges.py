"""Image lines on walls: level ones with their heights, upright ones with their ends."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array, Pose3
from recon.layout.line import total, union
from recon.model import Wall
from recon.sequence.camera import Camera
from recon.vision.frame import VERTICAL, FrameLines

View = tuple[FrameLines, Pose3]

MAX_RANGE = 15.0
"""m"""
SLOPE = 0.04
"""Largest rise per metre along a wall of a line that is level."""
PIXELS = 1.0
"""Standard deviation of a line's place, pixels ..."""
TILT = 0.002
"""... and of one image's tilt, rad."""
SYSTEMATIC = 0.004
"""rad, what all images share: the error of the camera's tilt."""
MAX_SIGMA = 0.06
"""m, edges known worse than this do not vote."""
BEYOND = 0.2
"""m that a line may reach past the end of its wall."""
SAMPLE = 0.1
"""m along a wall's top."""


@dataclass(frozen=True)
class Edges:
    """N level lines on walls: height (N,) m above the floor with its sigma, range from the camera, m; frame and wall.

    span: (N, 2) m, from where to where along the wall.
    """

    height: Array
    sigma: Array
    range: Array
    frame: NDArray[np.int64]
    wall: NDArray[np.int64]
    span: Array

    @property
    def length(self) -> Array:
        """(N,) m along the wall."""
        return np.asarray(self.span[:, 1] - self.span[:, 0])

    def where(self, mask: NDArray[np.bool_]) -> Edges:
        """Only those with `mask` (N,) set."""
        return Edges(*(getattr(self, name)[mask] for name in ("height", "sigma", "range", "frame", "wall", "span")))

    def sure(self, low: float, high: float) -> Edges:
        """Those at heights from `low` to `high` m that are known well enough to vote."""
        return self.where((self.height >= low) & (self.height <= high) & (self.sigma <= MAX_SIGMA))

    def deviation(self, height: float, weight: Array) -> tuple[float, float]:
        """m, standard deviations of a height that the edges with weights (N,) have in the mean: of chance, a frame
        counting once, and of what all images share."""
        spread = float(np.sqrt(np.average((self.height - height) ** 2, weights=weight)))
        shared = SYSTEMATIC * float(np.average(self.range, weights=weight))
        return max(spread, 0.005) / np.sqrt(len(np.unique(self.frame))), shared

    def covered(self) -> float:
        """m of wall, summed over frames, that the lines cover (no stretch twice in one frame)."""
        out = 0.0
        for pair in np.unique(np.stack([self.frame, self.wall], axis=1), axis=0):
            out += total(union(self.span[(self.frame == pair[0]) & (self.wall == pair[1])]))
        return out


@dataclass(frozen=True)
class _Planes:
    """Walls as arrays: start, direction, normal (W, 2), length (W,), and whether each was seen."""

    start: Array
    direction: Array
    normal: Array
    length: Array
    known: NDArray[np.bool_]

    @staticmethod
    def of(walls: Sequence[Wall]) -> _Planes:
        return _Planes(
            np.array([wall.start for wall in walls]),
            np.array([wall.direction for wall in walls]),
            np.array([wall.normal for wall in walls]),
            np.array([wall.length for wall in walls]),
            np.array([wall.source != "inferred" for wall in walls]),
        )

    def near(self, centre: Array) -> tuple[_Planes, NDArray[np.int64]]:
        """Those of the walls that come within `MAX_RANGE` of a point (2,), and which they are."""
        along = np.clip(np.einsum("wi,wi->w", centre - self.start, self.direction), 0.0, self.length)
        foot = self.start + along[:, None] * self.direction
        index = np.flatnonzero(np.linalg.norm(foot - centre, axis=1) < MAX_RANGE)
        part = (getattr(self, name)[index] for name in ("start", "direction", "normal", "length", "known"))
        return _Planes(*part), index

    def meet(self, centre: Array, rays: Array) -> tuple[Array, Array]:
        """(N, W) in units of |ray| where rays (N, 2) from `centre` (2,) meet each wall's line, and m along it.

        inf where a ray does not meet the line's front.
        """
        toward = -rays @ self.normal.T
        away = np.einsum("wi,wi->w", centre - self.start, self.normal)
        with np.errstate(divide="ignore", invalid="ignore"):
            t = np.where((toward > 1e-9) & (away > 0), away / toward, np.inf)
            along = np.einsum("wi,wi->w", centre - self.start, self.direction) + t * (rays @ self.direction.T)
        return t, np.where(np.isfinite(t), along, np.nan)

    def first(self, centre: Array, rays: Array) -> tuple[NDArray[np.int64], Array]:
        """(N,) the wall that each ray meets first, -1 for none, and how far, in units of |ray|."""
        if not len(self.start):
            return np.full(len(rays), -1), np.full(len(rays), np.inf)
        t, along = self.meet(centre, rays)
        hit = (along >= -0.02) & (along <= self.length + 0.02)
        t = np.where(hit, t, np.inf)
        wall = np.argmin(t, axis=1)
        distance = t[np.arange(len(t)), wall]
        return np.where(np.isfinite(distance), wall, -1), distance


def find_edges(walls: Sequence[Wall], views: Sequence[View], camera: Camera) -> Edges:
    """Lines of all views above the camera that are level on the wall that they lie on."""
    planes = _Planes.of(walls)
    offset_sigma = np.array([wall.sigma_offset for wall in walls])
    parts: list[tuple[Array, ...]] = []
    for k, (lines, pose) in enumerate(views):
        ends, wall = _on_walls(planes, lines, lines.labels != VERTICAL, pose, camera)
        if len(wall) == 0:
            continue
        rays, t, along = ends
        z = pose.translation[2] + t * rays[..., 2]
        span = np.sort(along, axis=1)
        rise, run = np.abs(z[:, 1] - z[:, 0]), np.maximum(span[:, 1] - span[:, 0], 1e-6)
        reach = (t * np.linalg.norm(rays[..., :2], axis=-1)).mean(axis=1)
        sigma = _sigma(rays.mean(axis=1), planes.normal[wall], reach, offset_sigma[wall], camera)
        level = (rise <= SLOPE * run + 2 * sigma * run / (run + 1)) & (rays[..., 2] > 0).all(axis=1) & (run > 0.1)
        keep = level & (reach < MAX_RANGE)
        columns = (z.mean(axis=1), sigma, reach, np.full(len(z), k), wall, span)
        parts.append(tuple(column[keep] for column in columns))
    if not parts:
        none, index = np.zeros(0), np.zeros(0, np.int64)
        return Edges(none, none, none, index, index, np.zeros((0, 2)))
    height, sigma, reach, frame, owner, span = (np.concatenate(column) for column in zip(*parts, strict=True))
    return Edges(height, sigma, reach, frame.astype(np.int64), owner.astype(np.int64), span)


def _on_walls(
    planes: _Planes, lines: FrameLines, chosen: NDArray[np.bool_], pose: Pose3, camera: Camera
) -> tuple[tuple[Array, Array, Array], NDArray[np.int64]]:
    """For lines on one seen wall: (rays (N, 2, 3), t (N, 2), along (N, 2)) of their ends, and the wall (N,)."""
    pixels = lines.endpoints[chosen]
    normal = np.concatenate([pixels, np.ones((*pixels.shape[:2], 1))], axis=2) @ np.linalg.inv(camera.matrix).T
    rays = normal @ pose.rotation.T
    centre = pose.translation[:2]
    planes, number = planes.near(centre)
    if not len(number):
        return (rays[:0], np.zeros((0, 2)), np.zeros((0, 2))), number
    wall, _ = planes.first(centre, rays.mean(axis=1)[:, :2])
    index = np.arange(len(wall))
    hits = [planes.meet(centre, rays[:, k, :2]) for k in range(2)]
    t, along = (np.stack(part, axis=1) for part in zip(*hits, strict=True))
    t, along = t[index, :, wall], along[index, :, wall]
    first = np.stack([planes.first(centre, rays[:, k, :2])[1] for k in range(2)], axis=1)
    ok = (wall >= 0) & planes.known[wall] & np.isfinite(t).all(axis=1) & (t <= 1.02 * first + 0.02).all(axis=1)
    ok &= ((along > -BEYOND) & (along < planes.length[wall, None] + BEYOND)).all(axis=1)
    return (rays[ok], t[ok], along[ok]), number[wall[ok]]


def _sigma(rays: Array, normal: Array, reach: Array, offset_sigma: Array, camera: Camera) -> Array:
    """(N,) m, standard deviation of the height of lines seen along rays (N, 3) on walls with normals (N, 2)."""
    flat = np.linalg.norm(rays[:, :2], axis=1)
    slope = rays[:, 2] / flat
    sine = np.maximum(np.abs(np.einsum("ni,ni->n", rays[:, :2], normal)) / flat, 1e-3)
    cotangent = np.sqrt(np.maximum(1 - sine**2, 0.0)) / sine
    pixel = reach * PIXELS / camera.matrix[0, 0] * np.sqrt(1 + (slope * cotangent) ** 2)
    return np.asarray(np.sqrt(pixel**2 + (reach * TILT) ** 2 + (slope * offset_sigma / sine) ** 2))


def uprights(walls: Sequence[Wall], views: Sequence[View], camera: Camera) -> tuple[Array, NDArray[np.int64]]:
    """(N, 2) m: lower and upper height of the vertical image lines on walls, and (N,) the walls."""
    planes = _Planes.of(walls)
    heights, owner = [np.zeros((0, 2))], [np.zeros(0, np.int64)]
    for lines, pose in views:
        (rays, t, _), wall = _on_walls(planes, lines, lines.labels == VERTICAL, pose, camera)
        if len(wall):
            heights.append(np.sort(pose.translation[2] + t * rays[..., 2], axis=1))
            owner.append(wall)
    return np.concatenate(heights), np.concatenate(owner)


def shown_lengths(walls: Sequence[Wall], views: Sequence[View], camera: Camera, height: float) -> Array:
    """(W,) m of each seen wall's top that the views show, added up, were the walls `height` m high."""
    planes = _Planes.of(walls)
    rectified = camera.rectified()
    feet = [wall.start + np.arange(SAMPLE / 2, wall.length, SAMPLE)[:, None] * wall.direction for wall in walls]
    owner = np.repeat(np.arange(len(walls)), [len(foot) for foot in feet])
    known = planes.known[owner]
    points, owner = np.concatenate(feet)[known], owner[known]
    tops = np.concatenate([points, np.full((len(points), 1), height)], axis=1)
    out = np.zeros(len(walls))
    for _, pose in views:
        rays = points - pose.translation[:2]
        near = np.flatnonzero(np.linalg.norm(rays, axis=1) < MAX_RANGE)
        pixels = rectified.project(pose.inverse().apply(tops[near]))
        inside = (pixels >= 0) & (pixels <= np.array([camera.width - 1, camera.height - 1]))
        near = near[inside.all(axis=1)]
        if len(near):
            around, number = planes.near(pose.translation[:2])
            first, distance = around.first(pose.translation[:2], rays[near])
            shown = (number[first] == owner[near]) | (distance > 0.98)
            out += SAMPLE * np.bincount(owner[near[shown]], minlength=len(walls))
    return out
