"""The vertical of a whole drive: the camera is rigidly mounted, so it is the same direction in every image."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

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
NOT_FOUND = (np.full(3, np.nan), float("inf"), 0)


def vertical_direction(frames: Sequence[FrameLines], camera: Camera) -> tuple[Array, float, int]:
    """The direction (3,) down to the floor in the camera optical frame, its standard deviation (rad), and the number
    of lines that agree.

    A consensus over the frames (every frame has about one vote, however many lines it has) chooses among the frames'
    own verticals and intersections of random pairs of lines; one joint robust fit over all lines of all frames, in
    three rounds of falling tolerance, refines it. The standard deviation allows for errors that the lines of one frame
    have in common. Without any plausible vertical: (nan, inf, 0).
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
    planes = join(every)
    for scale in (2.0, 1.0, 1.0):
        direction = refine_direction(planes, direction, scale)
    direction = downward(direction)
    inliers = int(np.count_nonzero(np.abs(planes.residuals(direction[None])) < CONSISTENT))
    if inliers < MIN_INLIERS or not is_plausible_vertical(direction):
        return NOT_FOUND
    owner = np.repeat(np.arange(len(every)), [len(p) for p in every])
    return direction, _deviation(planes, owner, direction), inliers


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


def _deviation(planes: Planes, owner: Array, direction: Array) -> float:
    """Standard deviation (rad) along the worst axis: the larger of the formal one and that from the scatter between
    frames (the sandwich estimate with one cluster a frame)."""
    rows = planes.scaled_normals(direction)
    basis = np.linalg.svd(direction[None])[2][1:]
    jacobian, error = rows @ basis.T, rows @ direction
    w = tukey(error)
    information = (jacobian * w[:, None]).T @ jacobian
    if np.linalg.cond(information) > 1e12:
        return float("inf")
    formal = np.linalg.inv(information) * max(1.0, float(w @ error**2 / w.sum()))
    gradient = np.zeros((int(owner.max()) + 1, 2))
    np.add.at(gradient, owner, jacobian * (w * error)[:, None])
    robust = np.linalg.inv(information) @ (gradient.T @ gradient) @ np.linalg.inv(information)
    return float(np.sqrt(max(np.linalg.eigvalsh(formal)[-1], np.linalg.eigvalsh(robust)[-1])))
