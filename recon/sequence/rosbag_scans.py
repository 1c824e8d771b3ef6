"""LaserScan and MultiEchoLaserScan messages as scans."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recon.errors import InputError
from recon.geometry import Array, Pose3
from recon.sequence.rosbag_messages import frame
from recon.sequence.scan_grid import Sweep, common_grid
from recon.sequence.sequence import Scans
from recon.sequence.stamps import Stamp, header_times
from recon.sequence.text import plural

OTHER_FRAME = 0.01
"""Share of a topic's scans with another frame: fewer are left out, more are a second scanner."""
SMALLEST_STEP, LARGEST_SWEEP = 1e-5, 2 * np.pi * 1.05
"""rad"""
TILT_SAID, TILT_REFUSED = np.radians(5), np.radians(30)


class ScanCollector:
    """Gathers the scans of one topic."""

    def __init__(self, path: Path, topic: str) -> None:
        self.path, self.topic, self.damaged = path, topic, 0
        self._sweeps: list[Sweep] = []
        self._frames: list[str] = []
        self._stamps: list[Stamp] = []
        self._limits: list[tuple[float, float, float]] = []

    def add(self, message: Any, stamp: Stamp) -> None:
        """One message. A scan without beams, or with bearings that are none, is counted as damaged."""
        start, step = float(message.angle_min), float(message.angle_increment)
        ranges = _first_echo(message) if hasattr(message, "ranges") else np.zeros(0, np.float32)
        sensible = abs(start) <= 4 * np.pi and abs(step) >= SMALLEST_STEP and abs(step) * len(ranges) <= LARGEST_SWEEP
        if not len(ranges) or not sensible:
            self.damaged += 1
            return
        low, high = float(message.range_min), float(message.range_max)
        self._sweeps.append(Sweep(start, step, _cleaned(ranges, low, high)))
        self._frames.append(frame(message.header.frame_id))
        self._stamps.append(stamp)
        self._limits.append((low, high, float(message.time_increment)))

    def __len__(self) -> int:
        return len(self._sweeps)

    def frame(self, warnings: list[str]) -> str:
        """The frame of the scanner; scans of any other are left out. Raises InputError for two scanners."""
        counts = Counter(self._frames).most_common()
        others = sum(count for _, count in counts[1:])
        if others > OTHER_FRAME * len(self):
            said = ", ".join(f"{name or '(none)'} ({count})" for name, count in counts[:5])
            raise InputError(
                f"{self.path}: topic {self.topic} holds scans of {len(counts)} scanners: frames {said}; "
                "expected one scanner a topic"
            )
        if others:
            warnings.append(f"{plural(others, 'scan')} of {self.topic} left out: not of frame {counts[0][0]}")
            keep = [i for i, name in enumerate(self._frames) if name == counts[0][0]]
            self._choose(keep)
        return counts[0][0]

    def scans(self, base_from_laser: Pose3 | None, warnings: list[str]) -> tuple[Scans, float]:
        """Scans as they were recorded, stamps in any order, bearings counted from the base's x axis.

        Also how far their stamps are ahead of the recording's clock, s. A scanner that is mounted upside down gets a
        negative step. Raises InputError for a scanner that does not sweep level.
        """
        grid = common_grid(self._sweeps)
        if not grid.kept.all():
            left = int((~grid.kept).sum())
            warnings.append(f"{plural(left, 'scan')} of {self.topic} left out: other beams than the rest")
            self._choose([int(i) for i in np.flatnonzero(grid.kept)])
        low, high, increment = (float(v) for v in np.median(self._limits, axis=0))
        start, step = grid.start, grid.step
        if base_from_laser is not None:
            start, step = self._mounted(start, step, base_from_laser, warnings)
        finite = grid.ranges[np.isfinite(grid.ranges)]
        if not 0 <= low < high and len(finite):
            warnings.append(f"{self.topic} gives range limits {low:g} to {high:g} m; those of its returns are used")
            low, high = float(np.nextafter(finite.min(), 0) * 0.999), float(finite.max() * 1.001)
        times, ahead = header_times(self._stamps, self.topic, warnings)
        increment = self._checked_increment(increment, grid.ranges.shape[1], step, times, warnings)
        return Scans(times, grid.ranges, start, step, low, high, increment), ahead

    def _mounted(self, start: float, step: float, base_from_laser: Pose3, warnings: list[str]) -> tuple[float, float]:
        """Bearing of the first beam and step, seen from above and from the base's x axis."""
        rotation = base_from_laser.rotation
        upright = float(np.sign(rotation[2, 2]))
        tilt = float(np.arccos(np.clip(abs(rotation[2, 2]), 0, 1)))
        if tilt > TILT_REFUSED:
            raise InputError(
                f"{self.path}: the scanner of topic {self.topic} is tilted by {np.degrees(tilt):.0f} deg "
                "(by its transforms), expected one that sweeps level; choose another with --scan-topic"
            )
        if tilt > TILT_SAID:
            warnings.append(f"the scanner of {self.topic} is tilted by {np.degrees(tilt):.1f} deg; taken as level")
        # of a level scanner: yaw of its x axis; upside down, bearings count backwards from there
        yaw = float(np.arctan2(rotation[1, 0], rotation[0, 0]))
        start = yaw + upright * start
        return start - 2 * np.pi * np.rint(start / (2 * np.pi)), upright * step

    def _checked_increment(self, increment: float, beams: int, step: float, times: Array, warnings: list[str]) -> float:
        """Seconds between cells of the grid; 0, and said, where a sweep would take longer than scans are apart."""
        if len(times) < 2 or not np.isfinite(increment) or increment <= 0:
            return 0.0
        increment *= abs(step / float(np.median([s.step for s in self._sweeps])))
        interval = float(np.median(np.abs(np.diff(times))))
        if increment * beams > 1.5 * interval:
            warnings.append(
                f"{self.topic} says that a sweep takes {increment * beams:.3g} s, but they are {interval:.3g} s apart; "
                "taken as instantaneous"
            )
            return 0.0
        return increment

    def _choose(self, keep: list[int]) -> None:
        for name in ("_sweeps", "_frames", "_stamps", "_limits"):
            values = getattr(self, name)
            setattr(self, name, [values[i] for i in keep])


def _first_echo(message: Any) -> NDArray[np.float32]:
    """Ranges (B,); of each list of echoes the first."""
    if len(message.ranges) and hasattr(message.ranges[0], "echoes"):
        return np.array([beam.echoes[0] if len(beam.echoes) else np.inf for beam in message.ranges], dtype=np.float32)
    return np.array(message.ranges, dtype=np.float32)


def _cleaned(ranges: NDArray[np.float32], low: float, high: float) -> NDArray[np.float32]:
    """Beyond the scanner's reach is no return (inf), nearer than it can see is invalid (nan) (ROS REP 117)."""
    with np.errstate(invalid="ignore"):
        if high > low:
            ranges[ranges >= high - 1e-3] = np.inf
        ranges[(ranges < max(low, 0)) | (ranges <= 0)] = np.nan
    return ranges
