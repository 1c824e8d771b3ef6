"""Wall lines that are the same wall: collinear, the same free side, overlapping or nearly touching."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array
from recon.graph.association import GATE, MAX_TURN
from recon.graph.line import FLATNESS, Difference, Lines, carry, lever, squared_distance

Ints = NDArray[np.int64]
Covariances = Callable[[Ints, Ints], Array]

IN_LINE = 0.002
"""m: flatness of walls on either side of an opening; two door leaves in niches of nearly one depth differ by more."""
MAX_GAP = 2.5
"""m: a wall goes on behind an opening of this width (a double door)."""
MAX_OFFSET = 1.0
"""m: walls further apart than this, one's middle off the other's line, are not compared."""
POWER = 0.02
"""m: two pieces are one wall only where a step of a few times this between them would have shown."""
CHUNK = 500
"""Walls that are compared with all others at a time."""


def merge_labels(walls: Lines, covariance: Covariances) -> Ints:
    """New label (W,) of every wall, counted from 0; walls that are one share it.

    covariance: (P, 2, 2) between the (offset, angle) of pairs of walls, rows (P,) and columns (P,). Two walls are the
    same where the difference between their lines, halfway between them, passes the chi-square test with the exact
    covariance of that difference and the flatness of walls. Every two pieces of one wall must pass (complete linkage),
    so that a vague piece between a wall and a recess cannot join the two.
    """
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import connected_components

    count = len(walls)
    first, second = _touching(walls)
    distance, near = _compare(walls, covariance, first, second)
    joined = near & (distance <= GATE)
    links = csr_array((np.ones(joined.sum()), (first[joined], second[joined])), shape=(count, count))
    parts, found = connected_components(links, directed=False)
    part = found.astype(np.int64)
    label = np.arange(count)
    order = np.flatnonzero(joined)[np.argsort(distance[joined], kind="stable")]
    for links_of, among in zip(_by_group(part[first[order]], parts), _by_group(part, parts), strict=True):
        if len(links_of):
            pairs = np.searchsorted(among, np.stack([first[order[links_of]], second[order[links_of]]], axis=1))
            label[among] = among[_complete(_compatible(walls, covariance, among), pairs)]
    return np.asarray(np.unique(label, return_inverse=True)[1])


def _by_group(group: Ints, groups: int) -> list[Ints]:
    """Rows of every group, in their order."""
    return np.split(np.argsort(group, kind="stable"), np.cumsum(np.bincount(group, minlength=groups))[:-1])


def _touching(walls: Lines) -> tuple[Ints, Ints]:
    """Pairs of walls (P,), first < second, that nearly lie in line and touch or leave a gap that an opening may."""
    pairs = [np.zeros((2, 0), np.int64)]
    for start in range(0, len(walls), CHUNK):
        apart = Difference.between(walls[start : start + CHUNK], walls)
        found = (np.abs(apart.angle) <= MAX_TURN) & (np.abs(apart.offset) <= MAX_OFFSET) & (apart.gap <= MAX_GAP)
        row, column = np.nonzero(found)
        row += start
        pairs.append(np.stack([np.minimum(row, column), np.maximum(row, column)])[:, row != column])
    first, second = np.unique(np.concatenate(pairs, axis=1), axis=1)
    return first, second


def _compatible(walls: Lines, covariance: Covariances, among: Ints) -> NDArray[np.bool_]:
    """(n, n) which of the walls `among` (n,) may be one."""
    row, column = np.triu_indices(len(among), 1)
    out = np.eye(len(among), dtype=bool)
    out[row, column] = out[column, row] = _compare(walls, covariance, among[row], among[column])[0] <= GATE
    return out


def _complete(compatible: NDArray[np.bool_], pairs: Ints) -> Ints:
    """Labels (n,) of complete linkage along `pairs` (P, 2), nearest first."""
    label = np.arange(len(compatible))
    for a, b in pairs:
        left, right = np.flatnonzero(label == label[a]), np.flatnonzero(label == label[b])
        if label[a] != label[b] and compatible[np.ix_(left, right)].all():
            label[right] = label[a]
    return label


def _compare(walls: Lines, covariance: Covariances, first: Ints, second: Ints) -> tuple[Array, NDArray[np.bool_]]:
    """Squared distance (P,) between pairs of walls, and whether they lie near one another, seen from both sides."""
    cross = covariance(first, second)
    distance, near = np.zeros(len(first)), np.zeros(len(first), dtype=bool)
    for row, column, between in ((first, second, cross), (second, first, cross.transpose(0, 2, 1))):
        apart = Difference.paired(walls[row], walls[column])
        squared, sigma = _test(walls[row], walls[column], apart, between)
        squared[(np.abs(apart.angle) > MAX_TURN) | (np.abs(apart.offset) > MAX_OFFSET)] = np.inf
        distance = np.maximum(distance, squared)
        near |= np.isfinite(squared) & ((apart.gap <= 0) | ((sigma <= POWER) & (apart.gap <= MAX_GAP)))
    return distance, near


def _test(row: Lines, column: Lines, apart: Difference, cross: Array) -> tuple[Array, Array]:
    """Squared distance and sigma of the offset (both (P,)) of walls `row` from walls `column`; cross (P, 2, 2)."""
    # the reference is the middle of where the stretches overlap, or of the gap between them
    low, high = np.maximum(-column.half, apart.along - row.half), np.minimum(column.half, apart.along + row.half)
    in_column = (low + high) / 2
    in_row = (in_column - apart.along) * np.cos(apart.angle)
    mixed = lever(in_row) @ cross @ lever(in_column).transpose(0, 2, 1)
    spread = carry(row.covariance, in_row) + carry(column.covariance, in_column) - mixed - mixed.transpose(0, 2, 1)
    sigma = np.sqrt(np.maximum(spread[:, 0, 0], 0))
    flatness = np.where(apart.gap <= 0, FLATNESS, IN_LINE)
    spread[:, 0, 0] = sigma**2 + flatness**2
    shorter = np.maximum(np.minimum(row.half, column.half), FLATNESS)
    spread[:, 1, 1] = np.maximum(spread[:, 1, 1], 0) + (flatness / shorter) ** 2
    return squared_distance(apart.offset + in_row * np.sin(apart.angle), apart.angle, spread), sigma


def join(walls: Lines, label: Ints) -> Lines:
    """One line for every label, fused from its walls by their own covariances, around the middle of their stretch."""
    parts = []
    for rows in _by_group(label, int(label.max()) + 1) if len(label) else []:
        members = walls[rows]
        longest = members[np.array([np.argmax(members.half)])]
        apart = Difference.between(members, longest)
        along, angle = apart.along[:, 0], apart.angle[:, 0]
        back = lever(-along)
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
    carried = lever(np.array([middle]))
    return Lines(
        line.middle + normal * shift[0] + direction * middle,
        angle,
        np.array([(high - low) / 2]),
        carried @ covariance[None] @ carried.transpose(0, 2, 1),
    )
