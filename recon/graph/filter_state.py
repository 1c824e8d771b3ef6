"""The state of the filter: the platform's pose and the wall lines around it, with their joint covariance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array, compose2, wrap_angle
from recon.graph.line import Difference, Lines, squared_distance

Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Pairing:
    """Segments (in the platform frame) and the wall of each.

    middle: (m, 2) m. angle: (m,) rad. noise: (m, 2, 2) of (offset m, angle rad) at the middle. wall: (m,) its row.
    """

    middle: Array
    angle: Array
    noise: Array
    wall: Ints

    def __len__(self) -> int:
        return len(self.wall)

    @staticmethod
    def of_segments(segments: Lines, wall: Ints) -> Pairing:
        """Segments in the platform frame, one a wall."""
        return Pairing(segments.middle, segments.angle, segments.covariance, wall)


class FilterState:
    """Platform pose and W wall lines: SLAM's extended Kalman filter in the SPmodel (Castellanos and Tardos 1999).

    The error of the pose (x, y, yaw in the map frame) is in rows 0 to 2 of the covariance, that of wall k, (offset m,
    angle rad) at its origin, in rows 3 + 2k and 4 + 2k. A wall's origin stays in the middle of its stretch.
    """

    def __init__(self, pose: Array) -> None:
        self.pose = np.array(pose, dtype=np.float64)
        self.frames = np.zeros((0, 3))
        self.half = np.zeros(0)
        self._covariance = np.zeros((3, 3))
        self._size = 3

    def __len__(self) -> int:
        return len(self.frames)

    @property
    def covariance(self) -> Array:
        """(3 + 2W, 3 + 2W), a view."""
        return self._covariance[: self._size, : self._size]

    @property
    def walls(self) -> Lines:
        """The walls as lines of the map frame."""
        at = 3 + 2 * np.arange(len(self))[:, None] + np.arange(2)
        blocks = self.covariance[at[:, :, None], at[:, None, :]]
        return Lines(self.frames[:, :2], self.frames[:, 2], self.half, blocks)

    def predict(self, relative: Array, covariance: Array) -> Array:
        """Move by `relative` (3,), whose `covariance` (3, 3) is in the frame of the pose before.

        Returns (3, 3): turns an error of `relative` into one of the pose.
        """
        before, moved = self.pose, compose2(self.pose, relative)
        onward = np.eye(3)
        onward[:2, 2] = before[1] - moved[1], moved[0] - before[0]
        c, s = np.cos(before[2]), np.sin(before[2])
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        p = self.covariance
        p[:3] = onward @ p[:3]
        p[:, :3] = p[:, :3] @ onward.T
        p[:3, :3] += turn @ covariance @ turn.T
        self.pose = moved
        return turn

    def widen(self, covariance: Array) -> None:
        """The pose is less certain by `covariance` (3, 3), map frame."""
        self.covariance[:3, :3] += covariance

    def in_map(self, segments: Lines) -> Lines:
        """Segments of the platform frame, seen from the pose, in the map frame."""
        c, s = np.cos(self.pose[2]), np.sin(self.pose[2])
        middle = segments.middle @ np.array([[c, s], [-s, c]]) + self.pose[:2]
        return Lines(middle, wrap_angle(segments.angle + self.pose[2]), segments.half, segments.covariance)

    def distances(self, segments: Lines, reach: float, turn: float, offset: float) -> Array:
        """(K, W) squared Mahalanobis distances of segments (platform frame) to walls.

        Infinite where a segment is more than `reach` m from the wall's stretch, `turn` rad or `offset` m off its line.
        """
        apart = Difference.between(self.in_map(segments), self.walls)
        out = np.full(apart.gap.shape, np.inf)
        near = (apart.gap <= reach) & (np.abs(apart.angle) <= turn) & (np.abs(apart.offset) <= offset)
        rows, walls = np.nonzero(near)
        if len(rows):
            pairing = Pairing.of_segments(segments[rows], walls)
            residual, jacobian, index = self._linearised(pairing)
            part = self.covariance[index[:, :, None], index[:, None, :]]
            spread = jacobian @ part @ jacobian.transpose(0, 2, 1) + pairing.noise
            out[rows, walls] = squared_distance(residual[:, 0], residual[:, 1], spread)
        return out

    def pose_information(self, pairing: Pairing) -> Array:
        """(3, 3) information that the segments have about the pose, in the map frame, were their walls known."""
        jacobian = self._linearised(pairing)[1][:, :, :3]
        return np.asarray(np.sum(jacobian.transpose(0, 2, 1) @ np.linalg.inv(pairing.noise) @ jacobian, axis=0))

    def update(self, pairing: Pairing, offset: Array) -> tuple[Array, Array]:
        """Fuse segments with their walls.

        Returns the squared normalised residual (m,) of each afterwards, and what it is on average (m,) where the
        covariances are right, which is less than two, since the state follows the segments.

        offset: (3,) prediction minus the pose at which to linearise, which is the pose now (the first step of an
        iterated filter; Bell and Cathey 1993).
        """
        residual, jacobian, index = self._linearised(pairing)
        residual = residual + jacobian[:, :, :3] @ offset
        count = len(pairing)
        # P H^T: every segment touches the pose and one wall
        cross = np.einsum("nkj,kij->nki", self.covariance[:, index], jacobian)
        innovation = np.einsum("kal,lkbj->kabj", jacobian, cross[index].transpose(1, 0, 2, 3))
        square = innovation.reshape(2 * count, 2 * count)
        rows = np.arange(count)
        innovation[rows, :, rows] += pairing.noise
        self._fuse(cross.reshape(len(cross), -1), square, residual.reshape(-1), offset)
        rest = self._linearised(pairing)[0]
        # after fusion the residual is R S^-1 times the innovation
        own = np.linalg.inv(square).reshape(innovation.shape)[rows, :, rows]
        expected = np.asarray(np.sum(pairing.noise * own, axis=(1, 2)))
        return squared_distance(rest[:, 0], rest[:, 1], pairing.noise), expected

    def _fuse(self, cross: Array, innovation: Array, residual: Array, offset: Array | None = None) -> None:
        """Kalman's step: cross (n, r) is P H^T, innovation (r, r) its covariance."""
        root = np.linalg.cholesky((innovation + innovation.T) / 2)
        gain = np.linalg.solve(root, cross.T)  # (r, n); its square is what the covariance loses
        change = -gain.T @ np.linalg.solve(root, residual)
        if offset is not None:
            change[:3] += offset
        self._covariance[: self._size, : self._size] -= gain.T @ gain
        self.pose = self.pose + change[:3]
        self.pose[2] = wrap_angle(self.pose[2])
        shift, turn = change[3::2], change[4::2]
        normal = np.stack([-np.sin(self.frames[:, 2]), np.cos(self.frames[:, 2])], axis=1)
        self.frames[:, :2] += shift[:, None] * normal
        self.frames[:, 2] = wrap_angle(self.frames[:, 2] + turn)

    def _linearised(self, pairing: Pairing) -> tuple[Array, Array, Ints]:
        """Residuals (m, 2), their Jacobians (m, 2, 5) by the error of pose and wall, and those rows (m, 5).

        The residual is where the segment's middle lies in the wall's frame, across, and how it is turned.
        """
        c, s = np.cos(self.pose[2]), np.sin(self.pose[2])
        lever = pairing.middle @ np.array([[c, s], [-s, c]])
        walls = self.frames[pairing.wall]
        delta = lever + self.pose[:2] - walls[:, :2]
        c, s = np.cos(walls[:, 2]), np.sin(walls[:, 2])
        along, offset = c * delta[:, 0] + s * delta[:, 1], c * delta[:, 1] - s * delta[:, 0]
        angle = wrap_angle(pairing.angle + self.pose[2] - walls[:, 2])
        jacobian = np.zeros((len(pairing), 2, 5))
        jacobian[:, 0, 0], jacobian[:, 0, 1] = -s, c
        jacobian[:, 0, 2] = c * lever[:, 0] + s * lever[:, 1]
        jacobian[:, 0, 3], jacobian[:, 0, 4] = -1.0, -along
        jacobian[:, 1, 2], jacobian[:, 1, 4] = 1.0, -1.0
        index = np.empty((len(pairing), 5), dtype=np.int64)
        index[:, :3], index[:, 3:] = np.arange(3), 3 + 2 * pairing.wall[:, None] + np.arange(2)
        return np.stack([offset, angle], axis=1), jacobian, index

    def add(self, segments: Lines) -> Ints:
        """A new wall at every segment (platform frame); returns their rows."""
        lines = self.in_map(segments)
        count, size = len(lines), self._size
        if count == 0:
            return np.zeros(0, dtype=np.int64)
        lever = np.sum((lines.middle - self.pose[:2]) * lines.direction, axis=1)
        by_pose = np.zeros((count, 2, 3))
        by_pose[:, 0, 0], by_pose[:, 0, 1] = -np.sin(lines.angle), np.cos(lines.angle)
        by_pose[:, 0, 2], by_pose[:, 1, 2] = lever, 1.0
        self._reserve(size + 2 * count)
        effect = by_pose.reshape(2 * count, 3)
        p, new = self._covariance, slice(size, size + 2 * count)
        p[new, :size] = effect @ p[:3, :size]
        p[:size, new] = p[new, :size].T
        p[new, new] = effect @ p[:3, :3] @ effect.T
        for k, noise in enumerate(lines.covariance):
            at = slice(size + 2 * k, size + 2 * k + 2)
            p[at, at] += noise
        self._size = size + 2 * count
        first = len(self)
        self.frames, self.half = np.concatenate([self.frames, lines.pose]), np.concatenate([self.half, lines.half])
        return np.arange(first, first + count)

    def _reserve(self, size: int) -> None:
        if size > len(self._covariance):
            larger = np.zeros((2 * size, 2 * size))
            larger[: self._size, : self._size] = self.covariance
            self._covariance = larger

    def stretch(self, wall: int, low: float, high: float) -> float:
        """The wall now reaches from `low` to `high` m too; returns how far its origin moved along it."""
        low, high = min(-self.half[wall], low), max(self.half[wall], high)
        shift, self.half[wall] = (low + high) / 2, (high - low) / 2
        x, y, yaw = self.frames[wall]
        self.frames[wall] = x + shift * np.cos(yaw), y + shift * np.sin(yaw), yaw
        p, row = self.covariance, 3 + 2 * wall
        p[row] += shift * p[row + 1]
        p[:, row] += shift * p[:, row + 1]
        return float(shift)

    def unite(self, wall: int, other: int, flatness: float) -> float:
        """Two walls are one line, but for `flatness` (m): fuse them; returns where the other's origin lies along it."""
        apart = Difference.between(self.walls[np.array([other])], self.walls[np.array([wall])])
        along, turn = float(apart.along[0, 0]), float(apart.angle[0, 0])
        here, there = 3 + 2 * wall, 3 + 2 * other
        jacobian = np.zeros((2, self._size))
        jacobian[0, [there, here, here + 1]] = 1.0, -1.0, -along
        jacobian[1, [there + 1, here + 1]] = 1.0, -1.0
        cross = self.covariance @ jacobian.T
        reach = max(float(min(self.half[wall], self.half[other])), flatness)
        noise = np.diag([flatness, flatness / reach]) ** 2
        self._fuse(cross, jacobian @ cross + noise, np.array([float(apart.offset[0, 0]), turn]))
        return along

    def keep(self, kept: NDArray[np.bool_]) -> None:
        """Only the walls `kept` (W,); the others are marginalised."""
        rows = np.concatenate([[True] * 3, np.repeat(kept, 2)])
        part = self.covariance[np.ix_(rows, rows)]
        self._size = len(part)
        self._covariance[: self._size, : self._size] = part
        self.frames, self.half = self.frames[kept], self.half[kept]
