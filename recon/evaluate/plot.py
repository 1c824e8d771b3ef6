"""`recon eval --plot`: one picture of a result beside its ground truth."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from recon.drawing import Drawing, Truth, save_drawing
from recon.errors import InputError
from recon.evaluate.relations import given_odometry, poses_at, relation_residuals
from recon.evaluate.trajectory import associate
from recon.geometry import Array, align2, compose2, wrap_angle
from recon.results.accuracy import read_closures, read_scan_residuals, read_sigmas
from recon.results.reader import load_layout, load_residuals
from recon.sequence.groundtruth import GroundTruth, read_groundtruth
from recon.sequence.trajectory import Trajectory
from recon.sequence.tum import read_planar

WORST = 0.01
"""Part of the relations, those with the largest errors, that are shown."""


def plot_result(sequence: Path, result: Path, path: Path) -> None:
    """Trajectory, walls, loop closures, residuals and uncertainty ellipses of a result folder, as .png, .svg or .pdf.

    Raises InputError as `evaluate`, and OutputError for another suffix.
    """
    truth = read_groundtruth(sequence)
    trajectory = read_planar(result / "trajectory.txt")
    sigmas = read_sigmas(result)
    if len(sigmas) not in (0, len(trajectory)):
        raise InputError(f"{result / 'pose_sigmas.txt'}: {len(sigmas)} poses, expected {len(trajectory)}")
    by_scan = read_scan_residuals(result)
    if any(len(values) != len(trajectory) for values in by_scan.values()):
        raise InputError(f"{result / 'residuals.txt'}: expected a row for each of {len(trajectory)} poses")
    odometry, _ = given_odometry(sequence, trajectory)
    drawing = Drawing(
        trajectory,
        sigmas[:, 1:],
        load_layout(result).walls,
        _closures(trajectory, read_closures(result)),
        load_residuals(result),
        _truth(truth, trajectory, odometry),
        by_scan,
    )
    save_drawing(drawing, path)


def _closures(trajectory: Trajectory, stamps: Array) -> Array:
    """(L, 2, 2) m: the two places of every closure."""
    return np.stack([trajectory.at(stamps[:, k])[:, :2] for k in (0, 1)], axis=1)


def _truth(truth: GroundTruth, trajectory: Trajectory, odometry: Trajectory | None) -> Truth:
    """What the ground truth adds to the picture, in the estimate's map frame, which fits it best."""
    walls: list[Array] = []
    way, errors, relations, worst = np.zeros((0, 2)), np.zeros((0, 3)), np.zeros((0, 2)), np.zeros((0, 2, 2))
    fit = np.zeros(3)
    if truth.trajectory is not None:
        mine, theirs = associate(trajectory.timestamps, truth.trajectory.timestamps)
        a, b = trajectory.poses[mine], truth.trajectory.poses[theirs]
        fit = align2(b[:, :2], a[:, :2])
        moved = compose2(fit, b)
        way = compose2(fit, truth.trajectory.poses)[:, :2]
        distance = np.linalg.norm(a[:, :2] - moved[:, :2], axis=1)
        heading = np.degrees(np.abs(wrap_angle(a[:, 2] - moved[:, 2])))
        errors = np.column_stack([trajectory.timestamps[mine], distance, heading])
    if truth.layout is not None:
        walls = [compose2(fit, _as_poses(np.stack([w.start, w.end])))[:, :2] for w in truth.layout.walls]
    if truth.relations is not None:
        translation, rotation, inside = relation_residuals(trajectory, truth.relations, odometry)
        relations = np.column_stack([translation, np.degrees(rotation)])[inside]
        chosen = np.argsort(np.where(inside, -translation, 0.0), kind="stable")[: int(np.ceil(WORST * inside.sum()))]
        ends = (truth.relations.first[chosen], truth.relations.second[chosen])
        worst = np.stack([poses_at(trajectory, t, odometry)[:, :2] for t in ends], axis=1)
    return Truth(way, tuple(walls), errors, relations, worst)


def _as_poses(points: Array) -> Array:
    return np.column_stack([points, np.zeros(len(points))])
