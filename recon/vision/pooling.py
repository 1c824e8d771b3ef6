"""What each frame says about the shared vertical, and all of it put together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from recon.geometry import Array, cross
from recon.vision.families import fit_vertical
from recon.vision.planes import Planes
from recon.vision.vanishing import CONSISTENT

SWAYS = np.deg2rad([0.005, 0.01, 0.02, 0.04, 0.07, 0.1, 0.15, 0.2, 0.3, 0.4, 0.55, 0.75, 1.0, 1.4])
MAX_OFFSET = np.deg2rad(4.0)  # a frame further off has found something else
MEDIAN_OF_CHI2 = 1.386  # two degrees of freedom
STUDENT = 3.0  # degrees of freedom of the heavy-tailed law for frames: a frame of clutter is one bad number


@dataclass(frozen=True)
class Opinions:
    """What F frames say. offsets: (F, 2) rad, each frame's vertical in the tangent plane of the shared one;
    information: (F, 2, 2) 1 / rad^2, its inverse covariance, singular where one frame cannot tell."""

    offsets: Array
    information: Array


def tangent_basis(direction: Array) -> Array:
    """(2, 3) rows b1, b2 orthogonal to the unit vector `direction` (3,), with b1 x b2 = direction."""
    first = cross(direction, np.array([0.0, 0.0, 1.0]) if abs(direction[2]) < 0.9 else np.array([1.0, 0.0, 0.0]))
    first /= np.linalg.norm(first)
    return np.stack([first, cross(direction, first)])


def ask_frames(every: list[Planes], vertical: Array) -> Opinions:
    """Fit every frame's own vertical near the shared one and carry it to the tangent plane.

    A rotation by r1 b2 - r2 b1 moves the vertical by (r1, r2) along (b1, b2).
    """
    basis = tangent_basis(vertical)
    turn = np.stack([basis[1], -basis[0]], axis=1)
    offsets, information = [], []
    for planes in every:
        found = fit_vertical(planes, vertical)
        if found is not None and found[0] @ vertical > np.cos(MAX_OFFSET):
            offsets.append(basis @ found[0])
            information.append(turn.T @ found[1] @ turn)
    return Opinions(np.array(offsets).reshape(-1, 2), np.array(information).reshape(-1, 2, 2))


def pool(opinions: Opinions) -> tuple[Array, Array]:
    """The common offset (2,), rad, and its covariance (2, 2).

    Frames sway about their common vertical (a platform nods, a rolling shutter leans): with a standard deviation j a
    frame has the covariance information^-1 + j^2, and j is the least with which the frames scatter as they should.
    """
    for sway in SWAYS:
        weights = _with_sway(opinions.information, sway)
        mean, misfit, trust = _robust_mean(opinions.offsets, weights)
        if np.median(misfit) <= MEDIAN_OF_CHI2:
            break
    total = np.einsum("f,fij->ij", trust, weights)
    if not np.linalg.cond(total) < 1e12:
        return mean, np.full((2, 2), np.inf)
    formal = np.linalg.inv(total)
    pull = trust[:, None] * np.einsum("fij,fj->fi", weights, opinions.offsets - mean)
    block = np.arange(len(pull)) // int(np.ceil(np.sqrt(len(pull))))  # neighbours see the same lines
    pull = np.stack([np.bincount(block, pull[:, k]) for k in (0, 1)], axis=1)
    scatter = formal @ (pull.T @ pull) @ formal
    larger = np.linalg.eigvalsh(scatter)[-1] > np.linalg.eigvalsh(formal)[-1]
    return mean, scatter if larger else formal


def _with_sway(information: Array, sway: float) -> Array:
    """(F, 2, 2) inverses of (information^-1 + sway^2), also where the information is singular."""
    return np.asarray(np.linalg.solve(np.eye(2) + sway**2 * information, information))


def _robust_mean(offsets: Array, weights: Array) -> tuple[Array, Array, Array]:
    """Mean (2,), squared Mahalanobis distances (F,) from it and the trust (F,) in each frame, under Student's law."""
    mean, trust = np.zeros(2), np.ones(len(offsets))
    misfit = np.zeros(len(offsets))
    for _ in range(15):
        step = offsets - mean
        misfit = np.einsum("fi,fij,fj->f", step, weights, step)
        trust = (STUDENT + 2) / (STUDENT + misfit)
        total = np.einsum("f,fij->ij", trust, weights)
        mean = np.linalg.lstsq(total, np.einsum("f,fij,fj->i", trust, weights, offsets), rcond=1e-9)[0]
    return mean, misfit, trust


def count_agreeing(every: list[Planes], vertical: Array) -> int:
    """Number of lines that point to `vertical` (3,)."""
    return sum(int(np.count_nonzero(np.abs(p.residuals(vertical[None])) < CONSISTENT)) for p in every)
