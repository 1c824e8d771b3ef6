"""Maps for robots: map.yaml and map.pgm of ROS map_server and Nav2."""

from __future__ import annotations

import numpy as np

from recon.doorways import doorways
from recon.exporters.options import DEFAULTS, ExportOptions
from recon.exporters.output import Output
from recon.geometry import Array
from recon.model import Layout, Model
from recon.occupancy import FREE, OCCUPIED, UNKNOWN, Occupancy, map_yaml, picture, resampled, trimmed
from recon.plan import dominant_angle

FINEST = 0.025
"""m, cells of maps drawn from a layout, where a result holds no occupancy."""
MOST_CELLS = 16_000_000


def write_map(model: Model, stem: str, options: ExportOptions = DEFAULTS) -> Output:
    """`<stem>.yaml`, and `<stem>.pgm` beside it: what scans saw, and glass, which they do not see, as occupied.

    A result without occupancy gives the map of its layout, and says so. In the frame "building" walls run along rows
    and columns; `map_from_building` (x, y, yaw) then brings its coordinates to those of everything else.
    """
    drawn = model.occupancy is None
    grid = _of_layout(model.layout) if model.occupancy is None else _with_glass(model.occupancy, model.layout)
    yaw = dominant_angle(model.layout) if options.map_frame == "building" else 0.0
    chosen = resampled(grid, options.map_resolution, yaw)
    more = f"map_from_building: [0.0, 0.0, {yaw:.9f}]\n" if options.map_frame == "building" else ""
    if drawn:
        more += "# drawn from the layout: this result holds no occupancy\n"
    grey = picture(chosen)
    header = f"P5\n{grey.shape[1]} {grey.shape[0]}\n255\n".encode()
    image = f"{stem}.pgm"
    return Output(map_yaml(chosen, image, more).encode(), {image: header + grey.tobytes()})


def _with_glass(grid: Occupancy, layout: Layout) -> Occupancy:
    """The grid with windows closed: a laser passes through glass, a robot does not."""
    windows = [opening for opening in layout.openings if opening.type == "window"]
    cells = grid.cells.copy()
    for window in windows:
        _draw(Occupancy(grid.origin, grid.resolution, cells), window.start, window.end)
    return Occupancy(grid.origin, grid.resolution, cells)


def _draw(grid: Occupancy, start: Array, end: Array, state: int = OCCUPIED) -> None:
    """Sets the cells that the segment between two points (2,) passes, in place."""
    count = max(int(np.ceil(float(np.linalg.norm(end - start)) / grid.resolution * 4)), 1) + 1
    points = start + np.linspace(0.0, 1.0, count)[:, None] * (end - start)
    index = np.floor((points - grid.origin) / grid.resolution).astype(np.int64)
    rows, columns = grid.cells.shape
    index = index[((index >= 0) & (index < [columns, rows])).all(axis=1)]
    grid.cells[index[:, 1], index[:, 0]] = state


def _of_layout(layout: Layout) -> Occupancy:
    """Rooms free, the faces of walls and objects occupied, passages and open doors free."""
    import cv2

    outlines = [room.polygon for room in layout.rooms] + [np.stack([w.start, w.end]) for w in layout.walls]
    if not outlines:
        return Occupancy(np.zeros(2), FINEST, np.full((1, 1), UNKNOWN, np.uint8))
    points = np.concatenate(outlines)
    low, high = points.min(axis=0) - 4 * FINEST, points.max(axis=0) + 4 * FINEST
    resolution = max(FINEST, float(np.sqrt(np.prod(high - low) / MOST_CELLS)))
    columns, rows = np.ceil((high - low) / resolution).astype(int)
    cells = np.full((rows, columns), UNKNOWN, np.uint8)
    grid = Occupancy(low, resolution, cells)
    for room in layout.rooms:
        cv2.fillPoly(cells, [np.floor((room.polygon - low) / resolution).astype(np.int32)], FREE)
    for wall in layout.walls:
        _draw(grid, wall.start, wall.end)
    for way in doorways(layout):
        if way.type == "passage" or way.open:
            ends = np.concatenate([np.stack([o.start, o.end]) for o in way.openings])
            cv2.fillConvexPoly(cells, cv2.convexHull(np.floor((ends - low) / resolution).astype(np.int32)), FREE)
    for thing in layout.objects:
        for outline in thing.legs or (thing.footprint,):
            cv2.fillPoly(cells, [np.floor((outline - low) / resolution).astype(np.int32)], OCCUPIED)
    return trimmed(grid)
