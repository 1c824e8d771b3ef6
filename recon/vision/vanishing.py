"""Three orthogonal vanishing points of one image, with known intrinsics (paper, section 2.2)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array, cross
from recon.vision.frame import OUTLIER, VERTICAL
from recon.vision.jlinkage import draw_pairs, j_linkage
from recon.vision.planes import Planes, refine_direction, tukey

CONSISTENT = 3.0  # standard deviations at which a line no longer points to a vanishing point
MAX_LINES = 200  # the longest ones take part in J-linkage
HYPOTHESES = 400
MIN_CLUSTER = 3
MAX_CLUSTERS = 10
MIN_LINES = 3  # of a direction, to be called found; one is enough for the horizontal that another fixes
# A camera on a platform looks 0 to 45 degrees down and is rolled by up to 10; some room on every side.
TILT_RANGE = (np.deg2rad(-12.0), np.deg2rad(57.0))
MAX_ROLL = np.deg2rad(20.0)
DISTINCT = 1.5  # times the agreement of clutter, for a vertical that is seen
DISTINCT_INFERRED = 3.0  # for each of two horizontals that tell where the vertical is
MAX_SKEW = np.sin(np.deg2rad(6.0))  # between two clusters that may be taken for orthogonal
VOTE_BIN = np.deg2rad(1.0)
NONE = np.full((3, 3), np.nan)


def downward(directions: Array) -> Array:
    """Unit vectors (..., 3), each turned so that it points down the image (y >= 0)."""
    return np.asarray(np.where(directions[..., 1:2] < 0, -directions, directions))


def is_plausible_vertical(directions: Array) -> NDArray[np.bool_]:
    """Which of (..., 3) unit vectors may point to the floor, for a camera that is tilted and rolled within reason."""
    tilt = np.arcsin(np.clip(directions[..., 2], -1, 1))
    roll = np.arctan2(directions[..., 0], directions[..., 1])
    return np.asarray((tilt >= TILT_RANGE[0]) & (tilt <= TILT_RANGE[1]) & (np.abs(roll) <= MAX_ROLL))


def find_clusters(planes: Planes, rng: np.random.Generator) -> Array:
    """Directions (k, 3) of the vanishing points that J-linkage finds, refined on their clusters, largest first."""
    planes = planes[np.arange(min(len(planes), MAX_LINES))]
    if len(planes) < MIN_CLUSTER:
        return np.zeros((0, 3))
    pairs = draw_pairs(planes.weights, HYPOTHESES, rng)
    hypotheses = cross(planes.normals[pairs[:, 0]], planes.normals[pairs[:, 1]])
    length = np.linalg.norm(hypotheses, axis=1)
    scale = np.linalg.norm(planes.normals, axis=1)
    proper = length > 1e-6 * scale[pairs].prod(axis=1)  # else both lie on one line
    hypotheses = hypotheses[proper] / length[proper, None]
    clusters = j_linkage(np.abs(planes.residuals(hypotheses)) < CONSISTENT)
    found = []
    for k in range(min(MAX_CLUSTERS, int(clusters.max()) + 1)):
        members = planes[clusters == k]
        if len(members) < MIN_CLUSTER:
            break
        rows = members.normals / (members.sigmas * np.linalg.norm(members.across, axis=(1, 2)))[:, None]
        found.append(refine_direction(members, np.linalg.eigh(rows.T @ rows)[1][:, 0], iterations=3))
    return np.array(found).reshape(-1, 3)


def frame_of(vertical: Array, horizontal: Array) -> Array:
    """(3, 3) rows: the vertical (kept), the horizontal nearest to `horizontal` that looks ahead, and the one to its
    right. Of the two horizontals the first is the one nearer to the optical axis."""
    first = horizontal - (horizontal @ vertical) * vertical
    first /= np.linalg.norm(first)
    second = cross(vertical, first)
    if abs(second[2]) > abs(first[2]):
        first, second = second, -first
    if first[2] < 0:
        first, second = -first, -second
    return np.stack([vertical, first, second])


def support(planes: Planes, frames: Array) -> Array:
    """(F,) how much line length agrees with the nearest axis of each of frames (F, 3, 3)."""
    n = len(frames)
    best = np.abs(planes.residuals(frames.reshape(-1, 3)).reshape(len(planes), n, 3)).min(axis=2)
    return np.asarray(planes.weights @ np.maximum(0.0, 1.0 - (best / CONSISTENT) ** 2))


def horizontal_votes(planes: Planes, vertical: Array, count: int = 3, period: float = np.pi / 2) -> Array:
    """(<= count, 3) horizontal directions that most line length votes for; directions `period` (rad) apart count as
    one: two orthogonal ones by default, with pi each one for itself.

    With the vertical known every line that is not vertical itself meets the horizon at one angle.
    """
    basis = frame_of(vertical, np.array([0.0, 0.0, 1.0]) if abs(vertical[2]) < 0.9 else np.array([0.0, 1.0, 0.0]))
    planes = planes[np.abs(planes.residuals(vertical[None])[:, 0]) > CONSISTENT]
    meets = cross(planes.normals, vertical)
    meets /= np.maximum(np.linalg.norm(meets, axis=1), 1e-12)[:, None]
    angle = np.arctan2(meets @ basis[2], meets @ basis[1]) % period
    turned = cross(vertical, meets)  # how the meeting point moves along the horizon, per radian
    spread = np.linalg.norm(np.einsum("ikj,ij->ik", planes.across, meets), axis=1)
    slope = np.abs(np.einsum("ij,ij->i", planes.normals, turned)) / (planes.sigmas * np.maximum(spread, 1e-12))
    weight = np.where(slope * np.deg2rad(3.0) > 1, planes.weights, 0.0)  # the angle is known to 3 degrees
    bins = round(period / VOTE_BIN)
    votes = np.bincount((angle / period * bins).astype(int) % bins, weight, bins)
    votes = votes + 0.5 * (np.roll(votes, 1) + np.roll(votes, -1))
    peaks = np.flatnonzero((votes > np.roll(votes, 1)) & (votes >= np.roll(votes, -1)))
    peaks = peaks[np.argsort(-votes[peaks], kind="stable")][:count]
    best = (peaks + 0.5) * period / bins
    return np.asarray(np.cos(best)[:, None] * basis[1] + np.sin(best)[:, None] * basis[2])


def linearise(planes: Planes, frame: Array, scale: float) -> tuple[Array, Array, Array]:
    """Jacobian (N, 3) to a small rotation, residuals (N,) and Tukey weights (N,) of all lines to their nearest axis."""
    every = planes.residuals(frame)
    nearest = np.argmin(np.abs(every), axis=1)
    error = np.take_along_axis(every, nearest[:, None], axis=1)[:, 0]
    jacobian = np.zeros((len(planes), 3))
    for axis in range(3):
        mine = nearest == axis
        jacobian[mine] = cross(frame[axis], planes[mine].scaled_normals(frame[axis]))
    return jacobian, error, tukey(error, scale)


def refine_frame(planes: Planes, frame: Array, fixed_vertical: bool = False, iterations: int = 6) -> Array:
    """The orthonormal rows near `frame` (3, 3) that minimise the Tukey loss of all lines to their nearest axis.

    Gauss-Newton on the rotation; with `fixed_vertical` only the turn about the first row is free.
    """
    for k in range(iterations):
        jacobian, error, weight = linearise(planes, frame, 2.0 if k < 2 else 1.0)  # from a coarse start: first wide
        if fixed_vertical:
            jacobian = (jacobian @ frame[0])[:, None] * frame[0]
        normal = (jacobian * weight[:, None]).T @ jacobian
        turn = -np.linalg.lstsq(normal, jacobian.T @ (weight * error), rcond=1e-10)[0]
        frame = _orthonormal(frame + cross(turn, frame))
    return frame


def frame_near(planes: Planes, vertical: Array, fixed_vertical: bool) -> Array:
    """(3, 3) the refined frame whose vertical is (or, not fixed, starts from) `vertical` (3,), with the horizontals
    that most line length votes for."""
    votes = horizontal_votes(planes, vertical)
    if len(votes) == 0:
        return frame_of(vertical, cross(vertical, np.array([1.0, 0.0, 0.0])))
    frames = np.array([frame_of(vertical, h) for h in votes])
    best = refine_frame(planes, frames[int(np.argmax(support(planes, frames)))], fixed_vertical)
    return frame_of(best[0], best[1])


def _orthonormal(frame: Array) -> Array:
    """The rows (3, 3) made orthonormal, the first kept in direction, the third completing a right-handed set."""
    first = frame[0] / np.linalg.norm(frame[0])
    second = frame[1] - (frame[1] @ first) * first
    second /= np.linalg.norm(second)
    return np.stack([first, second, cross(first, second)])


def assign(planes: Planes, directions: Array) -> NDArray[np.int64]:
    """(N,) the row of `directions` (3, 3) whose vanishing point each line points to, or OUTLIER; nan rows get none."""
    if len(planes) == 0:
        return np.zeros(0, np.int64)
    residual = np.abs(planes.residuals(np.nan_to_num(directions)))
    residual[:, ~np.isfinite(directions).all(axis=1)] = np.inf
    nearest = np.argmin(residual, axis=1)
    return np.where(residual.min(axis=1) < CONSISTENT, nearest, OUTLIER)


def find_directions(planes: Planes, seed: int) -> Array:
    """(3, 3) unit rows: the vertical vanishing point (pointing down) and two horizontal ones; nan where not found.

    J-linkage proposes; every plausible vertical is tried with the horizontals that the lines vote for, and every two
    orthogonal clusters whose third axis is a plausible vertical; the frame with most support wins and is refined.
    """
    clusters = find_clusters(planes, np.random.default_rng(seed))
    frames = []
    for vertical in downward(clusters):
        if is_plausible_vertical(vertical):
            votes = horizontal_votes(planes, vertical)
            frames += [frame_of(vertical, h) for h in (votes if len(votes) else [np.array([0.0, 0.0, 1.0])])]
    for i, a in enumerate(clusters):
        for b in clusters[i + 1 :]:
            vertical = downward(cross(a, b))
            if abs(a @ b) < MAX_SKEW and is_plausible_vertical(vertical / np.linalg.norm(vertical)):
                frames.append(frame_of(vertical / np.linalg.norm(vertical), a))
    if not frames:
        return NONE.copy()
    best = frames[int(np.argmax(support(planes, np.array(frames))))]
    refined = refine_frame(planes, best)
    return keep_found(planes, frame_of(downward(refined[0]), refined[1]))


def _plausible_grid() -> Array:
    """(K, 3) directions spread over the plausible verticals."""
    tilt, roll = np.meshgrid(np.linspace(*TILT_RANGE, 10), np.linspace(-MAX_ROLL, MAX_ROLL, 6))
    t, r = tilt.ravel(), roll.ravel()
    return np.stack([np.sin(r) * np.cos(t), np.cos(r) * np.cos(t), np.sin(t)], axis=1)


_GRID = _plausible_grid()


def distinctness(planes: Planes, directions: Array) -> Array:
    """(M,) line length that agrees with each of directions (M, 3), in units of what clutter gives any direction: the
    agreement that nine in ten plausible verticals stay below."""
    chance = np.quantile(_agreement(planes, _GRID), 0.9)
    return np.asarray(_agreement(planes, directions) / max(float(chance), 1e-9))


def _agreement(planes: Planes, directions: Array) -> Array:
    """(M,) line length that points to each of directions (M, 3)."""
    return np.asarray(planes.weights @ np.maximum(0.0, 1.0 - (planes.residuals(directions) / CONSISTENT) ** 2))


def keep_found(planes: Planes, frame: Array, vertical_known: bool = False) -> Array:
    """`frame` (3, 3) with nan rows for the directions that too few lines point to."""
    labels = assign(planes, frame)
    counts = np.bincount(labels[labels >= 0], minlength=3)
    found = counts >= MIN_LINES
    if vertical_known:
        found[VERTICAL] = True
    else:
        clear = distinctness(planes, frame)
        inferred = found[1:].all() and (clear[1:] > DISTINCT_INFERRED).all()
        seen = found[VERTICAL] and clear[VERTICAL] > DISTINCT
        found[VERTICAL] = (seen or inferred) and bool(is_plausible_vertical(frame[0]))
    found[1:] |= found[1:].any() & (counts[1:] > 0)
    if not found[VERTICAL]:
        found[:] = False
    return np.where(found[:, None], frame, np.nan)
