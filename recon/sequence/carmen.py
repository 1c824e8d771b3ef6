"""CARMEN logs as sequences."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from recon.errors import InputError
from recon.geometry import Array, between2, compose2, wrap_angle
from recon.sequence.carmen_clock import repaired_times
from recon.sequence.carmen_log import CarmenLog, Odometry, Scan, read_log
from recon.sequence.no_return import no_return_limit
from recon.sequence.scans import checked_scans, say_blind
from recon.sequence.sequence import Scans, Sequence
from recon.sequence.stamps import increasing
from recon.sequence.text import drive_name, plural
from recon.sequence.trajectory import Trajectory

SAME_POSE = 1e-5
"""m and rad: poses that were printed from one number."""


def read_carmen(path: Path) -> Sequence:
    """Scans and raw odometry of a CARMEN log, plain or gzipped.

    Raises InputError for a file without usable scans. Damaged records are left out; what is odd about the time stamps
    or the poses is said.
    """
    path = Path(path)
    log = read_log(path)
    warnings = log.warnings
    restated = _restated(log)
    records = [record for record, again in zip(log.records, restated, strict=True) if not again]
    is_scan = np.array([isinstance(record, Scan) for record in records])
    times, made_up = repaired_times([r.stamps for r in records], is_scan, is_scan & restated.any(), warnings)
    scans = _scans(path, [r for r in records if isinstance(r, Scan)], times[is_scan], warnings)
    if restated.any():
        warnings.append(
            f"the poses of {path.name} are an estimate (GMapping's): odometry is what was added between corrections"
        )
        odometry = _chained(records, times)
    else:
        odometry = _recorded(log, records, times, is_scan, made_up)
    name = drive_name(path)
    return Sequence(name, scans, odometry=_checked_odometry(odometry, warnings), warnings=tuple(warnings))


def _scans(path: Path, scans: list[Scan], times: Array, warnings: list[str]) -> Scans:
    keep = increasing(times)
    if keep.sum() < len(keep) / 2:
        raise InputError(
            f"{path}: time stamps of {scans[0].kind} jump back: only {int(keep.sum())} of {len(keep)} increase"
        )
    if not keep.all():
        lost = plural(int((~keep).sum()), "scan")
        warnings.append(f"{lost} of {path.name} left out (of {len(keep)}): time stamps that do not increase")
    ranges = np.array([scan.ranges for scan in scans])[keep]
    limit = min(no_return_limit(ranges), float(np.median([scan.limit for scan in scans])))
    with np.errstate(invalid="ignore"):
        ranges[ranges >= limit] = np.inf
        ranges[ranges < 0] = np.nan
    returns = ranges[np.isfinite(ranges) & (ranges > 0)]
    low, high = (float(returns.min()), float(returns.max())) if len(returns) else (0.0, 1.0)
    start = float(np.median([scan.start for scan in scans]))
    result = Scans(times[keep], ranges, start, scans[0].step, low * 0.999, high * 1.001)
    result = checked_scans(path, result)
    say_blind(result, warnings)
    return result


def _restated(log: CarmenLog) -> NDArray[np.bool_]:
    """(N,) ODOM records that only say again the corrected pose of the scan before: none in a log of raw odometry.

    GMapping writes its estimate into both poses of a scan, says it again as ODOM with a stamp that means nothing, and
    goes on from there with what the wheels added. NEFF lines are its mark, but not always there.
    """
    records, by_gmapping = log.records, log.counts["NEFF"] > 0
    again = np.zeros(len(records), dtype=bool)
    corrected = scans = 0
    for i in range(1, len(records)):
        here, before = records[i], records[i - 1]
        if not isinstance(here, Odometry) or not isinstance(before, Scan) or before.robot is None:
            continue
        late = before.stamps[0] - here.stamps[0]
        again[i] = _apart(here.robot, before.robot) < SAME_POSE and (late > 0 or (late == 0 and by_gmapping))
        earlier = records[i - 2] if i > 1 else None
        if isinstance(earlier, Odometry) and _apart(earlier.robot, before.robot) > SAME_POSE:
            scans += 1
            corrected += bool(again[i])
    moved_between = sum(isinstance(record, Odometry) for record in records) - int(again.sum()) >= len(log.scans)
    if by_gmapping or (scans and corrected > 0.5 * scans and moved_between):
        return again
    return np.zeros(len(records), dtype=bool)


def _apart(a: Array, b: Array) -> float:
    return float(np.abs([a[0] - b[0], a[1] - b[1], float(wrap_angle(a[2] - b[2]))]).max())


@dataclass(frozen=True)
class _Poses:
    times: Array
    poses: Array


def _chained(records: list[Scan | Odometry], times: Array) -> _Poses:
    """Raw odometry of a corrected log: steps between ODOM records, and from a correction to the next, never across."""
    raw, base = np.zeros(3), None
    poses, stamps = [], []
    for record, time in zip(records, times, strict=True):
        if isinstance(record, Odometry):
            if base is not None:
                raw = compose2(raw, between2(base, record.robot))
            poses.append(raw)
            stamps.append(time)
        base = record.robot
    return _Poses(np.array(stamps), np.array(poses).reshape(-1, 3))


def _recorded(
    log: CarmenLog, records: list[Scan | Odometry], times: Array, is_scan: NDArray[np.bool_], made_up: bool
) -> _Poses:
    """Odometry as it was recorded, moved to the scanner: of the ODOM records, else of the scans.

    That of the scans comes at their own time, and is better where times are made up.
    """
    scans = [r for r in records if isinstance(r, Scan) and r.robot is not None and r.laser is not None]
    robot_from_laser = _mounting(log, scans)
    own = [r for r in records if isinstance(r, Odometry)]
    if len(own) >= is_scan.sum() and not (made_up and scans):
        return _Poses(times[~is_scan], compose2(np.array([r.robot for r in own]), robot_from_laser))
    posed = np.array([isinstance(r, Scan) and r.robot is not None for r in records], dtype=bool)
    robots = [r.robot for r, ok in zip(records, posed, strict=True) if ok]
    return _Poses(times[posed], compose2(np.array(robots).reshape(-1, 3), robot_from_laser))


def _mounting(log: CarmenLog, scans: list[Scan]) -> Array:
    """robot_from_laser (3,): what lies between the two poses of the scans, where it is always the same."""
    if scans:
        offsets = between2(np.array([s.robot for s in scans]), np.array([s.laser for s in scans]))
        middle = np.median(offsets, axis=0)
        spread = np.abs(offsets - middle)
        spread[:, 2] = np.abs(wrap_angle(spread[:, 2]))
        if np.quantile(spread, 0.95) < 0.005:
            return np.asarray(middle)
    try:  # one of the two poses is an estimate: the other is the robot's
        return np.array([float(log.parameters.get("robot_frontlaser_offset", 0)), 0.0, 0.0])
    except ValueError:
        return np.zeros(3)


def _checked_odometry(odometry: _Poses, warnings: list[str]) -> Trajectory | None:
    """Odometry with increasing stamps; None where there is none or it never moves."""
    keep = increasing(odometry.times)
    times, poses = odometry.times[keep], odometry.poses[keep]
    lost = int((~keep).sum())
    if lost:
        warnings.append(
            f"{plural(lost, 'odometry record')} left out (of {len(keep)}): time stamps that do not increase"
        )
    if len(times) < 2 or (np.ptp(poses, axis=0) == 0).all():
        warnings.append("the odometry never moves: left out" if len(times) > 1 else "no odometry in the log")
        return None
    return Trajectory(times, poses)
