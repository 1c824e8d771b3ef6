"""Camera poses moved a little so that images agree on the faces: seams do not show where they do."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from recon.geometry import Array, Pose3
from recon.model import Face
from recon.sequence.camera import Camera
from recon.texture.canvas import Plane
from recon.texture.matches import Matches

LEAST_MOVE, LEAST_TURN = 0.002, np.deg2rad(0.05)
"""m, rad: added to the standard deviations of the poses given, for what those leave out: the platform rocks. No
more: what stands before the faces matches, too, and would pull poses away."""
NOISE, FULL_WEIGHT = 0.7, 60
"""Pixels, of one match; matches of a pair of images count as at most so many: their errors are not independent."""
ITERATIONS = 6


@dataclass(frozen=True)
class _Pair:
    """Matches as rays (m, 3) with z = 1 in the camera frames, and the planes (points and normals (m, 3)) they meet."""

    first: int
    second: int
    first_rays: Array
    second_rays: Array
    point: Array
    normal: Array


def align(
    poses: list[Pose3 | None], matches: list[Matches], faces: tuple[Face, ...], camera: Camera, sigmas: Array
) -> list[Pose3 | None]:
    """Poses under which matched pixels meet the same points of the faces.

    sigmas: (N, 2), one standard deviation of the poses given: of their places, m, and directions, rad. Gauss-Newton on
    small turns and moves of all cameras; Geman-McClure weights whose scale follows the residuals, since what is not on
    a face (clutter, reflections) matches too.
    """
    pairs = [_rays(m, faces, camera) for m in matches if len(m.face)]
    if not pairs:
        return poses
    used = sorted({i for pair in pairs for i in (pair.first, pair.second)})
    focal = float(np.sqrt(camera.matrix[0, 0] * camera.matrix[1, 1]))
    moved = np.zeros(6 * len(used))
    known = np.hypot(sigmas[used], [LEAST_MOVE, LEAST_TURN])
    prior = np.repeat(1 / known[:, ::-1] ** 2, 3, axis=1).ravel()
    current = list(poses)
    for _ in range(ITERATIONS):
        rows = [_linearise(pair, current, focal) for pair in pairs]
        step = _solve(pairs, rows, used, moved, prior)
        moved += step
        for k, image in enumerate(used):
            current[image] = _moved(current[image], step[6 * k : 6 * k + 6])
    return current


def _solve(pairs: list[_Pair], rows: list[tuple[Array, Array]], used: list[int], moved: Array, prior: Array) -> Array:
    """One weighted least-squares step (6 per used image); moved: the sum of the steps so far, held by the prior's
    information (6 per used image)."""
    from scipy import sparse
    from scipy.sparse.linalg import spsolve

    sizes = np.concatenate([np.linalg.norm(residual, axis=1) for residual, _ in rows])
    scale = 1.5 * max(NOISE, float(np.median(sizes)))
    right = -prior * moved
    column = {image: 6 * k + np.arange(6) for k, image in enumerate(used)}
    blocks, places = [], []
    for pair, (residual, jacobian) in zip(pairs, rows, strict=True):
        weight = 1 / (1 + (residual**2).sum(axis=1) / scale**2) ** 2 / NOISE**2
        weight *= min(1.0, FULL_WEIGHT / len(weight))
        place = np.concatenate([column[pair.first], column[pair.second]])
        right[place] -= np.einsum("m,mki,mk->i", weight, jacobian, residual)
        blocks.append(np.einsum("m,mki,mkj->ij", weight, jacobian, jacobian).ravel())
        places.append(np.stack(np.meshgrid(place, place, indexing="ij")).reshape(2, -1))
    n = len(right)
    normal = sparse.coo_matrix((np.concatenate(blocks), tuple(np.concatenate(places, axis=1))), shape=(n, n))
    return np.asarray(spsolve((normal + sparse.diags(prior)).tocsc(), right))


def _rays(matches: Matches, faces: tuple[Face, ...], camera: Camera) -> _Pair:
    found, index = np.unique(matches.face, return_inverse=True)
    planes = [Plane.of(faces[k]) for k in found]
    point = np.array([plane.origin for plane in planes])[index]
    normal = np.array([plane.normal for plane in planes])[index]
    ends = [
        np.column_stack([camera.undistort(p), np.ones(len(p))]) for p in (matches.first_pixels, matches.second_pixels)
    ]
    return _Pair(matches.first, matches.second, ends[0], ends[1], point, normal)


def _linearise(pair: _Pair, poses: list[Pose3 | None], focal: float) -> tuple[Array, Array]:
    """Residuals (m, 2), pixels, and their derivatives (m, 2, 12) by turn and move of the first and second camera.

    The second camera's ray meets the plane at X; the residual is where the first camera sees X less where it should.
    A pose moves as pose * exp(turn, move), in the camera frame.
    """
    a, b = poses[pair.first], poses[pair.second]
    if a is None or b is None:
        raise ValueError("matches of an image without a pose")
    ray = pair.second_rays @ b.rotation.T
    slope = np.einsum("mi,mi->m", pair.normal, ray)
    slope = np.where(np.abs(slope) < 1e-6, 1e-6, slope)
    depth = np.einsum("mi,mi->m", pair.normal, pair.point - b.translation) / slope
    local = a.inverse().apply(b.translation + depth[:, None] * ray)
    z = np.where(local[:, 2] > 0.05, local[:, 2], np.inf)[:, None]
    seen = local[:, :2] / z
    residual = focal * (seen - pair.first_rays[:, :2])
    # X slides along the plane when the second camera moves: (I - ray normal' / slope) (R move + depth R (turn x ray)).
    slide = np.eye(3) - ray[:, :, None] * pair.normal[:, None, :] / slope[:, None, None]
    turn = -depth[:, None, None] * (b.rotation @ _cross(pair.second_rays))
    by_second = np.concatenate([turn, np.broadcast_to(b.rotation, turn.shape)], axis=2)
    by_second = a.rotation.T @ (slide @ by_second)
    by_first = np.concatenate([_cross(local), np.broadcast_to(-np.eye(3), turn.shape)], axis=2)
    by_point = np.zeros((len(ray), 2, 3))
    by_point[:, 0, 0] = by_point[:, 1, 1] = (focal / z)[:, 0]
    by_point[:, :, 2] = -focal * seen / z
    return residual, by_point @ np.concatenate([by_first, by_second], axis=2)


def _cross(vectors: Array) -> Array:
    """Matrices (m, 3, 3) of v x."""
    out = np.zeros((len(vectors), 3, 3))
    x, y, z = vectors.T
    out[:, 0, 1], out[:, 0, 2], out[:, 1, 2] = -z, y, -x
    return out - out.transpose(0, 2, 1)


def _moved(pose: Pose3 | None, step: Array) -> Pose3 | None:
    if pose is None:
        return None
    turn = np.asarray(cv2.Rodrigues(step[:3])[0], dtype=np.float64)
    return pose @ Pose3(turn, step[3:])
