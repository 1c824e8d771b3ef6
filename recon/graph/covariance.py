"""Covariances of poses and walls, from the linearised factor graph."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.linalg import splu

from recon.geometry import Array

CHUNK = 256
"""Columns of the covariance that are in memory at a time."""


class JointCovariance:
    """The inverse of the information matrix, column by column.

    Every variable is a Pose2 of three numbers in its own frame (x, y, yaw), variable k in rows 3k to 3k+2. GTSAM's
    Marginals gives single blocks; walls are compared in pairs, which needs the blocks between them too.
    """

    def __init__(self, linear_graph: Any, variables: int) -> None:
        rows, columns, values = linear_graph.sparseJacobian_()
        size, used = 3 * variables, columns <= 3 * variables
        shape = (3 * linear_graph.size(), size)
        self.jacobian = csr_array((values[used], (rows[used] - 1, columns[used] - 1)), shape=shape)
        information = (self.jacobian.T @ self.jacobian).tocsc()
        self._factor = splu(information, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
        self._size = size
        self._unknown = np.zeros(size)

    def add_unknown(self, rows: NDArray[np.int64], change: Array, sigma: float) -> None:
        """Widen by a number that was estimated apart, with standard deviation `sigma`.

        change: (n,) by how much one unit of it moves the residuals in the Jacobian's `rows` (n,).
        """
        self._unknown = -sigma * self._factor.solve(self.jacobian[rows].T @ change)

    def joint(self, index: NDArray[np.int64]) -> Array:
        """(n, n) covariance between the scalar variables `index` (n,)."""
        out = np.empty((len(index), len(index)))
        for start in range(0, len(index), CHUNK):
            part = index[start : start + CHUNK]
            out[:, start : start + CHUNK] = self._columns(part)[index]
        return (out + out.T) / 2

    def blocks(self, variables: NDArray[np.int64]) -> Array:
        """(n, 3, 3) marginal covariance of each of the `variables` (n,)."""
        out = np.empty((len(variables), 3, 3))
        step = CHUNK // 3
        for start in range(0, len(variables), step):
            index = (3 * variables[start : start + step, None] + np.arange(3)).reshape(-1)
            block = self._columns(index)[index].reshape(len(index) // 3, 3, -1, 3)
            out[start : start + step] = block[np.arange(len(block)), :, np.arange(len(block))]
        return out

    def leverage(self, rows: NDArray[np.int64], probes: int = 8) -> float:
        """Degrees of freedom that the solution takes from the Jacobian's `rows`: the trace of J S J^T there.

        Estimated with random signs (Hutchinson 1990), from a fixed seed.
        """
        if not len(rows):
            return 0.0
        part = self.jacobian[rows]
        signs = np.random.default_rng(0).choice([-1.0, 1.0], size=(len(rows), probes))
        back = part.T @ signs
        return float(np.sum(back * self._factor.solve(back)) / probes)

    def _columns(self, index: NDArray[np.int64]) -> Array:
        unit = np.zeros((self._size, len(index)))
        unit[index, np.arange(len(index))] = 1.0
        return np.asarray(self._factor.solve(unit) + np.outer(self._unknown, self._unknown[index]))
