"""The linearised factor graph: its elimination, and its Jacobian in pieces, since whole it is larger than the graph."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from recon.geometry import Array

Ints = NDArray[np.int64]

PIECE = 20_000
"""Factors whose rows of the Jacobian are made at once."""


class LinearGraph:
    """GTSAM's linear factors over `variables` V of three numbers each; rows are weighted with the roots of their
    information. Every factor has three rows."""

    def __init__(self, graph: Any, variables: int) -> None:
        self._graph, self.variables = graph, variables

    def eliminate(self) -> Any:
        """The Bayes net, in an order found by nested dissection."""
        import gtsam

        order = gtsam.Ordering.MetisGaussianFactorGraph(self._graph)
        try:
            return self._graph.eliminateSequential(order)
        except RuntimeError:  # squaring loses what little is known along a bare corridor: slower, but without
            return self._graph.eliminateSequential(order, gtsam.EliminateQR)

    def pull(self, factors: Ints, change: Array) -> Array:
        """(3V, n): transposed Jacobian of the factors with these numbers (F,), times `change` (3F, n) of their rows."""
        out = np.zeros((3 * self.variables, change.shape[1]))
        for low in range(0, len(factors), PIECE):
            self._add(out, factors[low : low + PIECE], change[3 * low : 3 * (low + PIECE)])
        return out

    def random_pull(self, factors: Ints, probes: int) -> Array:
        """(3V, probes): the same for random signs, from a fixed seed."""
        out, rng = np.zeros((3 * self.variables, probes)), np.random.default_rng(0)
        for low in range(0, len(factors), PIECE):
            some = factors[low : low + PIECE]
            self._add(out, some, rng.choice([-1.0, 1.0], size=(3 * len(some), probes)))
        return out

    def _add(self, out: Array, factors: Ints, change: Array) -> None:
        import gtsam

        some = gtsam.GaussianFactorGraph()
        for number in factors.tolist():
            some.push_back(self._graph.at(number))
        keys = np.sort(np.array(some.keyVector(), dtype=np.int64))  # the order of the columns
        rows, columns, values = some.sparseJacobian_()
        place = (rows - 1).astype(np.int32), (columns - 1).astype(np.int32)
        jacobian = csr_array((values, place), shape=(len(change), 3 * len(keys) + 1))
        out.reshape(self.variables, 3, -1)[keys] += (jacobian.T @ change)[:-1].reshape(len(keys), 3, -1)
