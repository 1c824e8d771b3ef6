"""Covariances of poses and walls, from the linearised factor graph."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_solve_banded, cholesky_banded
from scipy.linalg.lapack import dpotrf, dpotri
from scipy.sparse import csr_array

from recon.geometry import Array

BAND = 5
"""Diagonals above the main one that neighbouring poses fill."""
CHUNK = 192
"""Columns that are solved for at a time: memory does not grow with poses times walls."""


class JointCovariance:
    """The inverse of the information matrix, as far as it is asked for.

    Every variable is a Pose2 of three numbers in its own frame (x, y, yaw), variable k in rows 3k to 3k+2: first the
    poses along the drive, then everything else (walls, axes). Poses are tied to their neighbours and to walls only, so
    their part of the information is a narrow band, and what is dense is as large as there are walls (the Schur
    complement). GTSAM's Marginals gives blocks one by one; walls are compared in pairs, which needs the blocks between
    them too.
    """

    def __init__(self, linear_graph: Any, poses: int, variables: int) -> None:
        rows, columns, values = linear_graph.sparseJacobian_()
        size, used, split = 3 * variables, columns <= 3 * variables, 3 * poses
        shape = (3 * linear_graph.size(), size)
        self.jacobian = csr_array((values[used], (rows[used] - 1, columns[used] - 1)), shape=shape)
        information = csr_array(self.jacobian.T @ self.jacobian)
        self._band = np.zeros((BAND + 1, split))
        for k in range(min(BAND + 1, split)):
            self._band[-1 - k, k:] = information[:split, :split].diagonal(k)
        self._root = cholesky_banded(self._band)
        self._across = csr_array(information[split:, :split])
        reduced = information[split:, split:].toarray()
        for start in range(0, size - split, CHUNK):
            columns = slice(start, start + CHUNK)
            reduced[:, columns] -= self._across @ self._solve_poses(self._across[columns].toarray().T)
        self._rest = _inverse(reduced)
        self._split = split
        self._unknown = np.zeros(size)

    def add_unknown(self, rows: NDArray[np.int64], change: Array, sigma: float) -> None:
        """Widen by a number that was estimated apart, with standard deviation `sigma`.

        change: (n,) by how much one unit of it moves the residuals in the Jacobian's `rows` (n,).
        """
        self._unknown = -sigma * self._solve((self.jacobian[rows].T @ change)[:, None])[:, 0]

    def rest(self) -> Array:
        """(M, M) joint covariance of everything but the poses."""
        later = self._unknown[self._split :]
        return self._rest + np.outer(later, later)

    def poses(self) -> Array:
        """(N, 3, 3) marginal covariance of every pose."""
        change = self._unknown[: self._split].reshape(-1, 3)
        out = self._chain_blocks() + change[:, :, None] * change[:, None]
        root = np.linalg.cholesky(self._rest)
        for start in range(0, len(root), CHUNK):
            # how poses follow the rest, times the root of its covariance
            part = self._solve_poses(self._across.T @ root[:, start : start + CHUNK]).reshape(len(out), 3, -1)
            out += part @ part.transpose(0, 2, 1)
        return out

    def leverage(self, rows: NDArray[np.int64], probes: int = 8) -> float:
        """Degrees of freedom that the solution takes from the Jacobian's `rows`: the trace of J S J^T there.

        Estimated with random signs (Hutchinson 1990), from a fixed seed.
        """
        if not len(rows):
            return 0.0
        signs = np.random.default_rng(0).choice([-1.0, 1.0], size=(len(rows), probes))
        back = self.jacobian[rows].T @ signs
        return float(np.sum(back * self._solve(back)) / probes)

    def _solve(self, right: Array) -> Array:
        """The inverse of the information times `right` (V, n)."""
        poses = self._solve_poses(right[: self._split])
        others = self._rest @ (right[self._split :] - self._across @ poses)
        return np.concatenate([poses - self._solve_poses(self._across.T @ others), others])

    def _solve_poses(self, right: Array) -> Array:
        return np.asarray(cho_solve_banded((self._root, False), right, check_finite=False))

    def _chain_blocks(self) -> Array:
        """(N, 3, 3) diagonal blocks of the inverse of the poses' own information, walls held (block tridiagonal)."""
        own, following = self._blocks(0), self._blocks(3)
        out = np.array(np.linalg.inv(own[:1]).repeat(len(own), axis=0), dtype=np.float64)
        for k in range(1, len(own)):
            out[k] = np.linalg.inv(own[k] - following[k - 1].T @ out[k - 1] @ following[k - 1])
        for k in range(len(own) - 2, -1, -1):
            gain = out[k] @ following[k]
            out[k] += gain @ out[k + 1] @ gain.T
        return out

    def _blocks(self, shift: int) -> Array:
        """(N, 3, 3) blocks of the poses' information on the diagonal (shift 0), (N - 1, 3, 3) beside it (shift 3)."""
        out = np.empty(((self._split - shift) // 3, 3, 3))
        for i in range(3):
            for j in range(3):
                away = abs(shift + j - i)
                out[:, i, j] = self._band[-1 - away, shift + (j if shift else max(i, j)) :: 3]
        return out


def _inverse(matrix: Array) -> Array:
    """Of a positive definite matrix, by its Cholesky factor."""
    if not len(matrix):
        return matrix
    factor, failed = dpotrf(matrix, lower=1)
    if failed:
        raise np.linalg.LinAlgError("the information of the walls is not positive definite")
    inverse, _ = dpotri(factor, lower=1)
    return np.asarray(np.tril(inverse) + np.tril(inverse, -1).T)
