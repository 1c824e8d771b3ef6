"""Right angles and parallels between walls, where the data support them.

A building's walls share an axis up to quarter turns and a small scatter, which is estimated too: walls that are not
quite square keep what was measured of them. A wall joins an axis only where its measured angle to the walls that
already share it is sharp enough to have shown a difference (`POWER`) and shows none, for most of them by length.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array

Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

QUARTER = np.pi / 2
SIGMAS = 2.5
"""Differences up to this many standard deviations are none."""
SCATTER = 0.003
"""rad (0.17 deg): scatter of a right-angled building's walls that the test allows for."""
MIN_SCATTER = 0.001
MAX_SCATTER = 0.005
POWER = 0.0087
"""rad (0.5 deg): angles known worse than this say nothing about being right."""
MAJORITY = 0.7
"""Part of the walls of an axis, by length, that a new one must agree with."""
SUPPORT = 0.25
"""Part of all walls, by length, that an axis must have."""
MIN_WALLS = 3
COMPARED = 300
"""Walls, the longest, with which all others are compared: a building has few directions, however many walls."""


@dataclass(frozen=True)
class Axis:
    """A direction of the building. members: (M,) walls. turns: (M,) quarter turns from the axis to each wall.

    angle: rad. scatter: rad, one standard deviation of the walls about it.
    """

    members: Ints
    turns: Ints
    angle: float
    scatter: float


def longest(lengths: Array) -> Ints:
    """The walls (K,), at most `COMPARED`, in order of their numbers, with which all walls are compared."""
    return np.sort(np.argsort(-lengths, kind="stable")[:COMPARED])


def find_axes(angles: Array, sigma: Array, joint: Array, lengths: Array) -> list[Axis]:
    """Axes of a building from wall angles (W,) rad with their deviations (W,), and lengths (W,) m.

    joint: (W, K) covariance of all walls' angles with those of the `longest` walls, which found the axes.
    """
    among = longest(lengths)
    difference = _fold(angles[:, None] - angles[among])
    variance = np.maximum(sigma[:, None] ** 2 + sigma[among] ** 2 - 2 * joint, 0)
    sharp = variance <= POWER**2
    sharp[among, np.arange(len(among))] = False
    agrees = sharp & (np.abs(difference) <= SIGMAS * np.sqrt(variance + 2 * SCATTER**2))
    free = np.ones(len(angles), dtype=bool)
    axes = []
    while free[among].any():
        group = _grow(agrees & free[among] & free[:, None], sharp, lengths, among)
        if len(group) < MIN_WALLS or lengths[group].sum() < SUPPORT * lengths.sum():
            break
        axes.append(_fit(group, among, angles, joint, lengths))
        free[group] = False
    return axes


def _grow(agrees: Bools, sharp: Bools, lengths: Array, among: Ints) -> Ints:
    """The walls that share an axis with the wall `among` the longest that most others, by length, agree with."""
    seed = among[np.argmax((lengths @ agrees) * agrees.any(axis=0))]
    member = np.zeros(len(lengths), dtype=bool)
    member[seed] = True
    while True:
        weight = np.where(member, lengths, 0.0)[among]
        for_it, tested = agrees @ weight, sharp @ weight
        new = ~member & (for_it > 0) & (for_it >= MAJORITY * tested)
        if not new[among].any():
            return np.flatnonzero(member | new)
        # the best supported first: it may decide about the others
        member[among[np.argmax(np.where(new, for_it, 0.0)[among])]] = True


def _fit(group: Ints, among: Ints, angles: Array, joint: Array, lengths: Array) -> Axis:
    """Axis of the walls `group`: mean of the longest weighted by length, and their scatter beyond what was measured."""
    column = np.flatnonzero(np.isin(among, group))
    base = among[column]
    reference = angles[base[np.argmax(lengths[base])]]
    weight = lengths[base] / lengths[base].sum()
    away = _fold(angles[group] - reference)
    seen = _fold(angles[base] - reference)
    mean = float(weight @ seen)
    centre = np.eye(len(base)) - weight[None]
    measured = np.diag(centre @ joint[np.ix_(base, column)] @ centre.T)
    excess = float(np.mean((seen - mean) ** 2 - measured))
    turns = np.round((angles[group] - reference - away) / QUARTER).astype(np.int64)
    scatter = float(np.clip(np.sqrt(max(excess, 0.0)), MIN_SCATTER, MAX_SCATTER))
    return Axis(group, turns, float(reference + mean), scatter)


def _fold(angle: Array) -> Array:
    """Angles brought into [-45, 45) degrees by quarter turns."""
    return np.asarray((angle + QUARTER / 2) % QUARTER - QUARTER / 2)
