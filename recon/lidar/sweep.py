"""In which order a turning scanner took its beams: some drivers hand them over back to front."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np

from recon.config import LidarConfig
from recon.geometry import apply2
from recon.lidar.matching import ScanMatching, match_scans
from recon.lidar.points import scan_points
from recon.sequence.sequence import Scans
from recon.sequence.trajectory import Trajectory

Order = Literal["as given", "backwards", "at once"]

WINDOW = 120
"""Scans that are looked at: those of the drive between which the platform's turning changes most."""
CELL = 0.05
"""m, side of the cells that points are counted in."""
MIN_GAIN = 0.1
"""Part of the cells that must become empty for another order to be believed."""


def match_in_order(
    scans: Scans, odometry: Trajectory | None, config: LidarConfig, warnings: list[str]
) -> tuple[Scans, ScanMatching]:
    """`match_scans`, and the scans with their beams in the order in which they were taken; says where that is new."""
    matching = match_scans(scans, odometry, config)
    if (order := sweep_order(scans, matching, config)) == "as given":
        return scans, matching
    warnings.append(f"the beams of a scan were taken {order}, whatever their order and time_increment say")
    scans = reordered(scans, order)
    return scans, match_scans(scans, odometry, config)


def sweep_order(scans: Scans, matching: ScanMatching, config: LidarConfig) -> Order:
    """The order of beams in time with which scans from a turning platform make the sharpest map.

    `time_increment` says that beams were taken one after the other as they are listed. Drivers that turn the list of a
    scanner that runs clockwise often leave its sign as it was, and others have taken the distortion out already: motion
    distortion is then doubled, or made. A map in which walls lie on themselves has points in fewer cells. "as given"
    where nothing else is clearly better, and where the scans tell nothing: without `time_increment` or without turns.
    """
    if scans.time_increment <= 0 or len(scans) < 3:
        return "as given"
    change = np.abs(np.diff(matching.velocities[:, 2], prepend=matching.velocities[0, 2]))
    count = min(WINDOW, len(scans))
    start = int(np.argmax(np.convolve(change, np.ones(count), mode="valid")))
    chosen = slice(start, start + count)
    some = replace(scans, timestamps=scans.timestamps[chosen], ranges=scans.ranges[chosen], intensities=None)
    orders: tuple[Order, ...] = ("as given", "backwards", "at once")
    cells = [_occupied(reordered(some, order), matching, config) for order in orders]
    best = int(np.argmin(cells))
    return orders[best] if cells[best] < (1.0 - MIN_GAIN) * cells[0] else "as given"


def reordered(scans: Scans, order: Order) -> Scans:
    """The scans with beam 0 the first one taken, as `order` says; bearings stay with their ranges."""
    if order == "at once":
        return replace(scans, time_increment=0.0)
    if order == "as given":
        return scans
    last = scans.angle_min + (scans.ranges.shape[1] - 1) * scans.angle_increment
    intensities = None if scans.intensities is None else np.ascontiguousarray(scans.intensities[:, ::-1])
    ranges = np.ascontiguousarray(scans.ranges[:, ::-1])
    return replace(
        scans, ranges=ranges, intensities=intensities, angle_min=last, angle_increment=-scans.angle_increment
    )


def _occupied(scans: Scans, matching: ScanMatching, config: LidarConfig) -> int:
    """Cells with points in the map that the scans make."""
    found = match_scans(scans, matching.odometry, config)
    points = [apply2(p, scan_points(scans, i, found.velocities[i]).xy) for i, p in enumerate(found.trajectory.poses)]
    return len(np.unique(np.floor(np.concatenate(points) / CELL), axis=0))
