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

Order = Literal["as given", "backwards", "at once", "in turn", "in turn, backwards"]

WINDOW, WINDOWS = 120, 4
"""Scans that are looked at: stretches of the drive in which the platform's turning changes most, at most so many."""
LEAST_TURN = 0.5
"""rad that the platform must turn, in all, within a stretch that tells."""
LEAST_SMEAR = 0.02
"""m: turns that move points by less within a scan, in their mean weighted with it, tell nothing."""
CELL = 0.05
"""m, side of the cells that points are counted in."""
MIN_GAIN = 0.1
"""Part of the cells that must become empty for another order than the given one to be believed."""
UNSAID_GAIN = 0.015
"""The same where the scans say nothing of time; then the opposite order must fill as many more, in two stretches."""
LONGEST_TURN = 0.25
"""s: scans farther apart are not of each turn of a scanner."""
SAID: tuple[Order, ...] = ("as given", "backwards", "at once")
IN_TURN: tuple[Order, Order] = ("in turn", "in turn, backwards")


def match_in_order(
    scans: Scans, odometry: Trajectory | None, config: LidarConfig, warnings: list[str]
) -> tuple[Scans, ScanMatching]:
    """`match_scans`, and the scans with their beams in the order in which they were taken; says where that is new."""
    matching = match_scans(scans, odometry, config)
    if (order := sweep_order(scans, matching, config)) == "as given":
        return scans, matching
    warnings.append(f"by the map that they make, the beams of a scan were taken {order}")
    scans = reordered(scans, order)
    return scans, match_scans(scans, odometry, config)


def sweep_order(scans: Scans, matching: ScanMatching, config: LidarConfig) -> Order:
    """The order of beams in time with which scans from a turning platform make the sharpest map.

    `time_increment` says that beams were taken one after the other as they are listed. Drivers that turn the list of a
    scanner that runs clockwise often leave its sign as it was, and others have taken the distortion out already: motion
    distortion is then doubled, or made. Without `time_increment` they may have been taken at once, or in turn while a
    mirror goes round once a scan. A map in which walls lie on themselves has points in fewer cells. "as given" where
    nothing else is clearly better, where stretches of the drive do not agree, and where the scans tell nothing: good
    scans must not be spoilt.
    """
    said = scans.time_increment > 0
    if len(scans) < 3 or not (said or np.median(np.diff(scans.timestamps)) < LONGEST_TURN):
        return "as given"
    stretches = _telling(scans, matching)
    if not said:
        return _agreed(stretches, matching, config) if len(stretches) > 1 else "as given"
    some = stretches[:2]
    given, *others = (sum(_occupied(reordered(s, order), matching, config) for s in some) for order in SAID)
    best = int(np.argmin(others))
    return SAID[1 + best] if others[best] < (1.0 - MIN_GAIN) * given else "as given"


def _agreed(stretches: list[Scans], matching: ScanMatching, config: LidarConfig) -> Order:
    """The order that two stretches agree on before any tells that the beams were taken at once."""
    votes: list[Order] = []
    for stretch in stretches:
        given, *others = (_occupied(reordered(stretch, order), matching, config) for order in ("as given", *IN_TURN))
        low, high = (1.0 - UNSAID_GAIN) * given, (1.0 + UNSAID_GAIN) * given
        if min(others) > high:
            break
        if min(others) < low and max(others) > high:
            votes.append(IN_TURN[int(np.argmin(others))])
        if len(votes) == 2:
            return votes[0] if votes[0] == votes[1] else "as given"
    return "as given"


def reordered(scans: Scans, order: Order) -> Scans:
    """The scans with beam 0 the first one taken, as `order` says; bearings stay with their ranges."""
    if order == "at once":
        return replace(scans, time_increment=0.0)
    if order in IN_TURN:
        # a mirror that goes round once from scan to scan
        turn = float(np.median(np.diff(scans.timestamps)))
        scans = replace(scans, time_increment=turn * abs(scans.angle_increment) / (2 * np.pi))
    if order in ("as given", "in turn"):
        return scans
    last = scans.angle_min + (scans.ranges.shape[1] - 1) * scans.angle_increment
    intensities = None if scans.intensities is None else np.ascontiguousarray(scans.intensities[:, ::-1])
    ranges = np.ascontiguousarray(scans.ranges[:, ::-1])
    return replace(
        scans, ranges=ranges, intensities=intensities, angle_min=last, angle_increment=-scans.angle_increment
    )


def _telling(scans: Scans, matching: ScanMatching) -> list[Scans]:
    """Stretches of the drive, WINDOWS at most, in which the platform turns so that the order of beams shows."""
    rate, seconds = np.abs(matching.velocities[:, 2]), float(np.median(np.diff(scans.timestamps)))
    timed = scans if scans.time_increment > 0 else reordered(scans, "in turn")
    reach = float(np.median(scans.ranges[np.isfinite(scans.ranges)]))
    smear = rate * timed.time_increment * scans.ranges.shape[1] / 2 * reach
    starts = np.arange(0, len(scans), WINDOW)
    change = np.add.reduceat(np.abs(np.diff(matching.velocities[:, 2], prepend=matching.velocities[0, 2])), starts)
    found = []
    for start in starts[np.argsort(-change, kind="stable")][:WINDOWS]:
        part = slice(int(start), int(start) + WINDOW)
        blurred = float(np.sum(smear[part] ** 2)) > LEAST_SMEAR * float(np.sum(smear[part]))
        if float(rate[part].sum()) * seconds > LEAST_TURN and blurred:
            found.append(replace(scans, timestamps=scans.timestamps[part], ranges=scans.ranges[part], intensities=None))
    return found


def _occupied(scans: Scans, matching: ScanMatching, config: LidarConfig) -> int:
    """Cells with points in the map that the scans make."""
    found = match_scans(scans, matching.odometry, config)
    points = [apply2(p, scan_points(scans, i, found.velocities[i]).xy) for i, p in enumerate(found.trajectory.poses)]
    return len(np.unique(np.floor(np.concatenate(points) / CELL), axis=0))
