"""Windows down to the scanner's height: rays that should have met the wall went through or never came back."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import NDArray

from recon.layout.openings import TOP
from recon.model import Opening, Room, Wall
from recon.sequence.sequence import Scans
from recon.sequence.trajectory import Trajectory

WIDTH = (0.5, 3.0)
"""m."""
RANGE = 8.0
"""m, and `SHARE_OF_RANGE` of the scanner's own range: a wall nearer than this returns rays ..."""
SHARE_OF_RANGE = 0.7
STEEPEST = 0.4
"""... that meet it with at least this cosine to its normal."""
INNER = 0.1
"""m at both ends of a stretch where rays are not counted."""
BEHIND = 0.5
"""m behind a wall's face where another room would be."""
NEAR = 0.15
"""m before and behind the wall's face within which a ray ended at the wall."""
MIN_RAYS = 30
FURNITURE = 1.0
"""m before a wall within which rays end at what hides it; those that end before come from other rooms."""
LOST = 0.7
"""Share of the rays aimed at a window from its room that passed it or never came back, at least ..."""
LOST_OF_ALL = 0.2
"""... and of those from anywhere: single rays get lost everywhere."""
MAX_SCANS = 500


def find_windows(
    walls: Sequence[Wall], rooms: Sequence[Room], openings: Sequence[Opening], trajectory: Trajectory, scans: Scans
) -> list[Opening]:
    """Stretches of outer walls that nobody saw, although many rays were aimed at them and nothing stood before them.

    Outer walls: no room is behind. Ids go on after those of `openings`; bottoms are 0 and tops `TOP`:
    a scan plane shows neither.
    """
    rays = _Rays(trajectory, scans)
    inner = shapely.union_all([shapely.Polygon(room.polygon) for room in rooms])
    shapely.prepare(inner)
    first = max((opening.id for opening in openings), default=-1) + 1
    out: list[Opening] = []
    for wall in walls:
        if wall.source != "lidar":
            continue
        for low, high in wall.unseen:
            middle = wall.start + (low + high) / 2 * wall.direction
            outer = not shapely.contains_xy(inner, *(middle - BEHIND * wall.normal))
            if (
                outer
                and low > 0
                and high < wall.length - 1e-6
                and WIDTH[0] <= high - low <= WIDTH[1]
                and rays.are_lost(wall, low + INNER, high - INNER)
            ):
                ends = wall.start + low * wall.direction, wall.start + high * wall.direction
                out.append(Opening(first + len(out), "window", wall.id, *ends, 0.0, TOP))
    return out


class _Rays:
    """All rays of a drive, scans thinned evenly beyond `MAX_SCANS`, those without return too."""

    def __init__(self, trajectory: Trajectory, scans: Scans) -> None:
        chosen = np.arange(0, len(scans), max(1, int(np.ceil(len(scans) / MAX_SCANS))))
        self._poses = trajectory.at(scans.timestamps[chosen])
        self._bearings = scans.bearings
        ranges = scans.ranges[chosen].astype(np.float64)
        self._known: NDArray[np.bool_] = ~np.isnan(ranges)
        self._ranges = np.where(ranges > scans.range_max, np.inf, ranges)
        self._reach = min(RANGE, SHARE_OF_RANGE * scans.range_max)

    def are_lost(self, wall: Wall, low: float, high: float) -> bool:
        """Whether most rays aimed at [low, high] m of a wall from before it passed it or never came back."""
        offset = self._poses[:, :2] - wall.start
        before, beside = offset @ wall.normal, offset @ wall.direction
        near = np.flatnonzero((before > NEAR) & (np.abs(beside - (low + high) / 2) < self._reach))
        aimed = stopped = lost = 0
        for k in near:
            angle = self._bearings + self._poses[k, 2]
            toward = -(np.cos(angle) * wall.normal[0] + np.sin(angle) * wall.normal[1])
            with np.errstate(divide="ignore", invalid="ignore"):
                distance = np.where(toward >= STEEPEST, before[k] / toward, np.inf)
                along = beside[k] + distance * (np.cos(angle) * wall.direction[0] + np.sin(angle) * wall.direction[1])
            meets = (distance <= self._reach) & (along >= low) & (along <= high) & self._known[k]
            beyond = self._ranges[k][meets] - distance[meets]
            aimed += len(beyond)
            stopped += int((np.abs(beyond + FURNITURE / 2) <= FURNITURE / 2 + NEAR).sum())
            lost += int((beyond > NEAR).sum())
        return lost >= MIN_RAYS and lost >= LOST * (lost + stopped) and lost >= LOST_OF_ALL * aimed
