"""How sure the lines of a plan are, together: covariances from the walls that they were made of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from recon.geometry import Array
from recon.graph.estimate import MapEstimate
from recon.layout.line import PlanLine


def line_covariances(first: Sequence[PlanLine], second: Sequence[PlanLine], estimate: MapEstimate) -> Array:
    """(P, 2, 2) covariance of the (offset m, angle rad) of lines `first` with those of lines `second`, pair by pair.

    Offsets are at the lines' origins, to their left. Walls that the estimate knows no joint covariance of, and lines
    that no wall lies behind, are independent of all others.
    """
    rows = [(p, i, k, a, b) for p in range(len(first)) for i, a in first[p].parts for k, b in second[p].parts]
    out = np.zeros((len(first), 2, 2))
    if rows:
        pair, one, other = np.array([row[:3] for row in rows], dtype=np.int64).T
        to_first, to_second = np.array([row[3] for row in rows]), np.array([row[4] for row in rows])
        if estimate.joint is not None:
            blocks = estimate.joint.between(one, other)
        else:
            sigma = np.array([(wall.sigma_offset, wall.sigma_angle) for wall in estimate.walls])
            blocks = sigma[one][:, :, None] ** 2 * np.eye(2) * (one == other)[:, None, None]
        np.add.at(out, pair, to_first @ blocks @ to_second.transpose(0, 2, 1))
    for p, (line, same) in enumerate(zip(first, second, strict=True)):
        if line is same:
            out[p] += line.surface if line.parts else np.diag([line.sigma_offset, line.sigma_angle]) ** 2
    return out


def joint_covariances(first: Sequence[PlanLine], second: Sequence[PlanLine], estimate: MapEstimate) -> Array:
    """(P, 4, 4) joint covariance of (offset, angle) of the one line and of the other, pair by pair."""
    own, other = (line_covariances(lines, lines, estimate) for lines in (first, second))
    cross = line_covariances(first, second, estimate)
    return np.block([[own, cross], [cross.transpose(0, 2, 1), other]])


def follows(line: PlanLine, point: Array, way: Array) -> Array:
    """(2,) how far, along the unit vector `way` (2,), a line moves at a point on it with its offset and its angle."""
    turned = float(line.normal @ way)
    return np.array([turned, turned * float(line.along(point[None])[0])])


def with_sigmas(lines: Sequence[PlanLine], estimate: MapEstimate) -> list[PlanLine]:
    """Lines with the standard deviations that follow from the walls behind them."""
    spread = line_covariances(lines, lines, estimate)
    sigma = np.sqrt(np.maximum(np.diagonal(spread, axis1=1, axis2=2), 0.0))
    return [
        replace(line, sigma_offset=float(offset), sigma_angle=float(angle), mixed=float(block[0, 1]))
        for line, (offset, angle), block in zip(lines, sigma, spread, strict=True)
    ]
