"""Images where the scans are blind: along a bare corridor they alone tell how far the platform moved."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from recon.calibration.frames import segments_at
from recon.calibration.result import Calibration
from recon.geometry import Array, between2, compose2, rotation2, turned2, wrap_angle
from recon.graph.motion import STRAY
from recon.graph.patches import Guess, likely_way
from recon.graph.slide import Slide, Step, estimate_slide, on_surfaces, project
from recon.lidar.matching import ScanMatching
from recon.lidar.segment import Segments
from recon.sequence.camera import Camera
from recon.sequence.images import load_image
from recon.sequence.sequence import Sequence as Drive
from recon.sequence.trajectory import Trajectory
from recon.vision.tracks import find_corners, follow

BLIND = 0.02
"""m: standard deviation of a scan match along a direction from which images are asked."""
SIGHTED = 0.02
"""m: and across it, up to which the scans tell the rest."""
LONGEST = 1.5
"""s between images beyond which corners are not followed."""
ACCELERATION = 0.5
"""m/s^2: how a speed that images tell changes until another is told."""
GUESSED = 0.9
"""Part of what a platform may stray by from which a deviation says that nothing told the motion."""
GAP = 5.0
"""s after which it says nothing any more."""
PATCHES = 80
"""Corners, strong and weak ones, whose patches say roughly how far it was."""

Load = Callable[[int], NDArray[np.uint8] | None]


@dataclass(frozen=True)
class Seen:
    """What a pair of neighbouring images says. start, end: s. direction: (2,) unit, map frame; way: m along it from
    start to end. variance: m^2, of chance. change: (6,) as in Slide."""

    start: float
    end: float
    direction: Array
    way: float
    variance: float
    change: Array

    @property
    def speed(self) -> float:
        """m/s along the direction."""
        return self.way / (self.end - self.start)


@dataclass(frozen=True)
class Way:
    """length: m along direction (2,), unit, map frame; variance: m^2."""

    length: float
    variance: float
    direction: Array


@dataclass(frozen=True)
class Eye:
    """Images and where they look from. times: (F,) s, on the scanner's clock. load(i): image i, grey (H, W) or None."""

    times: Array
    load: Load
    camera: Camera
    calibration: Calibration

    @staticmethod
    def of(sequence: Drive, calibration: Calibration) -> Eye | None:
        """Of a sequence; None where it has no images."""
        camera, images = sequence.camera, sequence.images
        if camera is None or images is None:
            return None

        def load(index: int) -> NDArray[np.uint8] | None:
            return load_image(images, index, camera, grey=True, warnings=[])  # said when lines were found

        return Eye(calibration.on_scan_clock(images.timestamps), load, camera, calibration)


def see_along(matching: ScanMatching, segments: Sequence[Segments], eye: Eye | None) -> tuple[ScanMatching, int]:
    """The scan matching with blind motions filled in from images, and how many pairs of images did so.

    A motion is blind where its scan match is vague along one direction and sure across it. Motions and covariances are
    fused (Kalman), and the trajectory is chained anew. Where images see nothing (eye None: there are none) the
    prediction stays, and is held to what platforms can do.
    """
    blind = blind_steps(matching)
    if not blind.any():
        return matching, 0
    seen = [] if eye is None else list(_look(matching, segments, eye, blind))
    speeds = Speeds.of(seen, np.zeros((6, 6)) if eye is None else eye.calibration.covariance)
    poses, stamps = matching.trajectory.poses, matching.trajectory.timestamps
    relative = between2(poses[:-1], poses[1:])
    fused, alone = matching.covariances.copy(), matching.scan_covariances.copy()
    told = {int(k): speeds.rest(int(k), matching, blind) for k in np.flatnonzero(blind)}
    for k, way in told.items():
        if way is None:
            continue
        axis = np.append(rotation2(-float(poses[k, 2])) @ way.direction, 0.0)
        pull = alone[k] @ axis
        relative[k] += pull / (axis @ pull + way.variance) * (way.length - axis @ relative[k])
        for covariance in (fused[k], alone[k]):
            pull = covariance @ axis
            covariance -= np.outer(pull, pull) / (axis @ pull + way.variance)
    if matching.odometry is None:
        held = np.eye(3) / (STRAY * np.diff(stamps))[:, None, None] ** 2
        lost = np.linalg.eigvalsh(alone[:, :2, :2])[:, 1] > BLIND**2
        alone[lost] = np.linalg.inv(np.linalg.inv(alone[lost]) + held[lost])
    trajectory = Trajectory(stamps, _chained(poses[0], relative))
    return replace(matching, trajectory=trajectory, covariances=fused, scan_covariances=alone), len(seen)


def blind_steps(matching: ScanMatching) -> NDArray[np.bool_]:
    """(N-1,) motions between scans that the scans do not tell along exactly one direction."""
    spread = np.sqrt(np.linalg.eigvalsh(matching.scan_covariances[:, :2, :2]))
    return np.asarray((spread[:, 1] > BLIND) & (spread[:, 0] < SIGHTED))


def guessed_steps(matching: ScanMatching) -> NDArray[np.bool_]:
    """(N-1,) motions between scans that are predictions along some direction: neither scans nor images tell them."""
    spread = np.sqrt(np.linalg.eigvalsh(matching.scan_covariances[:, :2, :2])[:, 1])
    return np.asarray(spread > GUESSED * STRAY * np.diff(matching.trajectory.timestamps))


def unplaced_scans(matching: ScanMatching) -> NDArray[np.bool_]:
    """(N,) scans beside or between motions that nothing tells, at most GAP apart: all along a bare corridor they look
    the same, so that no place is known again by them."""
    stamps, guessed = matching.trajectory.timestamps, np.flatnonzero(guessed_steps(matching))
    if not len(guessed):
        return np.zeros(len(stamps), np.bool_)
    out = np.isin(np.arange(len(stamps)), np.concatenate([guessed, guessed + 1]))
    after = np.searchsorted(guessed, np.arange(len(stamps)))
    before, after = guessed[np.maximum(after - 1, 0)], guessed[np.minimum(after, len(guessed) - 1)]
    return np.asarray(
        out | ((stamps[before] <= stamps) & (stamps <= stamps[after]) & (stamps[after] - stamps[before] < GAP))
    )


def _look(matching: ScanMatching, segments: Sequence[Segments], eye: Eye, blind: NDArray[np.bool_]) -> Iterator[Seen]:
    """What pairs of images say that were taken while the scans were blind."""
    stamps, poses = matching.trajectory.timestamps, matching.trajectory.at(eye.times)
    walls, vague = segments_at(eye.times, matching.trajectory, segments), _in_map(matching)
    images = _Pairs(eye.load)
    known: Seen | None = None
    for i in range(len(eye.times) - 1):
        start, end = float(eye.times[i]), float(eye.times[i + 1])
        during = np.flatnonzero(blind & (stamps[1:] > start) & (stamps[:-1] < end))
        if not len(during) or end - start > LONGEST or len(walls[i]) == 0:
            continue
        first, second = images.pair(i)
        if first is None or second is None:
            continue
        axis = np.linalg.eigh(vague[during].sum(axis=0))[1][:, 1]
        yaw = float(poses[i, 2])
        ahead = axis if axis @ [np.cos(yaw), np.sin(yaw)] >= 0 else -axis
        step = _step(between2(poses[i], poses[i + 1]), rotation2(-yaw) @ ahead)
        guess = (
            None if known is None else Guess(known.speed * float(np.sign(known.direction @ ahead)), start - known.end)
        )
        slide = _slide(first, second, step, end - start, guess, walls[i], eye)
        if slide is not None:
            known = Seen(start, end, ahead, slide.way, slide.sigma**2, slide.change)
            yield known


class _Pairs:
    """Neighbouring images, each loaded once."""

    def __init__(self, load: Load) -> None:
        self._load, self._next = load, -1
        self._image: NDArray[np.uint8] | None = None

    def pair(self, index: int) -> tuple[NDArray[np.uint8] | None, NDArray[np.uint8] | None]:
        """Images `index` and `index` + 1."""
        first = self._image if index == self._next else self._load(index)
        self._image, self._next = self._load(index + 1), index + 1
        return first, self._image


def _in_map(matching: ScanMatching) -> Array:
    """(N-1, 2, 2) m^2: covariances of the scan matches' positions, map frame."""
    return turned2(matching.scan_covariances[:, :2, :2], matching.trajectory.poses[:-1, 2])


def _step(relative: Array, direction: Array) -> Step:
    across = float(direction[0] * relative[1] - direction[1] * relative[0])
    return Step(direction, float(wrap_angle(relative[2])), across)


def _slide(
    first: NDArray[np.uint8],
    second: NDArray[np.uint8],
    step: Step,
    seconds: float,
    guess: Guess | None,
    walls: Array,
    eye: Eye,
) -> Slide | None:
    """The way between two images: from patches roughly, from corners followed exactly."""
    pose, camera = eye.calibration.platform_from_camera, eye.camera
    corners = find_corners(first)
    rays = np.concatenate([camera.undistort(corners), np.ones((len(corners), 1))], axis=1)
    points = on_surfaces(rays, pose, walls)
    known = np.isfinite(points[:, 0])
    corners, rays, points = corners[known], rays[known], points[known]
    way = likely_way(first, second, corners[:: len(corners) // PATCHES + 1], step, seconds, guess, pose, camera, walls)
    if way is None:
        return None
    predicted = project(points, step.relative(np.array([way, 0.0, 0.0])), pose, camera)
    ahead = np.isfinite(predicted[:, 0])
    seen, followed = follow(first, second, corners, np.where(ahead[:, None], predicted, corners))
    use = followed & ahead
    return estimate_slide(rays[use], seen[use], step, way, pose, camera, walls)


@dataclass(frozen=True)
class Speeds:
    """Speeds along a direction that pairs of images tell, in order of time. systematic: m^2 a metre, what an error of
    the camera's pose adds, which is the same in all pairs: motions are taken for independent, so it is spread as a
    walk that is as wide after the whole way as the error is."""

    seen: list[Seen]
    systematic: float

    @staticmethod
    def of(seen: list[Seen], covariance: Array) -> Speeds:
        """covariance: (6, 6) of the camera's pose."""
        change = np.sum([s.change for s in seen], axis=0) if seen else np.zeros(6)
        return Speeds(seen, float(change @ covariance @ change) / max(sum(abs(s.way) for s in seen), 1e-6))

    def rest(self, k: int, matching: ScanMatching, blind: NDArray[np.bool_]) -> Way | None:
        """The way of the blind motion k, to the next scan: its part of what scans leave of the pair of images around
        it, where they tell the rest of that; else as the speed says. None where no image is near.

        A speed is the mean over a pair: a platform that speeds up is elsewhere by centimetres at one scan of it.
        """
        stamps = matching.trajectory.timestamps
        start, end = float(stamps[k]), float(stamps[k + 1])
        pair = next((s for s in self.seen if s.start <= (start + end) / 2 <= s.end), None)
        if pair is None:
            return self.between(start, end)
        first, last = np.searchsorted(stamps, [pair.start, pair.end])
        steps = np.arange(max(int(first) - 1, 0), min(int(last), len(blind)))
        shared = np.minimum(stamps[steps + 1], pair.end) - np.maximum(stamps[steps], pair.start)
        told = ~blind[steps]
        unknown = (pair.end - pair.start) - float(shared[told].sum())
        if not told.any() or unknown < (end - start) / 2:
            return self.between(start, end)
        poses = matching.trajectory.poses
        parts = shared / np.diff(stamps)[steps]
        ways = (poses[steps + 1, :2] - poses[steps, :2]) @ pair.direction * parts
        spread = np.einsum("i,kij,j->k", pair.direction, _in_map(matching)[steps], pair.direction) * parts**2
        share = (end - start) / unknown
        variance = pair.variance + self.systematic * abs(pair.way) + float(spread[told].sum())
        return Way((pair.way - float(ways[told].sum())) * share, variance * share, pair.direction)

    def between(self, start: float, end: float) -> Way | None:
        """The way between two times, s; None where no image is near."""
        if not self.seen:
            return None
        middle, span = (start + end) / 2, end - start
        gaps = [max(s.start - middle, middle - s.end, 0.0) for s in self.seen]
        nearest = self.seen[int(np.argmin(gaps))]
        gap = min(gaps)
        if gap > GAP:
            return None
        some = [s for s in self.seen if abs((s.start + s.end) / 2 - middle) < 2 * GAP]
        rates = [s.speed * np.sign(s.direction @ nearest.direction) for s in some]
        way = float(np.interp(middle, [(s.start + s.end) / 2 for s in some], rates)) * span
        variance = nearest.variance * span / (nearest.end - nearest.start) + (ACCELERATION * gap) ** 2 * span * (
            span + 2 * gap
        )
        return Way(way, variance + self.systematic * abs(way), nearest.direction)


def _chained(first: Array, relative: Array) -> Array:
    """(N, 3) poses from the first one and the motions (N-1, 3) that follow."""
    poses = [first]
    for motion in relative:
        poses.append(compose2(poses[-1], motion))
    return np.array(poses)
