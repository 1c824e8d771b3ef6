"""The vertical of a whole drive: the camera is rigidly mounted, so it is the same direction in every image."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array
from recon.sequence.camera import Camera
from recon.vision.frame import VERTICAL, FrameLines
from recon.vision.jlinkage import draw_pairs
from recon.vision.planes import Planes, join, planes_of, refine_direction, tukey
from recon.vision.vanishing import CONSISTENT, downward, is_plausible_vertical

CONSENSUS_FRAMES = 150  # spread over the drive; all frames take part in the fit
PAIRS_PER_FRAME = 6
MAX_HYPOTHESES = 400
MIN_INLIERS = 3
SEED = 0
WINDOW = np.deg2rad(6.0)
SWAYS = np.deg2rad([0.01, 0.03, 0.06, 0.1, 0.15, 0.2, 0.3, 0.4, 0.55, 0.75, 1.0])
NOT_FOUND = (np.full(3, np.nan), float("inf"), 0)


def vertical_direction(frames: Sequence[FrameLines], camera: Camera) -> tuple[Array, float, int]:
    """The direction (3,) down to the floor in the camera optical frame, its standard deviation (rad), and the number
    of lines that agree.

    A consensus over the frames (every frame has about one vote, however many lines it has) chooses among the frames'
    own verticals and intersections of random pairs of lines; one joint robust fit over all lines of all frames refines
    it. The standard deviation allows for errors that the lines of one frame have in common. Without any plausible
    vertical: (nan, inf, 0).
    """
    used = [i for i, f in enumerate(frames) if len(f)]
    if not used:
        return NOT_FOUND
    every = [planes_of(frames[i].endpoints, frames[i].sigmas, camera) for i in used]
    chosen = np.unique(np.linspace(0, len(used) - 1, min(len(used), CONSENSUS_FRAMES)).round().astype(int))
    hypotheses = _hypotheses([every[k] for k in chosen], np.array([frames[used[k]].directions[0] for k in chosen]))
    if len(hypotheses) == 0:
        return NOT_FOUND
    votes = sum(np.sqrt(_agreement(every[k], hypotheses)) for k in chosen)
    direction = hypotheses[int(np.argmax(votes))]
    direction = refine_direction(join(every), direction, 2.0)
    owner = np.repeat(np.arange(len(every)), [len(p) for p in every])
    fit = _JointFit(join(every), owner)
    direction, sigma, inliers = fit.solve(direction)
    direction = downward(direction)
    if inliers < MIN_INLIERS or not is_plausible_vertical(direction):
        return NOT_FOUND
    return direction, sigma, inliers


def average_vertical(frames: Sequence[FrameLines]) -> Array:
    """The average (3,) of the frames' verticals, weighted by their number of vertical lines (paper, section 2.4).

    Robust: a frame off by more than a degree from the rest counts for less (Huber). nan if no frame has a vertical.
    """
    found = np.array([f.directions[0] for f in frames if np.isfinite(f.directions[0]).all()]).reshape(-1, 3)
    counts = [np.count_nonzero(f.labels == VERTICAL) for f in frames if np.isfinite(f.directions[0]).all()]
    weights = np.array(counts, dtype=np.float64)
    if weights.sum() == 0:
        return np.full(3, np.nan)
    mean = np.median(np.repeat(found, np.array(counts), axis=0), axis=0)
    for _ in range(20):
        mean = mean / np.linalg.norm(mean)
        angle = np.linalg.norm(np.cross(found, mean), axis=1)
        huber = np.minimum(1.0, np.deg2rad(1.0) / np.maximum(angle, 1e-9))
        mean = (weights * huber) @ found
    return np.asarray(mean / np.linalg.norm(mean))


def _hypotheses(every: list[Planes], verticals: Array) -> Array:
    """Plausible directions (M, 3): the frames' own and those of random pairs of lines of one frame."""
    rng = np.random.default_rng(SEED)
    parts = [verticals[np.isfinite(verticals).all(axis=1)]]
    for planes in every:
        if len(planes) < 2:
            continue
        pairs = draw_pairs(planes.weights, 8 * PAIRS_PER_FRAME, rng)
        cross = np.cross(planes.normals[pairs[:, 0]], planes.normals[pairs[:, 1]])
        length = np.linalg.norm(cross, axis=1)
        cross = downward(cross[length > 0] / length[length > 0, None])
        parts.append(cross[is_plausible_vertical(cross)][:PAIRS_PER_FRAME])
    found = np.concatenate(parts)
    return found[np.unique(np.linspace(0, len(found) - 1, min(len(found), MAX_HYPOTHESES)).round().astype(int))]


def _agreement(planes: Planes, directions: Array) -> Array:
    """(M,) px of line that points to each of directions (M, 3)."""
    misfit = np.maximum(0.0, 1.0 - (planes.residuals(directions) / CONSISTENT) ** 2)
    return np.asarray(planes.weights @ misfit)


class _JointFit:
    """Lines of many frames against one direction, when the frames themselves sway a little.

    A platform nods, a rolling shutter leans, and what a frame's lines have in common does not average out within it.
    Each line's angle to the direction has its own variance m^2 and its frame's j^2, shared by the n lines of the frame
    that agree: they carry the information n / (m^2 + n j^2). How large j is comes from the lines (maximum likelihood).
    """

    def __init__(self, planes: Planes, owner: NDArray[np.int64]) -> None:
        size = np.linalg.norm(planes.normals, axis=1)
        self.planes, self.owner, self.size = planes, owner, size
        self.units = planes.normals / size[:, None]

    def measured(self, direction: Array) -> Array:
        """(N,) standard deviations m, rad."""
        spread = np.linalg.norm(self.planes.across @ direction, axis=1)
        return np.asarray(self.planes.sigmas * spread / self.size)

    def sway(self, direction: Array) -> float:
        """The most likely j, rad: angles in a window are a Gaussian of the verticals and an even floor of clutter."""
        angle, variance = self.units @ direction, self.measured(direction) ** 2
        inside = np.abs(angle) < WINDOW
        square, variance = angle[inside] ** 2, variance[inside]
        best, sway = -np.inf, SWAYS[0]
        for j in SWAYS:
            total = variance + j * j
            peak = np.exp(-0.5 * square / total) / np.sqrt(2 * np.pi * total)
            share = 0.5
            for _ in range(10):
                share = float(np.mean(share * peak / (share * peak + (1 - share) / (2 * WINDOW))))
            likelihood = float(np.log(share * peak + (1 - share) / (2 * WINDOW)).sum())
            if likelihood > best:
                best, sway = likelihood, j
        return sway

    def solve(self, direction: Array) -> tuple[Array, float, int]:
        """Direction (3,), standard deviation along its worst axis (rad), number of lines that agree."""
        for _ in range(4):
            j = self.sway(direction)
            for _ in range(4):
                weight, _ = self._weights(direction, j)
                new = np.linalg.eigh((self.units * weight[:, None]).T @ self.units)[1][:, 0]
                direction = new if new @ direction > 0 else -new
        weight, agree = self._weights(direction, j)
        return direction, self._deviation(direction, weight), int(np.count_nonzero(agree))

    def _weights(self, direction: Array, sway: float) -> tuple[Array, NDArray[np.bool_]]:
        """(N,) weights, 1 / rad^2, and which lines agree."""
        m2, j2 = self.measured(direction) ** 2, sway * sway
        residual = (self.units @ direction) / np.sqrt(m2 + j2)
        robust = tukey(residual)
        together = np.bincount(self.owner, robust)[self.owner]
        return robust / (m2 + np.maximum(1.0, together) * j2), np.abs(residual) < CONSISTENT

    def _deviation(self, direction: Array, weight: Array) -> float:
        """The larger of the formal standard deviation and that from the scatter between frames (sandwich estimate with
        one cluster a frame), rad."""
        basis = np.linalg.svd(direction[None])[2][1:]
        jacobian, error = self.units @ basis.T, self.units @ direction
        information = (jacobian * weight[:, None]).T @ jacobian
        if not np.linalg.cond(information) < 1e12:
            return float("inf")
        formal = np.linalg.inv(information)
        gradient = np.zeros((int(self.owner.max()) + 1, 2))
        np.add.at(gradient, self.owner, jacobian * (weight * error)[:, None])
        scatter = formal @ (gradient.T @ gradient) @ formal
        return float(np.sqrt(max(np.linalg.eigvalsh(formal)[-1], np.linalg.eigvalsh(scatter)[-1])))
