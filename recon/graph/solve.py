"""From segments and relative motions to poses and walls: association and optimisation in turns."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from recon.config import GraphConfig
from recon.geometry import Array
from recon.graph.association import Drift, assign, track
from recon.graph.control import Control, agreeing, places_covariance, survey_of
from recon.graph.edges import Edges
from recon.graph.estimate import MapEstimate, Survey
from recon.graph.line import Lines
from recon.graph.merge import join, merge_labels
from recon.graph.motion import Motion
from recon.graph.nearest import NONE
from recon.graph.observation import WallObservations
from recon.graph.odometry import OdometryModel, fit_odometry
from recon.graph.optimise import Solution, optimise, repetition, variance_factor
from recon.graph.problem import Problem
from recon.graph.relations import Axis, find_axes, longest
from recon.graph.result import LEAST_SIGHTINGS, map_estimate, sightings
from recon.graph.tape import Tape
from recon.memory import give_back
from recon.sequence.trajectory import Trajectory

Ints = NDArray[np.int64]


REFINEMENTS = 2
"""Solutions between the first, from walls grown along the drive, and the last, with right angles."""
SURVEYED = 2
"""Solutions with control points."""


@dataclass(frozen=True)
class _State:
    """Where the rounds stand. labels (K,): the wall of every observation or NONE; variance (K,): its factor.

    repetition (2,): see Problem.
    """

    poses: Array
    walls: Lines
    labels: Ints
    variance: Array
    odometry: OdometryModel | None = None
    axes: tuple[Axis, ...] = ()
    repetition: Array = field(default_factory=lambda: np.ones(2))


@dataclass(frozen=True)
class _Given:
    """What is measured, and stays as it is."""

    motion: Motion
    observations: WallObservations
    closures: Edges


def solve_graph(
    trajectory: Trajectory,
    motion: Motion,
    observations: WallObservations,
    odometry: Trajectory | None = None,
    config: GraphConfig | None = None,
    closures: Edges | None = None,
    tape: Tape | None = None,
    control: Control | None = None,
) -> MapEstimate:
    """Poses at every scan and wall lines, with covariances, from one factor graph.

    trajectory: N poses to start from, at every scan; its first pose is held and fixes the map frame. motion: the N-1
    scan matches. observations: segments with `pose` in [0, N). odometry: on its own clock ticks, fused with its scale
    and noise estimated. First walls grow along the drive; after a solution those that are one are merged and
    everything is associated anew with the better poses, twice. The first solution, without odometry, tells how good
    odometry and segments are; the second tells which walls are square. closures: places visited again; the trajectory
    agrees with them already, so that walls of all visits are associated from the start. tape: distances between walls
    measured by hand, which the last solution keeps to; control: surveyed points, likewise. Raises InputError where it
    does not know their walls.
    """
    config = config or GraphConfig()
    closures = closures or Edges.none()
    held = motion.held(trajectory.timestamps)
    drift = Drift.solved(len(trajectory)) if len(closures) else Drift.of_motion(held, trajectory.poses)
    given = _Given(held, observations, closures)
    state = _solved(_start(trajectory, drift, observations), given)
    if odometry is not None and len(motion):
        state = replace(state, odometry=fit_odometry(odometry, Trajectory(trajectory.timestamps, state.poses), motion))
    for _ in range(REFINEMENTS):
        state = _drop_rare(_grown(_reassigned(state, observations), observations), observations)
        state = _solved(replace(state, axes=()), given, config.manhattan)
    state = _drop_rare(_reassigned(state, observations), observations)
    problem, solution = _solve(state, given, final=True, tape=tape)
    if control is None:
        return map_estimate(trajectory.timestamps, problem, solution)
    problem, solution, survey = _surveyed(state, given, problem, solution, control)
    return replace(map_estimate(trajectory.timestamps, problem, solution), survey=survey)


def _solved(state: _State, given: _Given, manhattan: bool = False) -> _State:
    """The state after one solution, of which nothing else stays in memory: walls that are one made one, covariances
    multiplied by the variance that it found, and, for `manhattan`, the building's axes."""
    problem, solution = _solve(state, given)
    if manhattan:
        state = replace(state, axes=_axes(state, solution))
    state = _rescaled(_merged(state, solution), problem, solution, given.observations)
    del problem, solution
    give_back()
    return state


def _surveyed(
    state: _State, given: _Given, problem: Problem, solution: Solution, control: Control
) -> tuple[Problem, Solution, Survey]:
    """The solution once more, with the control points that agree with it and one another.

    Twice: a drive that the points have straightened shows as one wall what was several.
    """
    pairs, tape = control.landmarks(problem.walls), problem.tape
    places = control.places(solution.poses, solution.walls, pairs)
    spread = places_covariance(control, solution.poses, solution.walls, pairs, solution.covariance)
    kept, off = agreeing(control, places, spread)
    for _ in range(SURVEYED):
        control = control.moved(problem.walls, solution.walls)
        tape = None if tape is None else tape.moved(problem.walls, solution.walls)
        state = _drop_rare(_reassigned(_merged(state, solution), given.observations), given.observations)
        problem, solution = _solve(state, given, final=True, tape=tape, control=control.only(kept))
    places = control.places(solution.poses, solution.walls, control.landmarks(problem.walls))
    return problem, solution, survey_of(control, kept, off, places, solution.frame, solution.blocks[-1])


def _start(trajectory: Trajectory, drift: Drift, observations: WallObservations) -> _State:
    poses = np.asarray(trajectory.poses, dtype=np.float64)
    lines = Lines.of_observations(observations, poses)
    labels = track(lines, observations.pose, poses, drift)
    state = _State(poses, join(lines, labels), labels, np.ones(len(observations)))
    return _drop_rare(state, observations)


def _solve(
    state: _State, given: _Given, final: bool = False, tape: Tape | None = None, control: Control | None = None
) -> tuple[Problem, Solution]:
    used, observations = np.flatnonzero(state.labels != NONE), given.observations
    scaled = WallObservations(
        observations.pose[used],
        observations.endpoints[used],
        observations.covariance[used] * state.variance[used, None, None],
        observations.image[used],
    )
    problem = Problem(
        state.poses, given.motion, scaled, state.labels[used], state.walls, state.odometry, state.axes, tape,
        given.closures, control, state.repetition if final else np.ones(2),
    )  # fmt: skip
    return problem, optimise(problem, final)


def _merged(state: _State, solution: Solution) -> _State:
    """The state with the solution's poses and walls, those that are one wall made one."""
    count = len(state.walls)
    blocks = solution.blocks[len(solution.poses) :][:count, 1:, 1:]
    walls = Lines(solution.walls[:, :2], solution.walls[:, 2], state.walls.half, blocks)
    group = merge_labels(walls, solution.between_walls)
    labels = np.where(state.labels == NONE, NONE, group[state.labels]) if count else state.labels
    axes = tuple(_renumbered(axis, group) for axis in state.axes)
    return replace(state, poses=solution.poses, walls=join(walls, group), labels=labels, axes=axes)


def _renumbered(axis: Axis, number: Ints) -> Axis:
    """The axis with every wall's new `number` (W,), without those that are gone (NONE)."""
    members, first = np.unique(number[axis.members], return_index=True)
    kept = members != NONE
    return replace(axis, members=members[kept], turns=axis.turns[first][kept])


def _axes(state: _State, solution: Solution) -> tuple[Axis, ...]:
    lengths, count = 2 * state.walls.half, len(state.walls)
    among = longest(lengths)
    pairs = solution.between_walls(np.repeat(np.arange(count), len(among)), np.tile(among, count))
    sigma = np.sqrt(solution.blocks[len(solution.poses) :][:count, 2, 2])
    return tuple(find_axes(solution.walls[:, 2], sigma, pairs[:, 1, 1].reshape(count, len(among)), lengths))


def _rescaled(state: _State, problem: Problem, solution: Solution, observations: WallObservations) -> _State:
    """Covariances of LiDAR and of image segments multiplied by the variance that the solution found."""
    lidar, image = (variance_factor(problem, solution, kind) for kind in ("lidar", "image"))
    variance = state.variance * np.where(observations.image < 0, lidar, image)
    return replace(state, variance=variance, repetition=repetition(problem, solution))


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
