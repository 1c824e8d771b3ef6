"""Distances of walls across rooms, with standard deviations from the joint covariance: what chains outside say."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise

import numpy as np

from recon.geometry import Array, rotation2
from recon.graph.estimate import MapEstimate
from recon.layout.line import PlanLine
from recon.layout.uncertainty import follows, joint_covariances
from recon.model import Dimension, Layout
from recon.plan.chains import Stop, find_chains
from recon.plan.draw import turned
from recon.plan.walls import dominant_angle

NO_ROOM = -1
"""Room of distances across rooms."""
NO_WALL = -1


def across_rooms(layout: Layout, line_of: Mapping[int, PlanLine], estimate: MapEstimate) -> tuple[Dimension, ...]:
    """Of the dimension chains of the plan those from face to face that no room of the layout has measured.

    line_of: the lines of walls that were seen, by the walls' ids.
    """
    angle = dominant_angle(layout)
    done = {frozenset(d.walls) for d in layout.dimensions}
    found: list[tuple[Stop, Stop, Array]] = []
    ids: list[tuple[int, int]] = []
    for side in find_chains(turned(layout, -angle)):
        to_map = rotation2(angle) @ side.turn.T
        for a, b in (pair for row in side.rows for pair in pairwise(row)):
            walls = (a.wall.id, b.wall.id) if a.wall is not None and b.wall is not None else (NO_WALL, NO_WALL)
            if set(walls) <= set(line_of) and walls[0] != walls[1] and frozenset(walls) not in done:
                done.add(frozenset(walls))
                found.append((a, b, to_map))
                ids.append(walls)
    first, second = ([line_of[walls[k]] for walls in ids] for k in range(2))
    blocks = joint_covariances(first, second, estimate)
    out = []
    for (a, b, to_map), walls, near, far, block in zip(found, ids, first, second, blocks, strict=True):
        start, other, way = to_map @ a.point, to_map @ b.point, to_map @ np.array([1.0, 0.0])
        change = np.concatenate([-follows(near, start, way), follows(far, other, way)])
        sigma = float(np.sqrt(max(change @ block @ change, 0.0)))
        out.append(Dimension(NO_ROOM, walls, start, start + (b.x - a.x) * way, sigma))
    return tuple(out)
