"""Which lines are walls: furniture and open doors make short lines too."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from recon.geometry import Array
from recon.layout.evidence import FreeSpace
from recon.layout.line import PlanLine, carried, coverage, total, union
from recon.layout.stretches import Stretches

SHORTEST_WALL = 0.5
"""m of support; lines with less are clutter."""
SURE_WALL = 1.0
"""m of support; shorter lines are walls only beside such ones ..."""
BESIDE = 0.5
"""... at most this far, m, from one of their ends."""
SHORTEST_PARTITION = 1.5
"""m of support; shorter lines with free space right behind them are clutter."""
THICKNESS = (0.07, 0.4)
"""m between the two faces of a wall; leaves are thinner."""
PARALLEL = np.radians(5.0)
JOINED = 0.15
"""m from the end of a partition to the wall that it meets, and between neighbouring pieces of a curved wall."""
BLUNT = np.cos(np.radians(50.0)), np.cos(np.radians(4.0))
"""Cosines of the angles between such pieces; furniture has square corners, or stands in line."""
SPARSE = 0.6
"""m along a line between returns of one stretch."""
BEHIND = (0.15, 0.25, 0.35)
"""m"""


def with_returns(lines: list[PlanLine], space: FreeSpace) -> list[PlanLine]:
    """LiDAR lines with only those stretches along which returns lie; image lines as they are."""
    grown = cv2.dilate(space.hit.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    out = []
    for line in lines:
        if line.source == "lidar":
            front, back = (_returned(line, part, grown, space) for part in (line.front, line.back))
            line = replace(line, front=front, back=back)
        if len(line.front) or len(line.back):
            out.append(line)
    return out


def _returned(line: PlanLine, stretches: Array, hit: NDArray[np.bool_], space: FreeSpace) -> Array:
    parts = []
    for low, high in stretches:
        edges = np.linspace(low, high, max(2, round((high - low) / space.resolution) + 1))
        found = hit[space.index(line.point((edges[:-1] + edges[1:]) / 2))]
        parts.append(union(np.stack([edges[:-1], edges[1:]], axis=1)[found], SPARSE))
    return np.concatenate(parts) if parts else stretches


def is_sure(line: PlanLine) -> bool:
    """Whether a line is long enough to be a wall by itself, or an image showed its foot on the floor."""
    return line.source == "image" or line.supported_length >= SURE_WALL


def without_clutter(lines: list[PlanLine], space: FreeSpace) -> list[PlanLine]:
    """The lines that are walls."""
    length = _chained_lengths(lines)
    lines = [line for line, m in zip(lines, length, strict=True) if line.source == "image" or m >= SHORTEST_WALL]
    long = [line for line in lines if line.supported_length >= SHORTEST_PARTITION]
    far = Stretches(long)
    lines = [
        line
        for line in lines
        if line.source == "image" or not _stands_free(line, space) or _has_face(line, long) or _is_partition(line, far)
    ]
    sure = Stretches([line for line in lines if is_sure(line)])
    length = _chained_lengths(lines)
    return [
        line
        for line, m in zip(lines, length, strict=True)
        if is_sure(line) or m >= SURE_WALL or not _is_alone(line, sure)
    ]


def _chained_lengths(lines: list[PlanLine]) -> list[float]:
    """m of each line and of the short ones that go on from its ends at a blunt angle, as pieces of a curved wall do."""
    known = [line for line in lines if len(line.support) and line.supported_length < SHORTEST_PARTITION]
    if not known:
        return [_known_length(line) for line in lines]
    ends = np.concatenate([line.point(line.support[[0, -1], [0, 1]]) for line in known])
    direction = np.array([line.direction for line in known])
    pairs = cKDTree(ends).query_pairs(JOINED, output_type="ndarray") // 2
    cosine = np.abs(np.einsum("pi,pi->p", direction[pairs[:, 0]], direction[pairs[:, 1]]))
    blunt = (cosine > BLUNT[0]) & (cosine < BLUNT[1])
    a, b = pairs[blunt].T
    graph = coo_array((np.ones(len(a)), (a, b)), shape=(len(known), len(known)))
    _, chain = connected_components(graph, directed=False)
    total_of = np.bincount(chain, [_known_length(line) for line in known])
    length = {id(line): float(total_of[k]) for line, k in zip(known, chain, strict=True)}
    return [length.get(id(line), _known_length(line)) for line in lines]


def _known_length(line: PlanLine) -> float:
    """m that were seen, or are hidden by what stands before them."""
    return total(union(np.concatenate([line.support, line.hidden])))


def _is_partition(line: PlanLine, long: Stretches) -> bool:
    """Whether a line goes from one longer wall to another."""
    ends = line.point(line.support[[0, -1], [0, 1]])
    return bool(long.distance(ends).max() <= JOINED)


def _stands_free(line: PlanLine, space: FreeSpace) -> bool:
    """Whether rays passed just behind most of a short line: furniture, or an open door's leaf."""
    if line.supported_length >= SHORTEST_PARTITION:
        return False
    shares = []
    for stretches, side in ((line.front, 1.0), (line.back, -1.0)):
        for low, high in stretches:
            foot = line.point(np.arange(low, high, space.resolution))
            behind = [space.is_free(foot - side * depth * line.normal) for depth in BEHIND]
            shares.append(np.any(behind, axis=0))
    return bool(np.concatenate(shares).mean() > 0.5)


def _has_face(line: PlanLine, long: list[PlanLine]) -> bool:
    """Whether a longer wall, which faces the other way, is right behind most of a line: its other face."""
    for stretches, side in ((line.front, 1.0), (line.back, -1.0)):
        for other in long:
            turned = float(other.direction @ line.direction)
            if len(stretches) == 0 or abs(turned) < np.cos(PARALLEL):
                continue
            faces = other.back if side * turned > 0 else other.front
            depth = -side * line.offset(other.point(other.along(line.point(stretches.mean())[None])))
            low, high = carried(stretches, line, other).T
            if THICKNESS[0] <= depth[0] <= THICKNESS[1] and coverage(faces, low, high).sum() > 0.5 * total(stretches):
                return True
    return False


def _is_alone(line: PlanLine, sure: Stretches) -> bool:
    ends = line.point(line.support[[0, -1], [0, 1]])
    return bool(sure.distance(ends).min() > BESIDE)
