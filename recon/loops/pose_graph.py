"""Pose graphs: relative measurements between poses, solved with GTSAM."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array
from recon.graph.edges import Edges
from recon.graph.motion import sqrt_information

Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

GAUGE = 1e-5
"""m and rad: how tightly the first pose is held."""
MAX_ITERATIONS = 30
BARC = 16.3
"""Squared normalised residual (chi-square, three degrees of freedom, 99.9 %) up to which a closure can be right."""


def solve(poses: Array, chain: Edges, loops: Edges, kernel: float = 0.0, chain_kernel: float = 0.0) -> Array:
    """Poses (N, 3) that agree best with all edges, the first one held; from `poses`.

    kernel, chain_kernel: normalised residual at which the Cauchy loss of loops and chain sets in, 0 for none.
    """
    import gtsam

    graph, values = _graph(poses, chain, loops, kernel, chain_kernel)
    found = gtsam.LevenbergMarquardtOptimizer(graph, values, _parameters()).optimize()
    return np.asarray(gtsam.utilities.extractPose2(found))


def solve_consistent(poses: Array, chain: Edges, loops: Edges) -> tuple[Array, Bools]:
    """Poses (N, 3), and which of the loops (E,) belong to the largest set that agrees with them and one another.

    Graduated non-convexity with truncated least squares (Yang et al., RA-L 2020); the chain is known to be right.
    """
    import gtsam

    if not len(loops):
        return poses, np.zeros(0, np.bool_)
    graph, values = _graph(poses, chain, loops, 0.0, 0.0)
    parameters = gtsam.GncLMParams(_parameters())
    parameters.setKnownInliers(list(range(1 + len(chain))))
    gnc = gtsam.GncLMOptimizer(graph, values, parameters)
    gnc.setInlierCostThresholds(0.5 * BARC)
    found = gnc.optimize()
    kept = np.asarray(gnc.getWeights())[1 + len(chain) :] > 0.5
    return np.asarray(gtsam.utilities.extractPose2(found)), kept


def _parameters() -> Any:
    import gtsam

    parameters = gtsam.LevenbergMarquardtParams()
    parameters.setMaxIterations(MAX_ITERATIONS)
    parameters.setRelativeErrorTol(1e-5)
    parameters.setlambdaInitial(1e-6)
    return parameters


def _graph(poses: Array, chain: Edges, loops: Edges, kernel: float, chain_kernel: float) -> tuple[Any, Any]:
    import gtsam

    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    for key, pose in enumerate(poses.tolist()):
        values.insert(key, gtsam.Pose2(*pose))
    held = gtsam.noiseModel.Isotropic.Sigma(3, GAUGE)
    graph.add(gtsam.PriorFactorPose2(0, gtsam.Pose2(*poses[0]), held))
    _add(graph, chain, chain_kernel)
    _add(graph, loops, kernel)
    return graph, values


def _add(graph: Any, edges: Edges, kernel: float) -> None:
    """One between factor an edge."""
    import gtsam

    loss = gtsam.noiseModel.mEstimator.Cauchy.Create(kernel) if kernel else None
    gaussian, robust = gtsam.noiseModel.Gaussian.SqrtInformation, gtsam.noiseModel.Robust.Create
    root = sqrt_information(edges.relative, np.asarray(np.linalg.inv(edges.covariance)))
    for a, b, z, r in zip(edges.first.tolist(), edges.second.tolist(), edges.relative.tolist(), root, strict=True):
        noise = gaussian(r, False)
        graph.add(gtsam.BetweenFactorPose2(a, b, gtsam.Pose2(*z), noise if loss is None else robust(loss, noise)))
