"""Wall lines that are the same wall: collinear, the same free side, overlapping or nearly touching."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array
from recon.graph.association import GATE, MAX_TURN
from recon.graph.line import FLATNESS, Difference, Lines, carry, squared_distance

Ints = NDArray[np.int64]

IN_LINE = 0.002
"""m: flatness of walls on either side of an opening; two door leaves in niches of nearly one depth differ by more."""
MAX_GAP = 2.5
"""m: a wall goes on behind an opening of this width (a double door)."""
MAX_OFFSET = 1.0
"""m: walls further apart than this, one's middle off the other's line, are not compared."""
POWER = 0.02
"""m: two pieces are one wall only where a step of a few times this between them would have shown."""


def merge_labels(walls: Lines, joint: Array) -> Ints:
    """New label (W,) of every wall, counted from 0; walls that are one share it.

    joint: (2W, 2W) covariance between all walls' (offset, angle). Two walls are the same where the difference between
    their lines, halfway between them, passes the chi-square test with the exact covariance of that difference and the
    flatness of walls. Every two pieces of one wall must pass (complete linkage), so that a vague piece between a wall
    and a recess cannot join the two.
    """
    count = len(walls)
    apart = Difference.between(walls, walls)
    row, column = np.nonzero((np.abs(apart.angle) <= MAX_TURN) & (np.abs(apart.offset) <= MAX_OFFSET))
    gap = apart.gap[row, column]
    distance, near = np.full((count, count), np.inf), np.zeros((count, count), dtype=bool)
    distance[row, column], sigma = _compare(walls, apart, joint, row, column)
    near[row, column] = (gap <= 0) | ((sigma <= POWER) & (gap <= MAX_GAP))
    compatible = np.maximum(distance, distance.T) <= GATE
    near &= compatible
    first, second = np.nonzero(np.triu(near | near.T, 1))
    order = np.argsort(np.maximum(distance, distance.T)[first, second], kind="stable")
    label = np.arange(len(walls))
    for a, b in zip(first[order], second[order], strict=True):
        left, right = np.flatnonzero(label == label[a]), np.flatnonzero(label == label[b])
        if label[a] != label[b] and compatible[np.ix_(left, right)].all():
            label[right] = label[a]
    return np.asarray(np.unique(label, return_inverse=True)[1])


def _compare(walls: Lines, apart: Difference, joint: Array, row: Ints, column: Ints) -> tuple[Array, Array]:
    """Squared distance and sigma of the offset (both (P,)) between pairs of walls, row seen from column."""
    along, offset, angle = apart.along[row, column], apart.offset[row, column], apart.angle[row, column]
    row_half, column_half = walls.half[row], walls.half[column]
    # the reference is the middle of where the stretches overlap, or of the gap between them
    in_column = (np.maximum(-column_half, along - row_half) + np.minimum(column_half, along + row_half)) / 2
    in_row = (in_column - along) * np.cos(angle)
    blocks = joint.reshape(len(walls), 2, len(walls), 2)
    to_row, to_column = _lever(in_row), _lever(in_column)
    cross = to_row @ blocks[row, :, column] @ to_column.transpose(0, 2, 1)
    spread = carry(blocks[row, :, row], in_row) + carry(blocks[column, :, column], in_column)
    spread = spread - cross - cross.transpose(0, 2, 1)
    sigma = np.sqrt(np.maximum(spread[:, 0, 0], 0))
    flatness = np.where(apart.gap[row, column] <= 0, FLATNESS, IN_LINE)
    spread[:, 0, 0] = sigma**2 + flatness**2
    spread[:, 1, 1] = (
        np.maximum(spread[:, 1, 1], 0) + (flatness / np.maximum(np.minimum(row_half, column_half), FLATNESS)) ** 2
    )
    return squared_distance(offset + in_row * np.sin(angle), angle, spread), sigma


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
