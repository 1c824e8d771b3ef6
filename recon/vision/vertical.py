"""The vertical of a whole drive: the camera is rigidly mounted, so it is the same direction in every image."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array, cross
from recon.sequence.camera import Camera
from recon.vision.frame import VERTICAL, FrameLines
from recon.vision.jlinkage import draw_pairs
from recon.vision.planes import Planes, planes_of
from recon.vision.pooling import ask_frames, count_agreeing, pool, tangent_basis
from recon.vision.vanishing import (
    CONSISTENT,
    downward,
    frame_of,
    horizontal_votes,
    is_plausible_vertical,
    support,
)

CONSENSUS_FRAMES = 150  # spread over the drive
MAX_FRAMES = 250  # of the joint fit
ROUNDS = 2
PAIRS_PER_FRAME = 6
MAX_HYPOTHESES = 400
FINALISTS, FINAL_FRAMES, APART = 12, 40, np.deg2rad(1.0)
MIN_INLIERS = 3
SYSTEMATIC = 0.1  # px, of lens model and edges: no number of lines averages it out
SEED = 0
NOT_FOUND = (np.full(3, np.nan), float("inf"), 0)


def vertical_direction(frames: Sequence[FrameLines], camera: Camera) -> tuple[Array, float, int]:
    """The direction (3,) down to the floor in the camera optical frame, its standard deviation (rad), and the number
    of lines that agree.

    A consensus over the frames (every frame has about one vote, however many lines it has) chooses among the frames'
    own verticals and intersections of random pairs of lines. A joint robust fit refines it: every frame's lines, the
    vertical and the horizontal ones, inform on the one direction with a full covariance, and frames may sway about it.
    The standard deviation is that along the worst axis. Without any plausible vertical: (nan, inf, 0).
    """
    used = [i for i, f in enumerate(frames) if len(f)]
    if not used:
        return NOT_FOUND
    every = [planes_of(frames[i].endpoints, frames[i].sigmas, camera) for i in used]
    chosen = _spread(len(used), CONSENSUS_FRAMES)
    hypotheses = _hypotheses([every[k] for k in chosen], np.array([frames[used[k]].directions[0] for k in chosen]))
    if len(hypotheses) == 0:
        return NOT_FOUND
    direction = _consensus([every[k] for k in chosen], hypotheses)
    asked = [every[k] for k in _spread(len(every), MAX_FRAMES)]
    for _ in range(ROUNDS):
        opinions = ask_frames(asked, direction)
        if len(opinions.offsets) == 0:
            return NOT_FOUND
        offset, covariance = pool(opinions)
        direction = direction + offset @ tangent_basis(direction)
        direction /= np.linalg.norm(direction)
    inliers = count_agreeing(every, direction)
    if inliers < MIN_INLIERS or not is_plausible_vertical(direction):
        return NOT_FOUND
    systematic = SYSTEMATIC / camera.matrix[0, 0]
    return direction, float(np.hypot(np.sqrt(np.linalg.eigvalsh(covariance)[-1]), systematic)), inliers


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
        angle = np.linalg.norm(cross(found, mean), axis=1)
        huber = np.minimum(1.0, np.deg2rad(1.0) / np.maximum(angle, 1e-9))
        mean = (weights * huber) @ found
    return np.asarray(mean / np.linalg.norm(mean))


def _spread(count: int, most: int) -> NDArray[np.int64]:
    """At most `most` of `count` indices, evenly spread."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(np.int64))


def _hypotheses(every: list[Planes], verticals: Array) -> Array:
    """Plausible directions (M, 3): the frames' own and those of random pairs of lines of one frame."""
    rng = np.random.default_rng(SEED)
    parts = [verticals[np.isfinite(verticals).all(axis=1)]]
    for planes in every:
        if len(planes) < 2:
            continue
        pairs = draw_pairs(planes.weights, 8 * PAIRS_PER_FRAME, rng)
        meets = cross(planes.normals[pairs[:, 0]], planes.normals[pairs[:, 1]])
        length = np.linalg.norm(meets, axis=1)
        meets = downward(meets[length > 0] / length[length > 0, None])
        parts.append(meets[is_plausible_vertical(meets)][:PAIRS_PER_FRAME])
    found = np.concatenate(parts)
    return found[_spread(len(found), MAX_HYPOTHESES)]


def _consensus(every: list[Planes], hypotheses: Array) -> Array:
    """The direction (3,) of hypotheses (M, 3) that most frames support.

    First by the lines that point to it; the best of these, apart from each other, also by the horizontals that they
    would make of the other lines: a curtain or a plant has its own vanishing point, but no horizon.
    """
    votes = np.sum([np.sqrt(_agreement(planes, hypotheses)) for planes in every], axis=0)
    finalists: list[Array] = []
    for k in np.argsort(-votes, kind="stable"):
        if len(finalists) < FINALISTS and all(hypotheses[k] @ f < np.cos(APART) for f in finalists):
            finalists.append(hypotheses[k])
    scores = np.zeros(len(finalists))
    for planes in [every[k] for k in _spread(len(every), FINAL_FRAMES)]:
        for i, vertical in enumerate(finalists):
            own = _agreement(planes, vertical[None])[0]
            levels = [frame_of(vertical, h) for h in horizontal_votes(planes, vertical)]
            both = support(planes, np.array(levels)).max() if levels else own
            scores[i] += np.sqrt(own + both)
    return finalists[int(np.argmax(scores))]


def _agreement(planes: Planes, directions: Array) -> Array:
    """(M,) px of line that points to each of directions (M, 3)."""
    misfit = np.maximum(0.0, 1.0 - (planes.residuals(directions) / CONSISTENT) ** 2)
    return np.asarray(planes.weights @ misfit)
