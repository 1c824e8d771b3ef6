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


@dataclass(frozen=True)
class Axis:
    """A direction of the building. members: (M,) walls. turns: (M,) quarter turns from the axis to each wall.

    angle: rad. scatter: rad, one standard deviation of the walls about it.
    """

    members: Ints
    turns: Ints
    angle: float
    scatter: float


def find_axes(angles: Array, joint: Array, lengths: Array) -> list[Axis]:
    """Axes of a building from wall angles (W,) rad, their joint covariance (W, W) and lengths (W,) m."""
    difference = _fold(angles[:, None] - angles[None])
    variance = np.maximum(np.diag(joint)[:, None] + np.diag(joint)[None] - 2 * joint, 0)
    sharp = variance <= POWER**2
    np.fill_diagonal(sharp, False)
    agrees = sharp & (np.abs(difference) <= SIGMAS * np.sqrt(variance + 2 * SCATTER**2))
    free = np.ones(len(angles), dtype=bool)
    axes = []
    while free.any():
        group = _grow(agrees & free & free[:, None], sharp, lengths)
        if len(group) < MIN_WALLS or lengths[group].sum() < SUPPORT * lengths.sum():
            break
        axes.append(_fit(group, angles, joint, lengths))
        free[group] = False
    return axes


def _grow(agrees: Bools, sharp: Bools, lengths: Array) -> Ints:
    """The walls that share an axis with the wall that most others, by length, agree with."""
    seed = int(np.argmax((agrees @ lengths) * agrees.any(axis=1)))
    member = np.zeros(len(lengths), dtype=bool)
    member[seed] = True
    while True:
        weight = np.where(member, lengths, 0.0)
        for_it, tested = agrees @ weight, sharp @ weight
        new = ~member & (for_it > 0) & (for_it >= MAJORITY * tested)
        if not new.any():
            return np.flatnonzero(member)
        # the best supported first: it may decide about the others
        member[np.argmax(np.where(new, for_it, 0.0))] = True


def _fit(group: Ints, angles: Array, joint: Array, lengths: Array) -> Axis:
    """Axis of the walls `group`: their mean weighted by length, and the scatter beyond what was measured."""
    reference = angles[group[np.argmax(lengths[group])]]
    weight = lengths[group] / lengths[group].sum()
    away = _fold(angles[group] - reference)
    mean = float(weight @ away)
    centre = np.eye(len(group)) - weight[None]
    measured = np.diag(centre @ joint[np.ix_(group, group)] @ centre.T)
    excess = float(np.mean((away - mean) ** 2 - measured))
    turns = np.round((angles[group] - reference - away) / QUARTER).astype(np.int64)
    scatter = float(np.clip(np.sqrt(max(excess, 0.0)), MIN_SCATTER, MAX_SCATTER))
    return Axis(group, turns, float(reference + mean), scatter)


def _fold(angle: Array) -> Array:
    """Angles brought into [-45, 45) degrees by quarter turns."""
    return np.asarray((angle + QUARTER / 2) % QUARTER - QUARTER / 2)
