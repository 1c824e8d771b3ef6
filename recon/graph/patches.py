"""How far the platform moved, roughly: patches of one image laid over the next for every way it may have gone.

Corners followed alone may lock to the next tile of a floor. A patch knows its surface, so it can be drawn as the next
image would show it; only the true way suits walls and floor alike.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array, Pose3
from recon.graph.slide import Step, on_surfaces, project
from recon.sequence.camera import Camera

MAX_SPEED, MAX_REVERSE = 2.5, 1.0  # m/s
SPACING = 0.03  # m between ways that are tried
MOST_WAYS = 80
PATCH = 2.0 * np.stack(np.meshgrid(np.arange(-2, 3), np.arange(-2, 3)), axis=-1).reshape(-1, 2)  # px
BLUR = 1.0  # px
FLAT = 2.0  # grey values: patches with less contrast say nothing
MIN_PATCHES = 8
MIN_SCORE = 0.3
MARGIN = 0.08  # by which the best score must exceed the next way's
UNLIKELY = 0.1  # of score that a way one standard deviation from the known speed loses, four times that at two
WORST = 0.25  # of score that any way loses at most: a speed that was wrong must not hold
CHANGE = 0.5  # m/s^2: standard deviation of how fast a known speed changes


@dataclass(frozen=True)
class Guess:
    """The speed (m/s) of the platform some time (age, s) ago."""

    speed: float
    age: float

    def spread(self, seconds: float) -> float:
        """m: standard deviation of the way within so many seconds."""
        return CHANGE * (self.age + seconds) * seconds


def likely_way(
    first: NDArray[np.uint8],
    second: NDArray[np.uint8],
    corners: Array,
    step: Step,
    seconds: float,
    guess: Guess | None,
    pose: Pose3,
    camera: Camera,
    segments: Array,
) -> float | None:
    """The way (m) between two grey images at which patches around corners (N, 2), px, agree best.

    None where nothing agrees, or where several ways do equally well (tiles, and nothing else) and the speed before
    does not tell them apart. segments: (M, 2, 2) m, feet of walls in the first platform frame.
    """
    ways = _ways(seconds)
    score = _scores(_soft(first), _soft(second), corners, step, ways, pose, camera, segments)
    peak = np.flatnonzero((score[1:-1] >= score[:-2]) & (score[1:-1] > score[2:])) + 1
    peak = peak[score[peak] > MIN_SCORE]
    if not len(peak):
        return None
    likely = score[peak]
    if guess is not None:
        off = (ways[peak] - guess.speed * seconds) / guess.spread(seconds)
        likely = likely - np.minimum(UNLIKELY * off**2, WORST)
    order = np.argsort(-likely)
    if len(order) > 1 and likely[order[0]] - likely[order[1]] < MARGIN:
        return None
    return float(ways[peak[order[0]]])


def _ways(seconds: float) -> Array:
    low, high = -MAX_REVERSE * seconds, MAX_SPEED * seconds
    return np.linspace(low, high, int(np.clip((high - low) / SPACING, 8, MOST_WAYS)))


def _scores(
    first: NDArray[np.uint8],
    second: NDArray[np.uint8],
    corners: Array,
    step: Step,
    ways: Array,
    pose: Pose3,
    camera: Camera,
    segments: Array,
) -> Array:
    """(W,) mean correlation of the patches on walls and of those on the floor, both counting the same."""
    pixels = (corners[:, None] + PATCH).reshape(-1, 2)
    rays = np.concatenate([camera.undistort(pixels), np.ones((len(pixels), 1))], axis=1)
    points = on_surfaces(rays, pose, segments)
    one = _sample(first, pixels).reshape(len(corners), -1)
    whole = np.isfinite(points[:, 0]).reshape(len(corners), -1).all(axis=1) & (one.std(axis=1) > FLAT)
    points, one = points.reshape(len(corners), -1, 3)[whole], one[whole]
    floor = points[:, :, 2].max(axis=1) < 1e-6
    kinds = [k for k in (floor, ~floor) if k.sum() >= MIN_PATCHES]
    score = np.zeros(len(ways))
    if not kinds:
        return score
    for i, way in enumerate(ways):
        seen = project(points.reshape(-1, 3), step.relative(np.array([way, 0.0, 0.0])), pose, camera)
        other = _sample(second, seen).reshape(len(points), -1)
        alike = _correlation(one, other)
        means = [m for k in kinds if (m := _mean(alike[k])) is not None]
        score[i] = np.mean(means) if means else 0.0
    return score


def _soft(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    return np.asarray(cv2.GaussianBlur(image, (0, 0), BLUR), dtype=np.uint8)


def _mean(alike: Array) -> float | None:
    """Of the patches that are in the picture; None where few are."""
    seen = np.isfinite(alike)
    return float(alike[seen].mean()) if seen.sum() >= MIN_PATCHES // 2 else None


def _sample(image: NDArray[np.uint8], pixels: Array) -> Array:
    """(N,) grey values at pixels (N, 2), nan outside."""
    places = np.nan_to_num(pixels, nan=-10.0).astype(np.float32).reshape(-1, 1, 2)
    values = cv2.remap(image, places, None, cv2.INTER_LINEAR).ravel().astype(np.float64)
    inside = ((places[:, 0] >= 0) & (places[:, 0] <= np.array(image.shape[::-1]) - 1)).all(axis=1)
    return np.where(inside, values, np.nan)


def _correlation(one: Array, other: Array) -> Array:
    """(N,) normalised correlation of the rows of two arrays (N, P); nan where a row has a nan."""
    a, b = one - one.mean(axis=1, keepdims=True), other - other.mean(axis=1, keepdims=True)
    size = np.sqrt(np.sum(a**2, axis=1) * np.sum(b**2, axis=1))
    return np.asarray(np.sum(a * b, axis=1) / np.maximum(size, 1e-9))
