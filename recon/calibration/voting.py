"""Exhaustive search for the camera's position once its rotation is known: a Hough transform over height and shift.

Lines parallel to walls (floor borders, carpet edges, baseboards) support poses that are shifted sideways, in height or
both; all share the right rotation. An image line of ground-map normal form paired with a LiDAR line gives one linear
equation in (height, x, y): n . (h R g + t) = c. Every pair votes for the positions that satisfy it.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from recon.calibration.support import CalibrationFrames, score, support
from recon.calibration.topdown import ground_from_camera, ground_map
from recon.geometry import Array, Pose3, rotation2, wrap_angle
from recon.sequence.camera import Camera

CELL = 0.02  # m, of height, x and y
HEIGHTS = (0.75, 1.35)  # of the hypothesis: votes crowd where the ground map is scaled down
SHIFT = 0.6  # m, in x and y, around the hypothesis
MAX_SINE = 0.06  # of the angle between paired lines
MAX_SIGMA = 0.06  # m at unit height a pixel may move a ground-map line
SLACK = 0.3  # m by which a line may overshoot its segment
PEAKS = 200
KEPT = 8  # of the peaks, by support
PROBES = 24  # images on which peaks are ranked
MAX_YAW = np.radians(6.0)  # by which a hypothesis' yaw may be off
YAW_BINS = 1440
YAW_PEAKS = 3
BLIND_HEIGHTS = (0.35, 0.6, 1.0, 1.7)  # m: HEIGHTS around them overlap
MAX_IMAGES = 40


@njit(cache=True)
def _vote(
    votes: NDArray[np.float32],
    ground: Array,
    normal: Array,
    offset: Array,
    extent: Array,
    weight: Array,
    heights: Array,
    shifts: Array,
) -> None:  # pragma: no cover - compiled
    """Add each pair's plane n . (h g + t) = c to votes (H, X, Y), where the line overlaps the segment."""
    cells = len(shifts)
    for p in range(len(ground)):
        nx, ny = normal[p]
        steep = abs(nx) < abs(ny)
        for i in range(len(heights)):
            gx, gy = heights[i] * ground[p, 0], heights[i] * ground[p, 1]
            rest = offset[p] - nx * gx - ny * gy
            for j in range(cells):
                other = (rest - nx * shifts[j]) / ny if steep else (rest - ny * shifts[j]) / nx
                tx, ty = (shifts[j], other) if steep else (other, shifts[j])
                along = ny * (gx + tx) - nx * (gy + ty)
                if along < extent[p, 0] or along > extent[p, 1]:
                    continue
                place = (other - shifts[0]) / CELL
                k = int(np.floor(place))
                if k < 0 or k + 1 >= cells:
                    continue
                high = np.float32(weight[p] * (place - k))
                low = np.float32(weight[p]) - high
                if steep:
                    votes[i, j, k] += low
                    votes[i, j, k + 1] += high
                else:
                    votes[i, k, j] += low
                    votes[i, k + 1, j] += high


def _pairs(
    frames: CalibrationFrames, index: int, camera: Camera, turn: Array, vertical: Array
) -> tuple[Array, Array, Array, Array, Array]:
    """Of one image: ground points (P, 2), wall normals (P, 2), offsets (P,), extents (P, 2) along, weights (P,)."""
    rows = slice(frames.line_offsets[index], frames.line_offsets[index + 1])
    ends = ground_map(frames.lines[rows], camera, vertical) @ turn.T
    pixels = np.linalg.norm(frames.lines[rows, 1] - frames.lines[rows, 0], axis=1)
    middle, way = ends.mean(axis=1), ends[:, 1] - ends[:, 0]
    with np.errstate(invalid="ignore"):
        way = way / np.linalg.norm(way, axis=1, keepdims=True)
        sharp = (1 + np.sum(middle**2, axis=1)) / camera.matrix[0, 0] < MAX_SIGMA
    walls = frames.segments[frames.segment_offsets[index] : frames.segment_offsets[index + 1]]
    along = walls[:, 1] - walls[:, 0]
    length = np.linalg.norm(along, axis=1)
    along = along / length[:, None]
    normal = np.stack([-along[:, 1], along[:, 0]], axis=1)
    sine = way[:, :1] * along[:, 1] - way[:, 1:] * along[:, 0]
    i, j = np.nonzero((np.abs(sine) < MAX_SINE) & sharp[:, None])
    start = np.sum(along * walls[:, 0], axis=1)
    extent = np.stack([start - SLACK, start + length + SLACK], axis=1)
    return middle[i], normal[j], np.sum(normal * walls[:, 0], axis=1)[j], extent[j], np.minimum(pixels[i], 150.0)


def yaw_density(frames: CalibrationFrames, camera: Camera, vertical: Array) -> Array:
    """(YAW_BINS,) how much line runs along LiDAR segments with the ground map turned by each yaw in [0, pi).

    A kernel density over the angles of all pairs of lines and segments of the same images.
    """
    from scipy.ndimage import gaussian_filter1d

    density = np.zeros(YAW_BINS)
    for index in range(len(frames)):
        rows = slice(frames.line_offsets[index], frames.line_offsets[index + 1])
        ends = ground_map(frames.lines[rows], camera, vertical)
        walls = frames.segments[frames.segment_offsets[index] : frames.segment_offsets[index + 1]]
        way, along = ends[:, 1] - ends[:, 0], walls[:, 1] - walls[:, 0]
        pixels = np.minimum(np.linalg.norm(frames.lines[rows, 1] - frames.lines[rows, 0], axis=1), 150.0)
        angle = np.arctan2(along[:, 1], along[:, 0]) - np.arctan2(way[:, 1], way[:, 0])[:, None]
        weight = pixels[:, None] * np.minimum(np.linalg.norm(along, axis=1), 3.0)
        finite = np.isfinite(angle)
        density += np.histogram(angle[finite] % np.pi, YAW_BINS, (0.0, np.pi), weights=weight[finite])[0]
    return np.asarray(gaussian_filter1d(density, 3.0, mode="wrap"))


def yaw_candidates(density: Array) -> Array:
    """Yaws (rad) of the highest peaks of the density, each in all four quadrants: lines run along walls and across."""
    from scipy.ndimage import maximum_filter1d

    folded = density[: YAW_BINS // 2] + density[YAW_BINS // 2 :]
    peaks = np.flatnonzero(folded == maximum_filter1d(folded, 41, mode="wrap"))
    peaks = peaks[np.argsort(-folded[peaks], kind="stable")][:YAW_PEAKS]
    yaws = (peaks + 0.5) * np.pi / YAW_BINS
    return wrap_angle(np.concatenate([yaws + k * np.pi / 2 for k in range(4)]))


def _aligned(yaw: float, density: Array) -> float:
    """The yaw of greatest density within MAX_YAW of the given one."""
    steps = np.arange(-int(MAX_YAW / np.pi * YAW_BINS), int(MAX_YAW / np.pi * YAW_BINS) + 1)
    start = int(np.floor((yaw % np.pi) / np.pi * YAW_BINS))
    best = start + steps[np.argmax(density[(start + steps) % YAW_BINS])]
    return yaw + (best + 0.5) * np.pi / YAW_BINS - yaw % np.pi


def blind_starts(vertical: Array, density: Array) -> list[Pose3]:
    """Poses to vote around when no hypothesis is to be trusted: every likely yaw, at the scanner, at some heights."""
    ground = ground_from_camera(vertical)
    starts = []
    for yaw in yaw_candidates(density):
        turn = np.eye(3)
        turn[:2, :2] = rotation2(float(yaw))
        starts += [Pose3(turn @ ground, np.array([0.0, 0.0, z])) for z in BLIND_HEIGHTS]
    return starts


def vote(
    frames: CalibrationFrames, camera: Camera, pose: Pose3, vertical: Array, density: Array, tolerance: float
) -> list[Pose3]:
    """Poses near `pose`, their yaw aligned and their tilt from `vertical`: peaks of the votes that lines support best.

    density: as `yaw_density` gives it. tolerance: pixels, as in `support`; cells are wider than it, so twice as much
    is allowed here.
    """
    ground = ground_from_camera(vertical)
    yaw = float(np.arctan2(*(pose.rotation @ ground.T)[[1, 0], 0]))
    yaw = _aligned(yaw, density)
    turn = np.eye(3)
    turn[:2, :2] = rotation2(yaw)
    peaks = _peaks(frames, camera, pose, turn[:2, :2], vertical)
    poses = [Pose3(turn @ ground, position) for position in peaks]
    probes = np.unique(np.linspace(0, len(frames) - 1, PROBES).astype(np.int64))
    values = [score(support(frames, camera, p, 2 * tolerance, probes)) for p in poses]
    return [poses[i] for i in np.argsort(values, kind="stable")[::-1][:KEPT]]


def _peaks(frames: CalibrationFrames, camera: Camera, pose: Pose3, turn: Array, vertical: Array) -> Array:
    """(P, 3) positions of the PEAKS highest maxima of the votes around the pose's position."""
    from scipy.ndimage import gaussian_filter, maximum_filter

    x, y, z = pose.translation
    heights = np.arange(HEIGHTS[0] * z, HEIGHTS[1] * z, CELL)
    shifts = np.arange(-SHIFT, SHIFT + CELL / 2, CELL)
    votes = np.zeros((len(heights), len(shifts), len(shifts)), np.float32)
    for index in np.unique(np.linspace(0, len(frames) - 1, MAX_IMAGES).astype(np.int64)):
        middle, normal, offset, extent, weight = _pairs(frames, int(index), camera, turn, vertical)
        offset = offset - normal @ [x, y]
        extent = extent - (normal @ [-y, x])[:, None]  # along = (ny, -nx)
        _vote(votes, middle, normal, offset, extent, weight, heights, shifts)
    smooth = gaussian_filter(votes, 1.0)
    peak = (smooth == maximum_filter(smooth, 3)) & (smooth > 0)
    cells = np.argwhere(peak)
    best = cells[np.argsort(-smooth[peak], kind="stable")[:PEAKS]]
    return np.array([[x + shifts[i], y + shifts[j], heights[h]] for h, i, j in best]).reshape(-1, 3)
