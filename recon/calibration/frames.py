"""Image lines and LiDAR segments brought together, image by image."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from recon.calibration.support import CalibrationFrames
from recon.geometry import Array, apply2, between2
from recon.lidar.directions import manhattan_groups
from recon.lidar.segment import Segments
from recon.sequence.trajectory import Trajectory
from recon.vision.frame import HORIZONTAL_1, HORIZONTAL_2, FrameLines

LINE_GROUPS = {HORIZONTAL_1: 0, HORIZONTAL_2: 1}


def segments_at(times: Array, trajectory: Trajectory, segments: Sequence[Segments]) -> list[Array]:
    """For each time the nearest scan's segments (M, 2, 2), m, moved to the platform frame at that time."""
    scan = trajectory.nearest(times)
    platform_from_scan = between2(trajectory.at(times), trajectory.poses[scan])
    return [
        apply2(pose, segments[s].endpoints.reshape(-1, 2)).reshape(-1, 2, 2)
        for pose, s in zip(platform_from_scan, scan, strict=True)
    ]


def collect_frames(
    lines: Sequence[FrameLines | None], times: Array, trajectory: Trajectory, segments: Sequence[Segments]
) -> CalibrationFrames:
    """Boundary candidates and LiDAR segments of every image that has both; `None` images are left out."""
    lidar = segments_at(times, trajectory, segments)
    usable = [i for i, f in enumerate(lines) if f is not None and len(f.boundary) and len(lidar[i])]
    frames = [f for i in usable if (f := lines[i]) is not None]
    ends = [f.endpoints[f.boundary] for f in frames]
    groups = [np.array([LINE_GROUPS.get(int(g), -1) for g in f.labels[f.boundary]], np.int64) for f in frames]
    walls = [lidar[i] for i in usable]
    return CalibrationFrames(
        np.concatenate([np.zeros((0, 2, 2)), *ends]),
        np.concatenate([np.zeros(0, np.int64), *groups]),
        np.cumsum([0, *(len(e) for e in ends)]),
        np.concatenate([np.zeros((0, 2, 2)), *walls]),
        np.concatenate([np.zeros(0, np.int64), *(manhattan_groups(w) for w in walls)]),
        np.cumsum([0, *(len(w) for w in walls)]),
        np.array(usable, np.int64),
    )
