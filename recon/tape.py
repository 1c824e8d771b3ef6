"""tape.csv: distances that people measured between walls, named by the ids of an earlier build's layout.json."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from recon.errors import InputError
from recon.geometry import Array
from recon.graph.line import Lines
from recon.graph.tape import Tape
from recon.model import Layout, Wall
from recon.sequence.table import read_table

COLUMNS = "wall_a wall_b distance sigma"
MAX_ANGLE = np.radians(15.0)
"""rad: walls further from parallel than this have no distance."""


@dataclass(frozen=True)
class TapeMeasures:
    """T distances (T,), m, with standard deviations sigma (T,), m, between walls of ids first and second (T,)."""

    path: str
    first: NDArray[np.int64]
    second: NDArray[np.int64]
    distance: Array
    sigma: Array

    def __len__(self) -> int:
        return len(self.distance)

    def name(self, row: int) -> str:
        """One of them, for messages."""
        return f"{self.path}: walls {self.first[row]} and {self.second[row]}, {self.distance[row]:g} m"


def read_tape(path: Path) -> TapeMeasures:
    """Rows below the header wall_a,wall_b,distance,sigma; InputError for anything that is no distance of two walls."""
    rows = read_table(path, COLUMNS, separator=",", header=True)
    if len(rows) == 0:
        raise InputError(f"{path}: no row below the header {COLUMNS.replace(' ', ',')}")
    for number, row in enumerate(rows, start=1):
        if not np.isfinite(row).all() or (row[:2] != np.round(row[:2])).any() or row[0] == row[1]:
            raise InputError(f"{path}: row {number} is {row.tolist()}, expected the ids of two walls, m and m")
        if not (0 < row[2] < 1e4 and 0 < row[3] < 1e3):
            raise InputError(f"{path}: row {number}: {row[2]:g} m +- {row[3]:g} m, expected positive lengths")
    ids = rows[:, :2].astype(np.int64)
    return TapeMeasures(str(path), ids[:, 0], ids[:, 1], rows[:, 2].copy(), rows[:, 3].copy())


def tape_on_layout(measures: TapeMeasures, layout: Layout) -> Tape:
    """The measured walls as lines of the map of `layout`.

    Raises InputError for ids that the layout does not have, walls that no sensor saw, and pairs far from parallel.
    """
    first = [named_wall(measures.name(row), int(number), layout) for row, number in enumerate(measures.first)]
    second = [named_wall(measures.name(row), int(number), layout) for row, number in enumerate(measures.second)]
    for row, (a, b) in enumerate(zip(first, second, strict=True)):
        angle = float(np.arccos(np.clip(abs(a.direction @ b.direction), 0.0, 1.0)))
        if angle > MAX_ANGLE:
            raise InputError(f"{measures.name(row)}: are {np.degrees(angle):.0f} degrees from parallel")
    names = tuple(measures.name(row) for row in range(len(measures)))
    return Tape(wall_lines(first), wall_lines(second), measures.distance, measures.sigma, names)


def surprises(measures: TapeMeasures, solved: Array) -> list[str]:
    """A line for every distance that the solution (T,), m, is more than three standard deviations away from."""
    off = (solved - measures.distance) / measures.sigma
    return [
        f"{measures.name(int(row))}: is {solved[row]:.3f} m in the model, {off[row]:+.1f} standard deviations"
        for row in np.flatnonzero(np.abs(off) > 3.0)
    ]


def named_wall(what: str, number: int, layout: Layout) -> Wall:
    """The wall of id `number`; InputError, beginning with `what`, where there is none or no sensor saw it."""
    for wall in layout.walls:
        if wall.id == number:
            if wall.source == "inferred":
                raise InputError(f"{what}: wall {number} is inferred, no sensor saw it")
            return wall
    known = f"0 to {max(wall.id for wall in layout.walls)}" if layout.walls else "none"
    raise InputError(f"{what}: no wall {number} in the layout of this sequence (ids {known})")


def wall_lines(walls: list[Wall]) -> Lines:
    """Walls as the graph has them."""
    angle = np.array([np.arctan2(w.direction[1], w.direction[0]) for w in walls], dtype=np.float64)
    half = np.array([w.length / 2 for w in walls], dtype=np.float64)
    return Lines(
        np.array([(w.start + w.end) / 2 for w in walls]).reshape(-1, 2), angle, half, np.zeros((len(walls), 2, 2))
    )
