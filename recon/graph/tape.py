"""Distances between walls that people measured, as factors between wall landmarks."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from recon.errors import InputError
from recon.geometry import Array, between2, compose2, inverse2
from recon.graph.line import Difference, Lines

Ints = NDArray[np.int64]

NEAR = 0.15
"""m: a landmark this far off the line that was named is another wall."""
TAPE_ROBUST = 10.0
"""Normalised residual beyond which a distance loses its hold: a slip of the pen is many times that, the scanner's own
scale, which the distance is to put right, is not."""
SAME_WAY = np.radians(5.0)
"""rad: and so is one turned this far."""


@dataclass(frozen=True)
class Tape:
    """T measured distances (T,), m, with standard deviations sigma (T,), m, between walls given by where they lie.

    first, second: the two walls as they are in a map that was made without the distances. names: (T,) for messages.
    """

    first: Lines
    second: Lines
    distance: Array
    sigma: Array
    names: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.distance)

    def landmarks(self, walls: Lines) -> Ints:
        """(T, 2) rows of `walls` that the distances lie between; InputError where no landmark is there any more."""
        found, missing = landmark_pairs(self.first, self.second, walls)
        if len(missing):
            raise InputError(
                f"{self.names[missing[0]]}: one of the walls is not measured by the scans, or both are one"
            )
        return found

    def moved(self, walls: Lines, poses: Array) -> Tape:
        """The measured walls as they are now that the landmarks `walls` are at `poses` (W, 3)."""
        first, second = self.landmarks(walls).T
        return replace(
            self, first=carried(self.first, walls, poses, first), second=carried(self.second, walls, poses, second)
        )


def carried(lines: Lines, walls: Lines, poses: Array, rows: Ints) -> Lines:
    """`lines` (T,) moved as their landmarks `rows` (T,) of `walls` have moved, which now are at `poses` (W, 3)."""
    placed = compose2(compose2(poses[rows], inverse2(walls.pose[rows])), lines.pose).reshape(-1, 3)
    return replace(lines, middle=placed[:, :2], angle=placed[:, 2])


def landmark_pairs(first: Lines, second: Lines, walls: Lines) -> tuple[Ints, Ints]:
    """Rows (T, 2) of `walls` that pairs of lines lie along, and the numbers of the pairs without two of them."""
    found = np.stack([walls_along(first, walls), walls_along(second, walls)], axis=1)
    return found, np.flatnonzero((found < 0).any(axis=1) | (found[:, 0] == found[:, 1]))


def walls_along(lines: Lines, walls: Lines) -> Ints:
    """(T,) the wall along each line that shares the longest stretch with it, -1 where there is none."""
    apart = Difference.between(lines, walls)
    shared = np.where((np.abs(apart.offset) < NEAR) & (np.abs(apart.angle) < SAME_WAY), -apart.gap, -np.inf)
    shared = np.minimum(shared, 2 * lines.half[:, None]) - 2 * np.abs(apart.offset)  # of equals the one in line
    best = np.argmax(shared, axis=1)
    return np.where(shared[np.arange(len(best)), best] > 0, best, -1)


@dataclass(frozen=True)
class Spans:
    """How pairs of walls lie to each other where they are measured: halfway along the stretch that they share.

    relative: (T, 3) the second seen from the first. along: (T,) m from the second's origin to the place, along it.
    signed: (T,) m from the first's line to the place, towards its free space.
    """

    relative: Array
    along: Array
    signed: Array

    @staticmethod
    def between(first: Array, second: Array, first_half: Array, second_half: Array) -> Spans:
        """Of walls at poses (T, 3) that reach `half` (T,) m on either side of their origins."""
        relative = between2(first, second)
        c, s = np.cos(relative[:, 2]), np.sin(relative[:, 2])
        reach = second_half * np.abs(c)
        low, high = np.maximum(-first_half, relative[:, 0] - reach), np.minimum(first_half, relative[:, 0] + reach)
        along = ((low + high) / 2 - relative[:, 0]) / c
        return Spans(relative, along, relative[:, 1] + along * s)


def tape_spans(tape: Tape, walls: Lines, poses: Array) -> tuple[Ints, Spans]:
    """The landmarks (T, 2) of `tape` among `walls`, and how they lie to each other now that they are at `poses`."""
    pairs = tape.landmarks(walls)
    first, second = pairs.T
    return pairs, Spans.between(poses[first], poses[second], walls.half[first], walls.half[second])


def tape_factors(spans: Spans, tape: Tape) -> tuple[Array, Array]:
    """Measured poses (T, 3) of the second wall in the first one's frame, and the square roots (T, 3, 3) of their
    information, which is about the distance alone."""
    x, _, yaw = spans.relative.T
    y = np.where(spans.signed < 0, -tape.distance, tape.distance) - spans.along * np.sin(yaw)
    root = np.zeros((len(tape), 3, 3))
    root[:, 0] = np.stack([np.sin(yaw), np.cos(yaw), spans.along * np.cos(yaw)], axis=1) / tape.sigma[:, None]
    return np.stack([x, y, yaw], axis=1), root
