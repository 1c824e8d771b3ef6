"""Records of a CARMEN log (carmen.sourceforge.net/logger_playback.html), plain or gzipped."""

from __future__ import annotations

import gzip
import zlib
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from recon.errors import InputError
from recon.geometry import Array
from recon.sequence.text import plural

GZIP_MAGIC = b"\x1f\x8b"
SCANS = ("FLASER", "ROBOTLASER1", "RAWLASER1")
"""Records that are read as scans; of several kinds in one log the most frequent."""
OTHER_SCANS = ("RLASER", "LASER3", "LASER4", "ROBOTLASER2", "RAWLASER2", "RAWLASER3", "RAWLASER4")
FLASER_STEPS = {
    # beams: (first bearing, step), degrees: the scanners that CARMEN knows
    180: (-90, 1.0),
    181: (-90, 1.0),
    360: (-90, 0.5),
    361: (-90, 0.5),
    720: (-90, 0.25),
    721: (-90, 0.25),
    100: (-50, 1.0),
    101: (-50, 1.0),
    400: (-50, 0.25),
    401: (-50, 0.25),
    541: (-135, 0.5),
    682: (-120, 360 / 1024),
    683: (-120, 360 / 1024),
    726: (-120, 360 / 1024),
    1081: (-135, 0.25),
}


@dataclass(frozen=True)
class Scan:
    """kind: of the record. start, step: bearings, rad. ranges (B,) m. laser, robot (3,): poses [x, y, yaw], or None.

    limit: range above which the record says that nothing returned, m. stamps: of the message and of the logger, s.
    """

    kind: str
    start: float
    step: float
    ranges: NDArray[np.float32]
    laser: Array | None
    robot: Array | None
    limit: float
    stamps: tuple[float, float]


@dataclass(frozen=True)
class Odometry:
    """Pose (3,) [x, y, yaw] of the robot; stamps as of a scan."""

    robot: Array
    stamps: tuple[float, float]


@dataclass
class CarmenLog:
    """Scans and odometry in the order of the log. parameters: of PARAM; counts: records of each kind, read or not."""

    records: list[Scan | Odometry] = field(default_factory=list)
    parameters: dict[str, str] = field(default_factory=dict)
    counts: Counter[str] = field(default_factory=Counter)
    warnings: list[str] = field(default_factory=list)
    is_cut: bool = False

    @property
    def scans(self) -> list[Scan]:
        """All scans."""
        return [record for record in self.records if isinstance(record, Scan)]


def read_log(path: Path) -> CarmenLog:
    """Scans of the most frequent kind and odometry; damaged lines are left out and counted.

    Raises InputError for a file that is missing or holds no scans; the line says what it holds.
    """
    log, damaged = CarmenLog(), 0
    for text in _lines(path, log):
        fields = text.split()
        if not fields or fields[0].startswith("#"):
            continue
        log.counts[fields[0]] += 1
        try:
            damaged += _add(log, fields)
        except (ValueError, IndexError):
            damaged += 1
    if damaged:
        log.warnings.append(f"{plural(damaged, 'record')} of {path.name} left out: damaged or without beams")
    _keep_one_scanner(path, log)
    return log


def _add(log: CarmenLog, fields: list[str]) -> bool:
    """Adds a record; whether it is damaged. Raises ValueError or IndexError for fields missing or no numbers."""
    kind = fields[0]
    if kind == "PARAM":
        log.parameters[fields[1]] = fields[2]
    elif kind in SCANS:
        scan = _flaser(fields) if kind == "FLASER" else _laser1(fields)
        poses = [v for pose in (scan.laser, scan.robot) if pose is not None for v in pose]
        if not len(scan.ranges) or not np.isfinite([scan.start, scan.step, *poses]).all() or scan.step <= 0:
            return True
        log.records.append(scan)
    elif kind == "ODOM":
        pose = np.array([float(v) for v in fields[1:4]])
        stamps = (float(fields[7]), float(fields[9]) if len(fields) > 9 else float(fields[7]))
        if len(pose) < 3 or not np.isfinite(pose).all():
            return True
        log.records.append(Odometry(pose, stamps))
    return False


def _flaser(fields: list[str]) -> Scan:
    """`FLASER n r1..rn x y th ox oy oth t host t`; bearings by the number of beams."""
    count = int(fields[1])
    ranges = _ranges(fields[2 : 2 + count])
    rest = fields[2 + count :]
    poses = np.array([float(v) for v in rest[:6]])
    stamp = float(rest[6])
    stamps = (stamp, float(rest[8]) if len(rest) > 8 else stamp)
    start, step = FLASER_STEPS.get(count, (-90, 180 / max(count - count % 2, 1)))
    return Scan("FLASER", np.radians(start), np.radians(step), ranges, poses[:3], poses[3:], np.inf, stamps)


def _laser1(fields: list[str]) -> Scan:
    """`ROBOTLASER1` (with poses) and `RAWLASER1` (without).

    `type start fov step max accuracy remission n r1..rn m e1..em [laser and robot pose, tv rv .. turn] t host t`.
    """
    start, view, step, limit = (float(v) for v in fields[2:6])
    count = int(fields[8])
    ranges = _ranges(fields[9 : 9 + count])
    rest = fields[10 + count + int(fields[9 + count]) :]
    laser = robot = None
    if fields[0] == "ROBOTLASER1":
        laser, robot = (np.array([float(v) for v in rest[i : i + 3]]) for i in (0, 3))
        rest = rest[11:]
    stamps = (float(rest[0]), float(rest[2]) if len(rest) > 2 else float(rest[0]))
    if step <= 0 < view and count > 1:
        step = view / (count - 1)
    if len(ranges) != count or abs(step) * count > 6.6:
        raise ValueError
    return Scan(fields[0], start, step, ranges, laser, robot, limit if limit > 0 else np.inf, stamps)


def _ranges(fields: list[str]) -> NDArray[np.float32]:
    with np.errstate(over="ignore"):  # what no float32 holds is no return
        return np.array(fields, dtype=np.float64).astype(np.float32)


def _keep_one_scanner(path: Path, log: CarmenLog) -> None:
    """Leaves scans of the most frequent kind, number of beams and bearings, and says what else there was."""
    kinds = Counter((scan.kind, len(scan.ranges), round(scan.step, 6)) for scan in log.scans)
    if not kinds:
        held = ", ".join(f"{name} ({count})" for name, count in log.counts.most_common(8)) or "nothing"
        end = ", and its end cannot be read" if log.is_cut else ""
        raise InputError(f"{path}: has no laser scans (FLASER, ROBOTLASER1); it holds {held[:300]}{end}")
    usual = kinds.most_common(1)[0][0]

    def is_usual(record: Scan | Odometry) -> bool:
        if isinstance(record, Odometry):
            return True
        return (record.kind, len(record.ranges), round(record.step, 6)) == usual

    left = sum(kinds.values()) - kinds[usual]
    if left:
        log.warnings.append(f"{plural(left, 'scan')} of {path.name} left out: not {usual[0]} of {usual[1]} beams")
    others = [f"{name} ({log.counts[name]})" for name in OTHER_SCANS if log.counts[name]]
    if others:
        log.warnings.append(f"{usual[0]} is used, not the other scanners of {path.name}: {', '.join(others)}")
    if usual[0] == "FLASER" and usual[1] not in FLASER_STEPS:
        log.warnings.append(f"FLASER does not say its bearings: {usual[1]} beams are taken as 180 deg")
    log.records = [record for record in log.records if is_usual(record)]


def _lines(path: Path, log: CarmenLog) -> Iterator[str]:
    """Lines of a text file, or of a gzipped one, as far as it can be read."""
    try:
        with path.open("rb") as file:
            magic = file.read(4)
            file.seek(0)
            lines = gzip.GzipFile(fileobj=file) if magic[:2] == GZIP_MAGIC else file
            for number, line in enumerate(lines):
                if number == 0 and b"\x00" in line:
                    raise InputError(f"{path}: is no CARMEN log (it holds zero bytes)")
                yield line.decode("utf-8", errors="replace")
    except (EOFError, zlib.error, gzip.BadGzipFile):
        log.is_cut = True
        log.warnings.append(f"{path.name}: its end cannot be read (cut off?); the rest is used")
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None
