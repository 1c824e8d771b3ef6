"""The vertical of one frame from its families of parallel lines, whatever the angles between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from recon.geometry import Array, cross
from recon.vision.planes import Planes, tukey
from recon.vision.vanishing import MIN_LINES, horizontal_votes

MAX_FAMILIES = 4
MIN_FAMILY = 4  # lines: fewer horizontal ones agree by chance
ITERATIONS = 6


@dataclass(frozen=True)
class Family:
    """Normal equations of the lines of one direction for a small rotation: normal (3, 3), gradient (3,); the weighted
    sum of squared residuals, the sum of weights, and how many lines have one."""

    normal: Array
    gradient: Array
    square: float
    weight: float
    lines: int

    def about(self, axis: Array) -> Array:
        """(3,) what a turn about `axis` (3,) does to the gradient, per unit of the gradient along it."""
        pull = self.normal @ axis
        own = float(axis @ pull)
        return np.asarray(pull / own if own > 1e-9 else np.zeros(3))


def fit_vertical(planes: Planes, start: Array) -> tuple[Array, Array] | None:
    """The vertical (3,) near `start` and its information (3, 3), 1 / rad^2, on small rotations; None with few lines.

    Vertical lines, and up to four families of horizontal ones: a family tells how the horizon lies where it meets it.
    Each family's bearing is free (marginalised), so no angle between walls is assumed. Reweighted Gauss-Newton.
    """
    vertical, levels = start, horizontal_votes(planes, start, MAX_FAMILIES, np.pi)
    for k in range(ITERATIONS):
        families = _families(planes, vertical, levels, 2.0 if k < 2 else 1.0)  # from a coarse start: first wide
        if sum(f.lines for f in families) < MIN_LINES:
            return None
        information, pull = np.zeros((3, 3)), np.zeros(3)
        for f in families:
            leverage = f.about(vertical)
            information += f.normal - np.outer(leverage, vertical @ f.normal)
            pull += f.gradient - leverage * (vertical @ f.gradient)
        tilt = -np.linalg.lstsq(information, pull, rcond=1e-9)[0]
        for i, f in enumerate(families[1:]):
            own = float(vertical @ f.normal @ vertical)
            bearing = -float(vertical @ (f.normal @ tilt + f.gradient)) / own if own > 1e-9 else 0.0
            levels[i] += cross(tilt + bearing * vertical, levels[i])
        vertical = vertical + cross(tilt, vertical)
        vertical /= np.linalg.norm(vertical)
        levels -= np.outer(levels @ vertical, vertical)
        levels /= np.linalg.norm(levels, axis=1, keepdims=True)
    scatter = sum(f.square for f in families) / sum(f.weight for f in families)
    return vertical, information / max(1.0, scatter)


def _families(planes: Planes, vertical: Array, levels: Array, scale: float) -> list[Family]:
    """The family of the vertical and those of horizontal directions `levels` (K, 3); each line is in the nearest."""
    directions = np.concatenate([vertical[None], levels])
    residuals = planes.residuals(directions)
    nearest = np.argmin(np.abs(residuals), axis=1)
    out = []
    for d, direction in enumerate(directions):
        mine = nearest == d
        error = residuals[mine, d]
        weight = tukey(error, scale)
        if d > 0 and np.count_nonzero(weight) < MIN_FAMILY:
            weight = np.zeros(len(weight))
        jacobian = cross(direction, planes[mine].scaled_normals(direction))
        weighted = (jacobian * weight[:, None]).T
        counts = (float(weight @ error**2), float(weight.sum()), int(np.count_nonzero(weight)))
        out.append(Family(weighted @ jacobian, weighted @ error, *counts))
    return out
