"""Which parts of the floor are free, occupied or were never seen: the map that robots drive on."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from recon.errors import InputError
from recon.files import read_text
from recon.geometry import Array, apply2

UNKNOWN, FREE, OCCUPIED = 0, 1, 2
"""States of a cell."""
GREY = np.array([205, 254, 0], np.uint8)
"""Their grey values in map_server's pictures, by state."""
FREE_THRESHOLD, OCCUPIED_THRESHOLD = 0.196, 0.65
"""As map_saver writes them: of (255 - grey) / 255. The grey of what is unknown lies just above the first."""
MOST_CELLS = 60_000_000
"""A finer grid of a larger building is refused."""

BLOCK = 1_000_000
"""Cells sampled at a time."""

States = NDArray[np.uint8]


@dataclass(frozen=True)
class Occupancy:
    """A grid in the map frame. origin: (2,) m, outer corner of cell [0, 0]; cells: (rows, columns), row along y."""

    origin: Array
    resolution: float
    cells: States

    def at(self, points: Array) -> States:
        """States (N,) at points (N, 2), m, map frame; UNKNOWN outside."""
        index = np.floor((points - self.origin) / self.resolution).astype(np.int64)
        rows, columns = self.cells.shape
        inside = ((index >= 0) & (index < [columns, rows])).all(axis=1)
        out = np.full(len(points), UNKNOWN, np.uint8)
        out[inside] = self.cells[index[inside, 1], index[inside, 0]]
        return out

    @property
    def corners(self) -> Array:
        """(4, 2) m, counter-clockwise from the origin."""
        size = self.resolution * np.array(self.cells.shape[::-1])
        return self.origin + size * np.array([[0, 0], [1, 0], [1, 1], [0, 1]])


def resampled(grid: Occupancy, resolution: float, yaw: float = 0.0) -> Occupancy:
    """The grid at another resolution (m), its axes those of the map frame turned by `yaw` (rad) about its origin.

    `origin` of the result is in the turned frame. A cell is occupied where any part of it is, so that walls stay
    closed, else free where most of it is. Raises InputError for more than MOST_CELLS cells.
    """
    turned = apply2((0.0, 0.0, -yaw), grid.corners)
    low = np.floor(turned.min(axis=0) / resolution + 1e-6) * resolution
    columns, rows = (int(n) for n in np.ceil((turned.max(axis=0) - low) / resolution - 1e-6))
    if rows * columns > MOST_CELLS:
        raise InputError(f"map resolution {resolution:g} m: gives {rows} x {columns} cells, expected a coarser one")
    steps = max(2, int(np.ceil(resolution / grid.resolution)) + 1)
    inside = (np.arange(steps) + 0.5) / steps
    occupied, free = np.zeros((rows, columns), np.bool_), np.zeros((rows, columns), np.uint16)
    block = max(1, BLOCK // columns)
    for top in range(0, rows, block):  # a part at a time: the samples of a large grid would fill the memory
        part = slice(top, min(top + block, rows))
        for dy in inside:
            for dx in inside:
                x, y = (np.arange(columns) + dx), (np.arange(rows)[part] + dy)
                found = _sampled(grid, low[0] + resolution * x, low[1] + resolution * y, yaw)
                occupied[part] |= found == OCCUPIED
                free[part] += found == FREE
    cells = np.where(occupied, OCCUPIED, np.where(2 * free >= steps * steps, FREE, UNKNOWN)).astype(np.uint8)
    return trimmed(Occupancy(low, resolution, cells))


def _sampled(grid: Occupancy, x: Array, y: Array, yaw: float) -> States:
    """States (rows, columns) where rows y and columns x (m) of a frame turned by `yaw` cross."""
    if yaw == 0.0:
        column, row = (
            np.floor((v - o) / grid.resolution).astype(np.int64) for v, o in zip((x, y), grid.origin, strict=True)
        )
        rows, columns = grid.cells.shape
        out = np.full((len(y), len(x)), UNKNOWN, np.uint8)
        on, along = (row >= 0) & (row < rows), (column >= 0) & (column < columns)
        out[np.ix_(on, along)] = grid.cells[np.ix_(row[on], column[along])]
        return out
    points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    return grid.at(apply2((0.0, 0.0, yaw), points)).reshape(len(y), len(x))


def trimmed(grid: Occupancy) -> Occupancy:
    """Without the rows and columns at the rim that hold nothing known; one cell at least."""
    rows, columns = np.nonzero(grid.cells)
    if not len(rows):
        return Occupancy(grid.origin, grid.resolution, grid.cells[:1, :1])
    low, high = (rows.min(), columns.min()), (rows.max() + 1, columns.max() + 1)
    origin = grid.origin + grid.resolution * np.array([low[1], low[0]])
    return Occupancy(origin, grid.resolution, grid.cells[low[0] : high[0], low[1] : high[1]])


def map_yaml(grid: Occupancy, image: str, more: str = "") -> str:
    """map.yaml of ROS map_server and Nav2 for the picture `image`; more: further lines."""
    x, y = (round(float(v), 6) + 0.0 for v in grid.origin)
    name = yaml.safe_dump(image, default_style='"', allow_unicode=True, width=10_000).strip()
    return (
        f"image: {name}\nmode: trinary\nresolution: {round(grid.resolution, 9)}\norigin: [{x}, {y}, 0.0]\nnegate: 0\n"
        f"occupied_thresh: {OCCUPIED_THRESHOLD}\nfree_thresh: {FREE_THRESHOLD}\n{more}"
    )


def picture(grid: Occupancy) -> States:
    """(rows, columns) grey as map_server reads it, row 0 at the top: the largest y."""
    return GREY[grid.cells[::-1]]


def save_occupancy(grid: Occupancy, folder: Path) -> None:
    """folder/occupancy.png and occupancy.yaml, which map_server reads as they are."""
    import cv2

    ok, data = cv2.imencode(".png", picture(grid))
    if not ok:
        raise OSError(None, "the picture could not be encoded", str(folder / "occupancy.png"))
    (folder / "occupancy.png").write_bytes(data.tobytes())
    (folder / "occupancy.yaml").write_text(map_yaml(grid, "occupancy.png"), encoding="utf-8")


def load_occupancy(folder: Path) -> Occupancy | None:
    """What `save_occupancy` wrote, None where there is none. Raises InputError for damaged files."""
    path = folder / "occupancy.yaml"
    if not path.exists():
        return None
    try:
        content: dict[str, Any] = yaml.safe_load(read_text(path))
        origin, resolution = np.array(content["origin"][:2], dtype=np.float64), float(content["resolution"])
    except (yaml.YAMLError, KeyError, TypeError, ValueError) as error:
        raise InputError(f"{path}: is damaged ({error!r}), expected what recon build wrote") from None
    if not (np.isfinite(origin).all() and origin.shape == (2,) and np.isfinite(resolution) and resolution > 0):
        raise InputError(f"{path}: origin or resolution is no number, expected [x, y, yaw] and metres a cell")
    return Occupancy(origin, resolution, _states(folder / "occupancy.png"))


def _states(path: Path) -> States:
    import cv2

    image = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE) if path.is_file() else None
    if image is None:
        raise InputError(f"{path}: is missing or no picture, expected the map beside occupancy.yaml")
    cells = np.full(image.shape, UNKNOWN, np.uint8)
    cells[image >= GREY[FREE] - 2] = FREE
    cells[image <= GREY[OCCUPIED] + 2] = OCCUPIED
    return cells[::-1].copy()
