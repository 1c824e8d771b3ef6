"""Wall lines that grow along the drive (compiled): an extended Kalman filter for each, on (offset, angle).

Walls live in the drifting frame of the newest scans: one seen again after a while moves to where it is seen now.
Symmetric 2 by 2 covariances are rows [a, b, d] for [[a, b], [b, d]] throughout.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from recon.geometry import Array
from recon.graph.nearest import CELL, NONE, is_apart, seen_from, squared_distance_of

Ints = NDArray[np.int64]


@njit(cache=True)
def track_lines(
    lines: Array, own: Array, noise: Array, flatness: Array, cuts: Ints, scans: Ints, poses: Array, position: Array,
    heading: Array, limits: tuple[float, float, float], most: tuple[float, float],
) -> Ints:  # fmt: skip
    """Labels (K,) of segments in order of their scans, each the wall that it joins or starts.

    lines: (K, 4) x, y, yaw, half length. own, noise, flatness: (K, 3) covariances of (offset, angle): of the segment,
    of it and its pose, and of how far a wall may leave its line. cuts: (S + 1,) where each of `scans` (S,) begins, and
    K. position: (N, 3) m^2 and heading: (N,) rad^2, drift since the first scan. limits: the largest squared distance;
    gap (m) along the wall; turn (rad). most: largest drift (m^2 and rad^2) that counts.
    """
    count = len(lines)
    walls, spread = np.zeros((count, 4)), np.zeros((count, 3))
    seen, labels = np.zeros((count, 2), np.int64), np.full(count, NONE, np.int64)
    head, after = np.full(1 << 16, -1, np.int64), np.full(4 * count + 16, -1, np.int64)
    member, used, size = np.zeros(4 * count + 16, np.int64), 0, 0
    drift = np.zeros((count, 3))
    for i in range(len(scans)):
        scan = scans[i]
        for k in range(cuts[i], cuts[i + 1]):
            best = limits[0]
            lever = _lever(lines[k], poses[scan])
            steps = 1 + int(2 * (lines[k, 3] + limits[1]) / CELL)
            for step in range(steps + 1):
                along = (2 * step / steps - 1) * (lines[k, 3] + limits[1])
                for cell in range(9):
                    entry = head[_bucket(lines[k], along, cell // 3 - 1, cell % 3 - 1, len(head))]
                    while entry >= 0:
                        w = member[entry]
                        entry = after[entry]
                        since = min(max(scan, seen[w, 0]), seen[w, 1])
                        moved = _moved(walls[w, 2], lever, position[scan] - position[since],
                                       heading[scan] - heading[since], most)  # fmt: skip
                        distance = _distance(lines[k], noise[k] + flatness[k] + moved, walls[w], spread[w], limits)
                        if distance < best or (distance == best and w < labels[k]):
                            best, labels[k], drift[k] = distance, w, moved
        for k in range(cuts[i], cuts[i + 1]):
            w = labels[k]
            if w == NONE:
                w = size
                labels[k], walls[w], spread[w], seen[w, 0] = w, lines[k], own[k], scan
                size += 1
            else:
                _update(walls[w], spread[w], lines[k], noise[k], drift[k])
            seen[w, 1] = scan
            if used + 2 * (2 + int(2 * walls[w, 3] / CELL)) > len(member):
                member, after = _longer(member), _longer(after)
            used = _insert(walls[w], w, head, after, member, used)
    return labels


@njit(cache=True)
def _longer(values: Ints) -> Ints:
    return np.concatenate((values, np.full(len(values), -1, np.int64)))


@njit(cache=True)
def _bucket(line: Array, along: float, du: int, dv: int, size: int) -> int:
    """Of the cell `du`, `dv` away from the one `along` metres from the line's middle; cells far apart may share one."""
    u = math.floor((line[0] + along * math.cos(line[2])) / CELL) + du
    v = math.floor((line[1] + along * math.sin(line[2])) / CELL) + dv
    return (u * 73856093 ^ v * 19349663) % size


@njit(cache=True)
def _insert(wall: Array, number: int, head: Ints, after: Ints, member: Ints, used: int) -> int:
    """Puts a wall into all cells that it passes."""
    steps = 1 + int(2 * wall[3] / CELL)
    for step in range(steps + 1):
        bucket = _bucket(wall, (2 * step / steps - 1) * wall[3], 0, 0, len(head))
        entry = head[bucket]
        while entry >= 0 and member[entry] != number:
            entry = after[entry]
        if entry < 0:
            member[used], after[used], head[bucket] = number, head[bucket], used
            used += 1
    return used


@njit(cache=True)
def _lever(line: Array, pose: Array) -> float:
    """m along the line from where the pose is to the line's middle."""
    return float((line[0] - pose[0]) * math.cos(line[2]) + (line[1] - pose[1]) * math.sin(line[2]))


@njit(cache=True)
def _carry(a: float, b: float, d: float, along: float) -> tuple[float, float, float]:
    """The covariance, moved along the line."""
    return a + 2 * along * b + along * along * d, b + along * d, d


@njit(cache=True)
def _moved(yaw: float, lever: float, position: Array, heading: float, most: tuple[float, float]) -> Array:
    """(3,) covariance of a segment's (offset, angle) that drift makes since its wall was seen."""
    nx, ny = -math.sin(yaw), math.cos(yaw)
    across = min(abs(nx * nx * position[0] + 2 * nx * ny * position[1] + ny * ny * position[2]), most[0])
    turn = min(abs(heading), most[1])
    return np.array([across + lever * lever * turn, lever * turn, turn])


@njit(cache=True)
def _distance(line: Array, noise: Array, wall: Array, spread: Array, limits: tuple[float, float, float]) -> float:
    """Squared Mahalanobis distance of a line from a wall, infinite where they do not touch or are turned."""
    along, offset, angle = seen_from(wall, line)
    if is_apart(along, angle, line[3], wall[3], limits[1], limits[2]):
        return math.inf
    a, b, d = _carry(spread[0], spread[1], spread[2], along)
    return squared_distance_of(offset, angle, a + noise[0], b + noise[1], d + noise[2])


@njit(cache=True)
def _update(wall: Array, spread: Array, line: Array, noise: Array, drift: Array) -> None:
    """Fuse one segment. drift: covariance of the wall's drift since it was seen, at the segment's middle."""
    along, offset, angle = seen_from(wall, line)
    c, s = math.cos(wall[2]), math.sin(wall[2])
    low, high = min(-wall[3], along - line[3]), max(wall[3], along + line[3])
    shift = (low + high) / 2  # the wall's origin moves to the middle of its stretch
    back = shift - along
    a, b, d = _carry(spread[0], spread[1], spread[2], shift)
    e, f, g = _carry(drift[0], drift[1], drift[2], back)
    a, b, d = a + e, b + f, d + g
    e, f, g = _carry(noise[0], noise[1], noise[2], back)
    e, f, g = e + a, f + b, g + d
    scale = 1 / (e * g - f * f)
    k00, k01 = (a * g - b * f) * scale, (b * e - a * f) * scale
    k10, k11 = (b * g - d * f) * scale, (d * e - b * f) * scale
    offset += back * angle
    offset, angle = k00 * offset + k01 * angle, k10 * offset + k11 * angle
    wall[0] += c * shift - s * offset
    wall[1] += s * shift + c * offset
    wall[2] += angle
    wall[3] = (high - low) / 2
    spread[0], spread[1], spread[2] = a - k00 * a - k01 * b, b - k00 * b - k01 * d, d - k10 * b - k11 * d
