"""control.csv: points with surveyed coordinates, where the platform stood or where two walls meet."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from recon.errors import InputError
from recon.geometry import Array
from recon.graph.control import Control
from recon.graph.estimate import Survey
from recon.model import Layout
from recon.sequence.table import content_lines, read_table
from recon.tape import named_wall, wall_lines

MARKS, CORNERS = "time x y sigma", "wall_a wall_b x y sigma"
MIN_ANGLE = np.radians(20.0)
"""rad: walls closer to parallel than this make no corner."""
LARGEST = 1e8
"""m: survey coordinates are smaller."""


@dataclass(frozen=True)
class ControlPoints:
    """M marks at times (M,), s, then C corners of walls of ids first and second (C,): K = M + C points.

    position: (K, 2) m, survey frame (x to the right of y, as on a map). sigma: (K,) m, one standard deviation of x and
    of y. files: (K,) where each was read.
    """

    times: Array
    first: NDArray[np.int64]
    second: NDArray[np.int64]
    position: Array
    sigma: Array
    files: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.sigma)

    @property
    def names(self) -> tuple[str, ...]:
        """(K,) for tables: what each point is."""
        walls = zip(self.first, self.second, strict=True)
        return tuple(f"mark at {t:.3f} s" for t in self.times) + tuple(f"corner of walls {a} and {b}" for a, b in walls)

    def name(self, row: int) -> str:
        """One of them, for messages."""
        return f"{self.files[row]}: {self.names[row]}"


def read_control(paths: tuple[Path, ...]) -> ControlPoints:
    """Points of all files, each with rows of one kind below its header: time,x,y,sigma or wall_a,wall_b,x,y,sigma.

    Raises InputError for anything else, and for fewer than two points in all.
    """
    marks, corners = [np.zeros((0, 4))], [np.zeros((0, 5))]
    of_marks: list[str] = []
    of_corners: list[str] = []
    for path in paths:
        is_mark = _has_marks(path)
        rows = read_table(path, MARKS if is_mark else CORNERS, separator=",", header=True)
        for number, row in enumerate(rows, start=1):
            _check(path, number, row, is_mark)
        (marks if is_mark else corners).append(rows)
        (of_marks if is_mark else of_corners).extend([str(path)] * len(rows))
    mark, corner = np.concatenate(marks), np.concatenate(corners)
    if len(mark) + len(corner) < 2:
        said = ", ".join(str(p) for p in paths)
        raise InputError(f"{said}: {len(mark) + len(corner)} points in all, expected two or more at different places")
    ids = corner[:, :2].astype(np.int64)
    position, sigma = np.concatenate([mark[:, 1:3], corner[:, 2:4]]), np.concatenate([mark[:, 3], corner[:, 4]])
    return ControlPoints(mark[:, 0].copy(), ids[:, 0], ids[:, 1], position, sigma, (*of_marks, *of_corners))


def _has_marks(path: Path) -> bool:
    """Whether the header is that of marks; InputError unless it is that of marks or of corners."""
    lines = content_lines(path)
    header = lines[0][1].replace(",", " ").lower().split() if lines else []
    if header not in (MARKS.split(), CORNERS.split()):
        kinds = " or ".join(repr(kind.replace(" ", ",")) for kind in (MARKS, CORNERS))
        raise InputError(f"{path}: header is {','.join(header)!r}, expected {kinds}")
    return header == MARKS.split()


def _check(path: Path, number: int, row: Array, is_mark: bool) -> None:
    ids = row[:-3]
    if not np.isfinite(row).all() or np.abs(row[-3:-1]).max() > LARGEST:
        raise InputError(f"{path}: row {number} is {row.tolist()}, expected coordinates in m")
    if not is_mark and ((ids != np.round(ids)).any() or ids[0] == ids[1]):
        raise InputError(f"{path}: row {number} is {row.tolist()}, expected the ids of two walls that meet")
    if not 0 < row[-1] < 1e3:
        raise InputError(f"{path}: row {number}: sigma is {row[-1]:g} m, expected a positive length")


def control_on_layout(points: ControlPoints, timestamps: Array, layout: Layout) -> Control:
    """The points as the graph takes them: marks between scans at `timestamps` (N,) s, corners of walls of `layout`.

    Raises InputError for times without scans, ids that the layout does not have, walls that no sensor saw, and walls
    that make no corner.
    """
    scan, other, part = _passed(points, timestamps)
    marks = len(points.times)
    sides = []
    for ids in (points.first, points.second):
        sides.append([named_wall(points.name(marks + k), int(number), layout) for k, number in enumerate(ids)])
    for k, (a, b) in enumerate(zip(*sides, strict=True)):
        angle = float(np.arcsin(np.clip(abs(a.direction[0] * b.direction[1] - a.direction[1] * b.direction[0]), 0, 1)))
        if angle < MIN_ANGLE:
            raise InputError(f"{points.name(marks + k)}: are {np.degrees(angle):.0f} degrees from parallel, no corner")
    names = tuple(points.name(row) for row in range(len(points)))
    first, second = (wall_lines(side) for side in sides)
    return Control(scan, other, part, first, second, points.position, points.sigma, names)


def _passed(points: ControlPoints, timestamps: Array) -> tuple[NDArray[np.int64], NDArray[np.int64], Array]:
    """The scan nearest to every mark's time, its neighbour beyond that time, and how far towards it: 0 to 0.5."""
    outside = np.flatnonzero((points.times < timestamps[0]) | (points.times > timestamps[-1]))
    if len(outside):
        raise InputError(
            f"{points.name(int(outside[0]))}: the scans are from {timestamps[0]:.3f} to {timestamps[-1]:.3f} s"
        )
    later = np.clip(np.searchsorted(timestamps, points.times, side="right"), 1, max(len(timestamps) - 1, 1))
    later = np.minimum(later, len(timestamps) - 1)
    earlier = np.maximum(later - 1, 0)
    gap = np.maximum(timestamps[later] - timestamps[earlier], 1e-9)
    part = np.clip((points.times - timestamps[earlier]) / gap, 0.0, 1.0)
    near = part <= 0.5
    return np.where(near, earlier, later), np.where(near, later, earlier), np.minimum(part, 1.0 - part)


def contradictions(points: ControlPoints, survey: Survey) -> list[str]:
    """A line for every point that was left out."""
    return [
        f"{points.name(int(row))}: left out, it is {survey.off[row]:.1f} standard deviations from what map and other "
        f"points say ({np.linalg.norm(survey.solved[row] - points.position[row]):.3f} m off)"
        for row in np.flatnonzero(~survey.kept)
    ]
