"""How far measurements are from the solution, in standard deviations: by kind of factor, and scan by scan."""

from __future__ import annotations

import numpy as np

from recon.geometry import Array
from recon.graph.optimise import Solution, motion_residuals, wall_residuals
from recon.graph.problem import Problem
from recon.graph.tape import tape_spans


def tape_distances(problem: Problem, solution: Solution) -> Array:
    """(T,) m: solved distances between the walls that were measured by hand."""
    if problem.tape is None:
        return np.zeros(0)
    return np.abs(tape_spans(problem.tape, problem.walls, solution.walls)[1].signed)


def residuals(problem: Problem, solution: Solution) -> tuple[dict[str, float], dict[str, Array]]:
    """Root mean square normalised residuals, per degree of freedom: by kind of factor, and of every scan (N,).

    A scan's motion is that from the scan before; nan where a scan has no factor of a kind.
    """
    count = len(solution.poses)
    squared, image = wall_residuals(problem, solution), problem.observations.image >= 0
    rows = {"lidar": (problem.observations.pose[~image], squared[~image] / 2)}
    rows["image"] = problem.observations.pose[image], squared[image] / 2
    motions = {"motion": (problem.motion, np.ones(count - 1, np.bool_))}
    if problem.odometry is not None:
        motions["odometry"] = problem.odometry.motion, np.asarray(problem.odometry.inside, dtype=np.bool_)
    for name, (motion, inside) in motions.items():
        steps = motion_residuals(motion.relative, motion.covariance, solution.poses) / 3
        rows[name] = np.flatnonzero(inside) + 1, steps[inside]
    whole = {name: float(np.sqrt(np.mean(d))) for name, (_, d) in rows.items() if len(d)}
    if problem.tape is not None:
        off = (tape_distances(problem, solution) - problem.tape.distance) / problem.tape.sigma
        whole["tape"] = float(np.sqrt(np.mean(off**2)))
    by_scan = {}
    for name, (scan, d) in rows.items():
        if len(d):
            number = np.bincount(scan, minlength=count)
            total = np.bincount(scan, weights=d, minlength=count)
            by_scan[name] = np.sqrt(np.where(number > 0, total / np.maximum(number, 1), np.nan))
    return whole, by_scan
