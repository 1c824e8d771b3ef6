"""Recursive RANSAC over the images of a drive (paper 2.4, Algorithm 1)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.calibration.refine import SIMILARITY, refine
from recon.calibration.search import MIN_FOOT, MIN_FRACTION
from recon.calibration.similarity import Similarity, similarity_from_pairs
from recon.calibration.support import CalibrationFrames, score, support
from recon.calibration.topdown import ground_from_camera, ground_map
from recon.geometry import Array, Pose3
from recon.sequence.camera import Camera

HEIGHT_RANGE = (0.1, 3.5)  # m, of a camera on a platform or in a hand
MAX_OFFSET = 1.5  # m, from the scanner
MAX_TURN = 0.07  # rad, between associated directions
SHORT_LIST = 60  # of a seeding image's own best hypotheses
ALWAYS_SEEDED = 4  # images that seed though a hypothesis explains them: a shifted one explains much, too
PROBES = 10  # images on which a new hypothesis is ranked


@dataclass(frozen=True)
class Hypothesis:
    """A camera pose and the images (indices into the frames) that support it."""

    platform_from_camera: Pose3
    consensus: NDArray[np.int64]
    score: float


def _lines_through(ends: Array) -> Array:
    """Homogeneous lines (..., 3) through pairs of points (..., 2, 2)."""
    one = np.ones((*ends.shape[:-2], 1))
    a = np.concatenate([ends[..., 0, :], one], axis=-1)
    b = np.concatenate([ends[..., 1, :], one], axis=-1)
    return np.cross(a, b)


def _corners(a: Array, b: Array) -> Array:
    """Intersections (N, 2) of the lines through the segments a and b (N, 2, 2); inf or nan where parallel."""
    p = np.cross(_lines_through(a), _lines_through(b))
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(p[:, :2] / p[:, 2:])


def _angles(ends: Array) -> Array:
    d = ends[..., 1, :] - ends[..., 0, :]
    return np.asarray(np.arctan2(d[..., 1], d[..., 0]))


def _draw(
    rng: np.random.Generator, ends: Array, groups: NDArray[np.int64], first: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]] | None:
    """Two items of group first[i] and one of the other group for each sample, longer ones more often."""
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    members = [np.flatnonzero(groups == g) for g in (0, 1)]
    if min(len(m) for m in members) < 1 or max(len(m) for m in members) < 2:
        return None
    n = len(first)
    picks = np.empty((3, n), np.int64)
    for g in (0, 1):
        weight = length[members[g]] / length[members[g]].sum()
        mine = first == g
        for row, rows in ((0, mine), (1, mine), (2, ~mine)):
            picks[row, rows] = rng.choice(members[g], size=int(rows.sum()), p=weight)
    return picks[0], picks[1], picks[2]


def seed(
    frames: CalibrationFrames, index: int, camera: Camera, vertical: Array, rng: np.random.Generator, iterations: int
) -> Array:
    """Hypotheses (N, 4) scale, yaw, x, y from random pairs of corners of image `index`, implausible ones dropped.

    Two lines of one horizontal direction cut one of the other in two corners, in the ground map and in the LiDAR's
    segments; both Manhattan associations are drawn.
    """
    part = slice(frames.line_offsets[index], frames.line_offsets[index + 1])
    lines, line_groups = ground_map(frames.lines[part], camera, vertical), frames.line_groups[part]
    near = np.isfinite(lines).all(axis=(1, 2)) & (np.linalg.norm(lines, axis=2).max(axis=1) < 25)
    lines, line_groups = lines[near], line_groups[near]
    part = slice(frames.segment_offsets[index], frames.segment_offsets[index + 1])
    segments, segment_groups = frames.segments[part], frames.segment_groups[part]
    first = rng.integers(0, 2, iterations)
    association = rng.integers(0, 2, iterations)
    drawn_lines = _draw(rng, lines, line_groups, first)
    drawn_segments = _draw(rng, segments, segment_groups, first ^ association)
    if drawn_lines is None or drawn_segments is None:
        return np.zeros((0, 4))
    a1, a2, b = (lines[i] for i in drawn_lines)
    w1, w2, v = (segments[i] for i in drawn_segments)
    ground = np.stack([_corners(a1, b), _corners(a2, b)], axis=1)
    lidar = np.stack([_corners(w1, v), _corners(w2, v)], axis=1)
    hypotheses = similarity_from_pairs(ground, lidar)
    with np.errstate(invalid="ignore"):
        turn = np.stack([_angles(w) - _angles(a) - hypotheses[:, 1] for w, a in ((w1, a1), (w2, a2), (v, b))])
        keep = np.isfinite(hypotheses).all(axis=1) & (np.abs(np.sin(turn)).max(axis=0) < MAX_TURN)
        keep &= (hypotheses[:, 0] > HEIGHT_RANGE[0]) & (hypotheses[:, 0] < HEIGHT_RANGE[1])
        keep &= np.hypot(hypotheses[:, 2], hypotheses[:, 3]) < MAX_OFFSET
    return np.asarray(hypotheses[keep])


class RecursiveRansac:
    """Algorithm 1: hypotheses tested, updated and seeded image by image."""

    def __init__(
        self,
        frames: CalibrationFrames,
        camera: Camera,
        vertical: tuple[Array, float],
        tolerance: float,
        iterations: int,
        seed: int,
    ) -> None:
        self._frames, self._camera, self._vertical = frames, camera, vertical
        self._tolerance, self._iterations = tolerance, iterations
        self._rng = np.random.default_rng(seed)
        self._rotation = ground_from_camera(vertical[0])
        self.hypotheses: list[Hypothesis] = []

    def run(self) -> list[Hypothesis]:
        """All hypotheses, best first."""
        count = len(self._frames)
        always = set(np.linspace(0, count - 1, min(count, ALWAYS_SEEDED)).astype(int).tolist())
        for index in range(count):
            supported = [i for i, h in enumerate(self.hypotheses) if self._explains(h, index)]
            if not supported or index in always:
                self._seed(index)
            for i in supported:
                self.hypotheses[i] = self._update(self.hypotheses[i], index)
        return sorted((self._rescore(h) for h in self.hypotheses), key=lambda h: -h.score)

    def _explains(self, hypothesis: Hypothesis, index: int) -> bool:
        explained, projected = self._counts(hypothesis.platform_from_camera, np.array([index]))[0]
        return bool(projected > MIN_FOOT and explained > MIN_FRACTION * projected)

    def _counts(self, pose: Pose3, which: NDArray[np.int64] | None = None) -> Array:
        return support(self._frames, self._camera, pose, self._tolerance, which)

    def _seed(self, index: int) -> None:
        """The best of many random hypotheses of this image; its own best are ranked on images over the whole drive."""
        candidates = seed(self._frames, index, self._camera, self._vertical[0], self._rng, self._iterations)
        poses = [Similarity(s, a, np.array([x, y])).platform_from_camera(self._rotation) for s, a, x, y in candidates]
        own = np.array([score(self._counts(pose, np.array([index]))) for pose in poses])
        probes = np.unique(np.append(np.linspace(0, len(self._frames) - 1, PROBES).astype(np.int64), index))
        best: tuple[float, Pose3] | None = None
        for pose in (poses[i] for i in np.argsort(-own, kind="stable")[:SHORT_LIST]):
            value = score(self._counts(pose, probes))
            if best is None or value > best[0]:
                best = (value, pose)
        if best is not None:
            self.hypotheses.append(self._update(Hypothesis(best[1], np.array([index]), best[0]), index))

    def _update(self, hypothesis: Hypothesis, index: int) -> Hypothesis:
        """Optimise on the consensus set, then find the consensus set anew among the images so far."""
        consensus = np.union1d(hypothesis.consensus, [index])
        refined = refine(
            self._frames,
            self._camera,
            hypothesis.platform_from_camera,
            self._vertical,
            (2 * self._tolerance, self._tolerance, self._tolerance),
            SIMILARITY,
            consensus,
        )
        pose = hypothesis.platform_from_camera if refined is None else refined.platform_from_camera
        counts = self._counts(pose, np.arange(index + 1))
        fraction = counts[:, 0] / np.maximum(counts[:, 1], MIN_FOOT)
        return Hypothesis(pose, np.union1d(np.flatnonzero(fraction > MIN_FRACTION), [index]), hypothesis.score)

    def _rescore(self, hypothesis: Hypothesis) -> Hypothesis:
        counts = self._counts(hypothesis.platform_from_camera)
        fraction = counts[:, 0] / np.maximum(counts[:, 1], MIN_FOOT)
        consensus = np.flatnonzero(fraction > MIN_FRACTION)
        return Hypothesis(hypothesis.platform_from_camera, consensus, score(counts))
