"""Points whose place is known from a survey: where the platform stood, and corners of walls, as factors.

The survey has a frame of its own. Where the map lies in it is one more Pose2 of the graph, map_from_survey; a point is
a between factor from it to a pose, or to each of the two walls that meet in a corner, without information on angles.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from recon.errors import InputError
from recon.geometry import Array, align2, apply2, between2, compose2, inverse2, rotation2
from recon.graph.estimate import Survey
from recon.graph.line import Lines
from recon.graph.tape import carried, landmark_pairs

if TYPE_CHECKING:
    from recon.graph.covariance import Covariance

Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

CRITICAL = 13.8
"""Chi-square of two degrees of freedom, 99.9 %: points further off contradict the others."""
DOUBT, WEIGHT = 3.0, 2.0
"""How many times larger than its covariance says a drive's error may be, held with the weight of so many differences:
scan matches share errors that no covariance knows."""
LEAST_SPREAD = 0.5
"""m: points closer together than this do not give the map a direction."""


@dataclass(frozen=True)
class Control:
    """M marks on the floor, over which the platform's origin stood, then C corners: K = M + C points.

    scan, other (M,), part (M,): mark m was passed at `part` (0 to 0.5) of the way from scan to its neighbour `other`.
    first, second: (C,) the walls of the corners, as they are in a map that was made without the points. position:
    (K, 2) m, survey frame. sigma: (K,) m, one standard deviation of x and of y. names: (K,) for messages.
    """

    scan: Ints
    other: Ints
    part: Array
    first: Lines
    second: Lines
    position: Array
    sigma: Array
    names: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.position)

    @property
    def marks(self) -> int:
        """How many of the points are marks; they come first."""
        return len(self.scan)

    @property
    def centre(self) -> Array:
        """(2,) m: survey coordinates count from here inside the graph, which knows no kilometres."""
        return np.asarray(np.round(self.position.mean(axis=0)))

    def only(self, kept: Bools) -> Control:
        """The points with kept (K,)."""
        marks, corners = kept[: self.marks], kept[self.marks :]
        return Control(
            self.scan[marks],
            self.other[marks],
            self.part[marks],
            self.first[corners],
            self.second[corners],
            self.position[kept],
            self.sigma[kept],
            tuple(name for name, k in zip(self.names, kept, strict=True) if k),
        )

    def moved(self, walls: Lines, poses: Array) -> Control:
        """The corners' walls as they are now that the landmarks `walls` are at `poses` (W, 3)."""
        first, second = self.landmarks(walls).T
        return replace(
            self, first=carried(self.first, walls, poses, first), second=carried(self.second, walls, poses, second)
        )

    def landmarks(self, walls: Lines) -> Ints:
        """(C, 2) rows of `walls` that meet in the corners; InputError where no landmark is there any more."""
        found, missing = landmark_pairs(self.first, self.second, walls)
        if len(missing):
            raise InputError(f"{self.names[self.marks + missing[0]]}: one of the walls is not measured by the scans")
        return found

    def levers(self, poses: Array) -> Array:
        """(M, 2) m: the marks seen from the poses (N, 3) of their scans."""
        way = between2(poses[self.scan], poses[self.other])
        return np.asarray(self.part[:, None] * way[:, :2])

    def places(self, poses: Array, walls: Array, pairs: Ints) -> Array:
        """(K, 2) m: where the points are in a map of `poses` (N, 3) and `walls` (W, 3); pairs (C, 2): see landmarks."""
        marks = compose2(poses[self.scan], np.column_stack([self.levers(poses), np.zeros(self.marks)]))[:, :2]
        return np.concatenate([marks, _crossings(walls[pairs[:, 0]], walls[pairs[:, 1]])])


def _crossings(first: Array, second: Array) -> Array:
    """(C, 2) m: where lines along the poses (C, 3) meet."""
    normals = np.stack([_normals(first), _normals(second)], axis=1)
    offsets = np.stack([np.sum(_normals(p) * p[:, :2], axis=1) for p in (first, second)], axis=1)
    return np.asarray(np.linalg.solve(normals, offsets[..., None]))[..., 0]


def _normals(poses: Array) -> Array:
    return np.stack([-np.sin(poses[:, 2]), np.cos(poses[:, 2])], axis=1)


def fitted_frame(control: Control, places: Array) -> Array:
    """map_from_survey (3,) that brings the points, counted from their centre, closest to `places` (K, 2) in the map.

    Raises InputError for fewer than two points, and for points that all lie at one place.
    """
    local = control.position - control.centre
    apart = np.linalg.norm(local - local.mean(axis=0), axis=1).max(initial=0.0)
    if len(control) < 2 or apart < LEAST_SPREAD / 2:
        what = f"{len(control)} point" if len(control) < 2 else f"{len(control)} points within {2 * apart:.2g} m"
        raise InputError(f"{control.names[0] if len(control) else 'control'}: {what}, expected two or more places")
    return align2(local, places)


def control_factors(
    control: Control, frame: Array, poses: Array, walls: Array, pairs: Ints
) -> tuple[Ints, Ints, Array, Array]:
    """Between factors: marks from the frame (3,) to poses, then corners from walls to the frame, two each.

    Returns the poses (M,) and walls (2C,) they tie, the measured relative poses (M + 2C, 3) and the square roots
    (M + 2C, 3, 3) of their information. A tie moves a point that lies off the origin of the later frame when it turns,
    which is what the roots' last columns say.
    """
    m, local = control.marks, control.position - control.centre
    lever = control.levers(poses)
    relative = between2(frame, poses[control.scan]).reshape(-1, 3)
    c, s = np.cos(relative[:, 2]), np.sin(relative[:, 2])
    turned = np.stack([c * lever[:, 0] - s * lever[:, 1], s * lever[:, 0] + c * lever[:, 1]], axis=1)
    relative[:, :2] = local[:m] - turned
    root = np.zeros((m, 3, 3))
    root[:, 0, 0] = root[:, 1, 1] = 1.0
    root[:, 0, 2], root[:, 1, 2] = -lever[:, 1], lever[:, 0]

    rows, points = pairs.reshape(-1), np.repeat(local[m:], 2, axis=0)
    seen = between2(walls[rows], frame).reshape(-1, 3)
    c, s = np.cos(seen[:, 2]), np.sin(seen[:, 2])
    across = s * points[:, 0] + c * points[:, 1]
    seen[:, 1] = -across
    on_line = np.zeros((len(rows), 3, 3))
    on_line[:, 0] = np.stack([s, c, c * points[:, 0] - s * points[:, 1]], axis=1)
    sigma = np.concatenate([control.sigma[:m], np.repeat(control.sigma[m:], 2)])
    roots = np.concatenate([root, on_line]) / sigma[:, None, None]
    return control.scan, rows, np.concatenate([relative, seen]), roots


def places_covariance(control: Control, poses: Array, walls: Array, pairs: Ints, covariance: Covariance) -> Array:
    """(2K, 2K) m^2: of the points' places in the map, whose variables (poses, then walls) have `covariance`."""
    used = np.unique(np.concatenate([control.scan, len(poses) + pairs.reshape(-1)]))
    change = np.zeros((len(control), 2, len(used), 3))
    for k, (scan, lever) in enumerate(zip(control.scan, control.levers(poses), strict=True)):
        turn = rotation2(poses[scan, 2])
        change[k, :, np.searchsorted(used, scan)] = np.column_stack([turn, turn @ [-lever[1], lever[0]]])
    places = control.places(poses, walls, pairs)[control.marks :]
    for k, (pair, place) in enumerate(zip(pairs, places, strict=True), start=control.marks):
        inverse = np.linalg.inv(_normals(walls[pair]))
        for side, wall in enumerate(pair):
            along = float((place - walls[wall, :2]) @ rotation2(walls[wall, 2])[:, 0])
            change[k, :, np.searchsorted(used, len(poses) + wall)] = np.outer(inverse[:, side], [0.0, 1.0, along])
    first, second = (index.reshape(-1) for index in np.meshgrid(used, used, indexing="ij"))
    joint = covariance.between(first, second).reshape(len(used), len(used), 3, 3).transpose(0, 2, 1, 3)
    flat = change.reshape(2 * len(control), 3 * len(used))
    return np.asarray(flat @ joint.reshape(3 * len(used), -1) @ flat.T)


def survey_of(control: Control, kept: Bools, off: Array, places: Array, frame: Array, covariance: Array) -> Survey:
    """What is reported: kept, off (K,) as `agreeing` has them, places (K, 2) in the map, frame (3,) map_from_survey.

    covariance: (3, 3) of the frame, in its own axes.
    """
    survey_from_map = compose2([*control.only(kept).centre, 0.0], inverse2(frame))
    return Survey(survey_from_map, np.sqrt(np.diag(covariance)), apply2(survey_from_map, places), kept, off)


def agreeing(control: Control, places: Array, covariance: Array) -> tuple[Bools, Array]:
    """Which points (K,) agree with the others and the map, and how far off (K,) each is, in standard deviations.

    places: (K, 2) m, where a map made without the points has them, with covariance (2K, 2K). Data snooping (Baarda
    1968): the point that contradicts the rest most is left out as long as that is beyond chance, by the larger of the
    covariance and what the rest show. Two points cannot tell which of them is wrong.
    """
    kept, off = np.ones(len(control), np.bool_), np.zeros(len(control))
    while True:
        rows = np.flatnonzero(kept)
        squared, total = _contradictions(control.only(kept), places[rows], covariance[_pairs_of(rows)])
        off[rows] = np.sqrt(squared)
        worst = int(np.argmax(squared))
        freedom = 2 * (len(rows) - 1) - 3
        factor = (total - squared[worst] + WEIGHT * DOUBT**2) / (freedom + WEIGHT)
        if len(rows) == 2 or squared[worst] <= CRITICAL * max(1.0, factor):
            return kept, off
        kept[rows[worst]] = False


def _pairs_of(rows: Ints) -> tuple[Ints, ...]:
    index = (2 * rows[:, None] + np.arange(2)).reshape(-1)
    return np.ix_(index, index)


def _contradictions(control: Control, places: Array, covariance: Array) -> tuple[Array, float]:
    """(K,) squared normalised difference of each point from what all others say of it, and that of all together."""
    frame = fitted_frame(control, places)
    local = control.position - control.centre
    expected = apply2(frame, local)
    design = np.zeros((2 * len(control), 3))
    design[0::2, 0] = design[1::2, 1] = 1.0
    away = expected - frame[:2]
    design[0::2, 2], design[1::2, 2] = -away[:, 1], away[:, 0]
    weight = np.linalg.inv(covariance + np.diag(np.repeat(control.sigma, 2) ** 2))
    normal = design.T @ weight @ design
    reduced = weight - weight @ design @ np.linalg.solve(normal, design.T @ weight)
    rest = (places - expected).reshape(-1)
    pull = (reduced @ rest).reshape(-1, 2)
    own = reduced.reshape(len(control), 2, len(control), 2)[np.arange(len(control)), :, np.arange(len(control))]
    squared = np.einsum("ki,kij,kj->k", pull, np.linalg.pinv(own, rcond=1e-9, hermitian=True), pull)
    return np.maximum(squared, 0.0), float(rest @ reduced @ rest)
