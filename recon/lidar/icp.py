"""Point-to-line alignment of a scan with the local map (compiled).

Iteratively re-weighted Gauss-Newton on distances along the map's normals (Chen and Medioni 1992; Censi, ICRA 2008)
with the Geman-McClure kernel, its width shrinking from the uncertainty of the guess to the noise, and a Gaussian prior
from odometry or constant velocity. Blobs without a normal count point to point.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from recon.geometry import Array
from recon.lidar.cloud import Cloud
from recon.lidar.clouds import Clouds, Floats
from recon.lidar.localmap import CELL, LocalMap

Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

MAX_ITERATIONS = 40
SHRINK = 0.7
"""Factor of the kernel's width from one iteration to the next."""
ON_MAP = 1.5
"""Widths of the last kernel within which a point lies on the map."""
SAME_SIDE = 0.7
"""Cosine between the normals of scan and map above which two points may be one surface seen from the same side."""


@dataclass(frozen=True)
class Alignment:
    """Where a scan lies in the map.

    pose: (3,) map_from_platform. information: (3, 3) of the scan alone, without the prior, about the pose in the map
    frame. overlap: share of the scan's points that lie on the map within the noise. matched: number of these.
    """

    pose: Array
    information: Array
    overlap: float
    matched: int


def align(
    cloud: Cloud, local: LocalMap, guess: Array, prior: Array, prior_information: Array, width: float, noise: float
) -> Alignment:
    """Aligns a cloud (platform frame) with the map, starting from the guess (3,).

    prior: (3,) map_from_platform with information (3, 3) in the map frame. width, noise: m, first and last width of
    the kernel.
    """
    pose, information, overlap, matched = _align(
        cloud.xy, cloud.normals, cloud.flat, cloud.information,
        local.points, local.normals, local.flat, local.information, local.head, local.after, local.corner,
        guess, prior, prior_information, width, noise,
    )  # fmt: skip
    return Alignment(pose, information, overlap, matched)


def align_many(
    clouds: Clouds, chosen: Ints, local: LocalMap, guesses: Array, prior_information: Array, width: float, noise: float
) -> list[Alignment]:
    """`align` of the `chosen` (m,) of many clouds, each with its guess (m, 3) as prior, too."""
    poses, information, overlap, matched = _align_many(
        clouds.rows, clouds.flat, clouds.start, chosen,
        local.points, local.normals, local.flat, local.information, local.head, local.after, local.corner,
        guesses, prior_information, width, noise,
    )  # fmt: skip
    parts = zip(poses, information, overlap.tolist(), matched.tolist(), strict=True)
    return [Alignment(*part) for part in parts]


@njit(cache=True, nogil=True)
def _align_many(
    rows: Floats, flat: Bools, start: Ints, chosen: Ints,
    map_xy: Array, map_normals: Array, map_flat: Bools, map_information: Array, head: Ints, after: Ints, corner: Array,
    guesses: Array, prior_information: Array, width: float, noise: float,
) -> tuple[Array, Array, Array, Ints]:  # fmt: skip
    count = len(chosen)
    poses, information = np.empty((count, 3)), np.empty((count, 3, 3))
    overlap, matched = np.empty(count), np.empty(count, np.int64)
    for m in range(count):
        a, b = start[chosen[m]], start[chosen[m] + 1]
        cloud = rows[a:b].astype(np.float64)
        poses[m], information[m], overlap[m], matched[m] = _align(
            cloud[:, 0:2].copy(), cloud[:, 2:4].copy(), flat[a:b], cloud[:, 4].copy(),
            map_xy, map_normals, map_flat, map_information, head, after, corner,
            guesses[m], guesses[m], prior_information, width, noise,
        )  # fmt: skip
    return poses, information, overlap, matched


@njit(cache=True, nogil=True)
def _align(
    xy: Array, normals: Array, flat: Bools, information: Array,
    map_xy: Array, map_normals: Array, map_flat: Bools, map_information: Array, head: Ints, after: Ints, corner: Array,
    guess: Array, prior: Array, prior_information: Array, width: float, noise: float,
) -> tuple[Array, Array, float, int]:  # fmt: skip
    pose, system, step, matched = guess.copy(), np.zeros((3, 4)), np.zeros(3), 0
    for _ in range(MAX_ITERATIONS):
        matched = _normal_equations(
            xy, normals, flat, information, map_xy, map_normals, map_flat, map_information, head, after, corner,
            pose, width, noise, system,
        )  # fmt: skip
        _solve(system, pose, prior, prior_information, step)
        for c in range(3):
            pose[c] += step[c]
        if width <= noise and abs(step[0]) + abs(step[1]) < 1e-4 and abs(step[2]) < 1e-5:
            break
        width = max(noise, SHRINK * width)
    pose[2] = (pose[2] + math.pi) % (2 * math.pi) - math.pi
    return pose, system[:, :3].copy(), matched / max(1, len(xy)), matched


@njit(cache=True)
def _normal_equations(
    xy: Array, normals: Array, flat: Bools, information: Array,
    map_xy: Array, map_normals: Array, map_flat: Bools, map_information: Array, head: Ints, after: Ints, corner: Array,
    pose: Array, width: float, noise: float, system: Array,
) -> int:  # fmt: skip
    """Writes J'WJ | J'We (3, 4); returns how many points lie on the map."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    reach, matched = max(3.0 * width, CELL), 0
    for a in range(3):
        for b in range(4):
            system[a, b] = 0.0
    for i in range(len(xy)):
        rx, ry = c * xy[i, 0] - s * xy[i, 1], s * xy[i, 0] + c * xy[i, 1]
        nx, ny = c * normals[i, 0] - s * normals[i, 1], s * normals[i, 0] + c * normals[i, 1]
        x, y = rx + pose[0], ry + pose[1]
        k = _nearest(x, y, nx, ny, flat[i], map_xy, map_normals, map_flat, head, after, corner, reach)
        if k < 0:
            continue
        dx, dy = x - map_xy[k, 0], y - map_xy[k, 1]
        weight = 1.0 / (1.0 / information[i] + 1.0 / map_information[k])
        if map_flat[k]:
            nx, ny = map_normals[k, 0], map_normals[k, 1]
            distance = nx * dx + ny * dy
            weight *= _kernel(distance, width)
            _add(system, nx, ny, rx, ry, distance, weight)
        else:
            distance = math.hypot(dx, dy)
            weight *= _kernel(distance, width)
            _add(system, 1.0, 0.0, rx, ry, dx, weight)
            _add(system, 0.0, 1.0, rx, ry, dy, weight)
        if abs(distance) < ON_MAP * noise:
            matched += 1
    return matched


@njit(cache=True)
def _kernel(distance: float, width: float) -> float:
    """Weight of Geman and McClure."""
    ratio = distance / width
    return 1.0 / (1.0 + ratio * ratio) ** 2


@njit(cache=True)
def _add(system: Array, nx: float, ny: float, rx: float, ry: float, distance: float, weight: float) -> None:
    jacobian = (nx, ny, ny * rx - nx * ry)
    for a in range(3):
        for b in range(3):
            system[a, b] += weight * jacobian[a] * jacobian[b]
        system[a, 3] += weight * jacobian[a] * distance


@njit(cache=True)
def _nearest(
    x: float, y: float, nx: float, ny: float, is_flat: bool,
    map_xy: Array, map_normals: Array, map_flat: Bools, head: Ints, after: Ints, corner: Array, reach: float,
) -> int:  # fmt: skip
    """The nearest map point within `reach` (m) on the same side of a surface, -1: none. Rings of cells, inside out."""
    u, v = math.floor((x - corner[0]) / CELL), math.floor((y - corner[1]) / CELL)
    best, nearest = -1, reach * reach
    for ring in range(int(reach / CELL) + 2):
        if ring > 1 and ((ring - 1) * CELL) ** 2 > nearest:
            break
        for du in range(-ring, ring + 1):
            if not 0 <= u + du < head.shape[0]:
                continue
            stride = 1 if abs(du) == ring or ring == 0 else 2 * ring
            for dv in range(-ring, ring + 1, stride):
                if not 0 <= v + dv < head.shape[1]:
                    continue
                k = head[u + du, v + dv]
                while k >= 0:
                    square = (x - map_xy[k, 0]) ** 2 + (y - map_xy[k, 1]) ** 2
                    if square < nearest and (
                        not is_flat or (map_flat[k] and nx * map_normals[k, 0] + ny * map_normals[k, 1] > SAME_SIDE)
                    ):
                        best, nearest = k, square
                    k = after[k]
    return best


@njit(cache=True)
def _solve(system: Array, pose: Array, prior: Array, prior_information: Array, step: Array) -> None:
    """Writes the Gauss-Newton step (3,), prior included; elimination of the (3, 4) system."""
    rows, offset = np.zeros((3, 4)), np.zeros(3)
    for a in range(3):
        offset[a] = pose[a] - prior[a]
    offset[2] = (offset[2] + math.pi) % (2 * math.pi) - math.pi
    for a in range(3):
        rows[a, 3] = -system[a, 3]
        for b in range(3):
            rows[a, b] = system[a, b] + prior_information[a, b]
            rows[a, 3] -= prior_information[a, b] * offset[b]
    for a in range(3):  # positive definite: no pivoting
        for b in range(a + 1, 3):
            factor = rows[b, a] / rows[a, a]
            for c in range(a, 4):
                rows[b, c] -= factor * rows[a, c]
    for a in range(2, -1, -1):
        step[a] = rows[a, 3]
        for b in range(a + 1, 3):
            step[a] -= rows[a, b] * step[b]
        step[a] /= rows[a, a]
