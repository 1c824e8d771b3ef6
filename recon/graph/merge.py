"""Wall lines that are the same wall: collinear, the same free side, overlapping or nearly touching."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array
from recon.graph.association import GATE, MAX_TURN
from recon.graph.line import FLATNESS, Difference, Lines, squared_distance

Ints = NDArray[np.int64]

IN_LINE = 0.002
"""m: flatness of walls on either side of an opening; two door leaves in niches of nearly one depth differ by more."""
MAX_GAP = 2.5
"""m: a wall goes on behind an opening of this width (a double door)."""
POWER = 0.02
"""m: two pieces are one wall only where a step of a few times this between them would have shown."""


def merge_labels(walls: Lines, joint: Array) -> Ints:
    """New label (W,) of every wall, counted from 0; walls that are one share it.

    joint: (2W, 2W) covariance between all walls' (offset, angle). Two walls are the same where the difference between
    their lines, halfway between them, passes the chi-square test with the exact covariance of that difference and the
    flatness of walls. Every two pieces of one wall must pass (complete linkage), so that a vague piece between a wall
    and a recess cannot join the two.
    """
    apart = Difference.between(walls, walls)
    distance, sigma = _compare(walls, apart, joint)
    sure = (apart.gap <= 0) | (sigma <= POWER)
    same = (distance <= GATE) & (np.abs(apart.angle) <= MAX_TURN)
    near = same & sure & (apart.gap <= MAX_GAP)
    compatible = same & same.T
    first, second = np.nonzero(np.triu(near | near.T, 1))
    order = np.argsort(np.maximum(distance, distance.T)[first, second], kind="stable")
    label = np.arange(len(walls))
    for a, b in zip(first[order], second[order], strict=True):
        left, right = np.flatnonzero(label == label[a]), np.flatnonzero(label == label[b])
        if label[a] != label[b] and compatible[np.ix_(left, right)].all():
            label[right] = label[a]
    return np.asarray(np.unique(label, return_inverse=True)[1])


def _compare(walls: Lines, apart: Difference, joint: Array) -> tuple[Array, Array]:
    """Squared distance and standard deviation of the offset (both (W, W)) between walls, row seen from column."""
    n = len(walls)
    half = walls.half
    # the reference is the middle of where the stretches overlap, or of the gap between them
    low = np.maximum(-half[None], apart.along - half[:, None])
    high = np.minimum(half[None], apart.along + half[:, None])
    in_column = (low + high) / 2
    in_row = (in_column - apart.along) * np.cos(apart.angle)
    blocks = joint.reshape(n, 2, n, 2).transpose(0, 2, 1, 3)
    diagonal = blocks[np.arange(n), np.arange(n)]
    row, column = _lever(in_row), _lever(in_column)
    cross = row @ blocks @ column.transpose(0, 1, 3, 2)
    spread = row @ diagonal[:, None] @ row.transpose(0, 1, 3, 2) - cross - cross.transpose(0, 1, 3, 2)
    spread = spread + column @ diagonal[None] @ column.transpose(0, 1, 3, 2)
    sigma = np.sqrt(np.maximum(spread[..., 0, 0], 0))
    shorter = np.maximum(np.minimum(half[:, None], half[None]), FLATNESS)
    flatness = np.where(apart.gap <= 0, FLATNESS, IN_LINE)
    spread[..., 0, 0] = sigma**2 + flatness**2
    spread[..., 1, 1] = np.maximum(spread[..., 1, 1], 0) + (flatness / shorter) ** 2
    offset = apart.offset + in_row * np.sin(apart.angle)
    return squared_distance(offset, apart.angle, spread), sigma


def _lever(along: Array) -> Array:
    """(..., 2, 2) matrices that take (offset, angle) of a line to `along` (...,) metres from its origin."""
    out = np.zeros((*along.shape, 2, 2))
    out[..., 0, 0] = out[..., 1, 1] = 1.0
    out[..., 0, 1] = along
    return out


def join(walls: Lines, label: Ints) -> Lines:
    """One line for every label, fused from its walls by their own covariances, around the middle of their stretch."""
    parts = []
    for group in range(int(label.max()) + 1 if len(label) else 0):
        members = walls[label == group]
        longest = members[np.array([np.argmax(members.half)])]
        apart = Difference.between(members, longest)
        along, angle = apart.along[:, 0], apart.angle[:, 0]
        back = _lever(-along)
        information = np.linalg.inv(back @ members.covariance @ back.transpose(0, 2, 1))
        offset = apart.offset[:, 0] - along * angle
        total = np.linalg.inv(information.sum(axis=0))
        shift = total @ np.einsum("kij,kj->i", information, np.stack([offset, angle], axis=1))
        low, high = (along - members.half).min(), (along + members.half).max()
        parts.append(_moved(longest, shift, total, float(low), float(high)))
    return Lines.concatenate(parts) if parts else walls


def _moved(line: Lines, shift: Array, covariance: Array, low: float, high: float) -> Lines:
    """`line` moved by `shift` (offset, angle), its origin in the middle of [low, high]."""
    angle = line.angle + shift[1]
    normal = np.array([[-np.sin(line.angle[0]), np.cos(line.angle[0])]])
    middle = (low + high) / 2
    direction = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    lever = _lever(np.array([middle]))
    return Lines(
        line.middle + normal * shift[0] + direction * middle,
        angle,
        np.array([(high - low) / 2]),
        lever @ covariance[None] @ lever.transpose(0, 2, 1),
    )
