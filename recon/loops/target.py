"""What is looked for, and what it is looked for in: a submap as a few points, and as a map with its free space."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.config import LidarConfig
from recon.geometry import Array
from recon.lidar.cloud import Cloud
from recon.lidar.localmap import LocalMap, build_map
from recon.loops.free_space import free_space
from recon.loops.grid import Pyramid, build_pyramid
from recon.loops.submap import Submaps

VIEW = 15.0
"""m from its middle that the cloud of a submap reaches when it is searched for in others."""
POINTS = 200
"""Points of a cloud that is searched for."""


@dataclass(frozen=True)
class Target:
    """A submap that others are matched with, in its own frame. free: cells of the map's grid that it saw as empty."""

    local: LocalMap
    pyramid: Pyramid
    free: NDArray[np.bool_]


def make_target(submaps: Submaps, number: int, poses: Array, config: LidarConfig) -> Target:
    """The submap and its neighbours."""
    local = build_map(submaps.cloud(number, poses, around=1), np.zeros(2), config)
    return Target(local, build_pyramid(local.points), free_space(submaps, number, poses, local))


def make_query(submaps: Submaps, number: int, poses: Array, config: LidarConfig) -> Cloud:
    """The submap alone, as points spread evenly over its surfaces."""
    local = build_map(submaps.cloud(number, poses), np.zeros(2), config)
    near = np.flatnonzero(np.hypot(local.points[:, 0], local.points[:, 1]) < VIEW)
    near = near[np.unique(np.linspace(0, len(near) - 1, min(len(near), POINTS)).astype(np.int64))]
    return Cloud(local.points[near], local.normals[near], local.flat[near], local.information[near])
