"""From segments and relative motions to poses and walls: association and optimisation in turns."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from recon.config import GraphConfig
from recon.geometry import Array
from recon.graph.association import NONE, Drift, assign, track
from recon.graph.estimate import MapEstimate
from recon.graph.line import Lines
from recon.graph.merge import join, merge_labels
from recon.graph.motion import Motion
from recon.graph.observation import WallObservations
from recon.graph.odometry import OdometryModel, fit_odometry
from recon.graph.optimise import Solution, optimise, variance_factor
from recon.graph.problem import Problem
from recon.graph.relations import Axis, find_axes
from recon.graph.result import LEAST_SIGHTINGS, map_estimate, sightings
from recon.graph.tape import Tape
from recon.sequence.trajectory import Trajectory

Ints = NDArray[np.int64]


REFINEMENTS = 2
"""Solutions between the first, from walls grown along the drive, and the last, with right angles."""


@dataclass(frozen=True)
class _State:
    """Where the rounds stand. labels (K,): the wall of every observation or NONE; variance (K,): its factor."""

    poses: Array
    walls: Lines
    labels: Ints
    variance: Array
    odometry: OdometryModel | None = None
    axes: tuple[Axis, ...] = ()


def solve_graph(
    trajectory: Trajectory,
    motion: Motion,
    observations: WallObservations,
    odometry: Trajectory | None = None,
    config: GraphConfig | None = None,
    closed: bool = False,
    tape: Tape | None = None,
) -> MapEstimate:
    """Poses at every scan and wall lines, with covariances, from one factor graph.

    trajectory: N poses to start from, at every scan; its first pose is held and fixes the map frame. motion: the N-1
    scan matches. observations: segments with `pose` in [0, N). odometry: on its own clock ticks, fused with its scale
    and noise estimated. First walls grow along the drive; after a solution those that are one are merged and
    everything is associated anew with the better poses, twice. The first solution, without odometry, tells how good
    odometry and segments are; the second tells which walls are square. closed: the trajectory is right wherever a place
    is visited again; then walls of all visits are associated from the start. tape: distances between walls measured by
    hand, which the last solution keeps to; raises InputError where it does not know those walls.
    """
    config = config or GraphConfig()
    drift = Drift.solved(len(trajectory)) if closed else Drift.of_motion(motion, trajectory.poses)
    state = _start(trajectory, drift, observations)
    problem, solution = _solve(state, motion, observations)
    state = _merged(state, solution)
    if odometry is not None and len(motion):
        solved = Trajectory(trajectory.timestamps, solution.poses)
        state = replace(state, odometry=fit_odometry(odometry, solved, motion))
    state = _rescaled(state, problem, solution, observations)

    for _ in range(REFINEMENTS):
        state = _drop_rare(_grown(_reassigned(state, observations), observations), observations)
        problem, solution = _solve(replace(state, axes=()), motion, observations)
        if config.manhattan:
            state = replace(state, axes=_axes(state, solution))
        state = _rescaled(_merged(state, solution), problem, solution, observations)

    state = _drop_rare(_reassigned(state, observations), observations)
    problem, solution = _solve(state, motion, observations, final=True, tape=tape)
    return map_estimate(trajectory.timestamps, problem, solution)


def _start(trajectory: Trajectory, drift: Drift, observations: WallObservations) -> _State:
    poses = np.asarray(trajectory.poses, dtype=np.float64)
    lines = Lines.of_observations(observations, poses)
    labels = track(lines, observations.pose, poses, drift)
    state = _State(poses, join(lines, labels), labels, np.ones(len(observations)))
    return _drop_rare(state, observations)


def _solve(
    state: _State, motion: Motion, observations: WallObservations, final: bool = False, tape: Tape | None = None
) -> tuple[Problem, Solution]:
    used = np.flatnonzero(state.labels != NONE)
    scaled = WallObservations(
        observations.pose[used],
        observations.endpoints[used],
        observations.covariance[used] * state.variance[used, None, None],
        observations.image[used],
    )
    problem = Problem(state.poses, motion, scaled, state.labels[used], state.walls, state.odometry, state.axes, tape)
    return problem, optimise(problem, final)


def _merged(state: _State, solution: Solution) -> _State:
    """The state with the solution's poses and walls, those that are one wall made one."""
    count = len(state.walls)
    index = (3 * np.arange(count)[:, None] + np.array([1, 2])).reshape(-1)
    joint = solution.covariance.rest()[np.ix_(index, index)]
    blocks = joint.reshape(count, 2, count, 2)[np.arange(count), :, np.arange(count)]
    walls = Lines(solution.walls[:, :2], solution.walls[:, 2], state.walls.half, blocks.reshape(count, 2, 2))
    group = merge_labels(walls, joint)
    labels = np.where(state.labels == NONE, NONE, group[state.labels]) if count else state.labels
    axes = tuple(_renumbered(axis, group) for axis in state.axes)
    return replace(state, poses=solution.poses, walls=join(walls, group), labels=labels, axes=axes)


def _renumbered(axis: Axis, number: Ints) -> Axis:
    """The axis with every wall's new `number` (W,), without those that are gone (NONE)."""
    members, first = np.unique(number[axis.members], return_index=True)
    kept = members != NONE
    return replace(axis, members=members[kept], turns=axis.turns[first][kept])


def _axes(state: _State, solution: Solution) -> tuple[Axis, ...]:
    index = 3 * np.arange(len(state.walls)) + 2
    joint = solution.covariance.rest()[np.ix_(index, index)]
    return tuple(find_axes(solution.walls[:, 2], joint, 2 * state.walls.half))


def _rescaled(state: _State, problem: Problem, solution: Solution, observations: WallObservations) -> _State:
    """Covariances of LiDAR and of image segments multiplied by the variance that the solution found."""
    lidar, image = (variance_factor(problem, solution, kind) for kind in ("lidar", "image"))
    return replace(state, variance=state.variance * np.where(observations.image < 0, lidar, image))


def _reassigned(state: _State, observations: WallObservations) -> _State:
    """Every observation given to the wall it fits best."""
    lines = _lines(state, observations)
    labels = assign(lines, state.walls, state.poses, observations.pose)
    return replace(state, labels=labels)


def _grown(state: _State, observations: WallObservations) -> _State:
    """New walls from the observations that fit none."""
    left = np.flatnonzero(state.labels == NONE)
    lines = _lines(state, observations)[left]
    new = track(lines, observations.pose[left], state.poses, Drift.solved(len(state.poses)))
    labels = state.labels.copy()
    labels[left] = len(state.walls) + new
    walls = Lines.concatenate([state.walls, join(lines, new)])
    return replace(state, walls=walls, labels=labels)


def _lines(state: _State, observations: WallObservations) -> Lines:
    lines = Lines.of_observations(observations, state.poses)
    return replace(lines, covariance=lines.covariance * state.variance[:, None, None])


def _drop_rare(state: _State, observations: WallObservations) -> _State:
    """Without walls that too few scans or images saw."""
    scans, images = sightings(state.labels, observations, len(state.walls), len(state.poses))
    kept = (scans >= min(LEAST_SIGHTINGS, len(state.poses))) | (images >= LEAST_SIGHTINGS)
    number = np.where(kept, np.cumsum(kept) - 1, NONE)
    labels = np.where(state.labels == NONE, NONE, number[state.labels]) if len(number) else state.labels
    axes = tuple(_renumbered(axis, number) for axis in state.axes)
    return replace(state, walls=state.walls[kept], labels=labels, axes=axes)
