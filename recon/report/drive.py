"""The drive in the report: over the map of the scans, and how sure it is over time."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array
from recon.model import Wall
from recon.occupancy import FREE, OCCUPIED, UNKNOWN, Occupancy
from recon.report.charts import chart
from recon.report.html import data_address
from recon.report.svg import Frame
from recon.results.record import Record
from recon.sequence.trajectory import Trajectory

WIDTH = 1000.0
"""Units of the map's picture."""
MOST_CELLS = 1600
"""A side of the scans' map, as it is shown."""
SHADES = np.zeros(3, np.uint8)
SHADES[UNKNOWN], SHADES[FREE], SHADES[OCCUPIED] = 255, 241, 178
COLOURS = ((13, 8, 135), (126, 3, 168), (204, 71, 120), (248, 149, 64))
"""From small to large standard deviations: the colour map plasma without its palest part."""
POSES = 3000
"""Of the trajectory, at most, are drawn."""


def drive(record: Record) -> str:
    """The map, and charts over time; empty without a trajectory."""
    trajectory = record.model.trajectory
    if trajectory is None:
        return ""
    return _map(record, trajectory) + _charts(record, trajectory)


def _map(record: Record, trajectory: Trajectory) -> str:
    """Trajectory, loop closures and walls, coloured by their standard deviation, over what the scans met."""
    walls, grid, way = record.model.layout.walls, record.model.occupancy, trajectory.poses[:, :2]
    corners = [np.stack([w.start, w.end]) for w in walls] + ([] if grid is None else [grid.corners])
    frame = Frame.around(np.concatenate([way, *corners]), WIDTH)
    seen = [w for w in walls if w.source != "inferred"]
    sigmas = 1000 * np.array([w.sigma_offset for w in seen])
    largest = max(float(np.percentile(sigmas, 95)), 0.1) if seen else 0.0
    every = np.unique(np.append(np.arange(0, len(way), max(1, len(way) // POSES)), len(way) - 1))
    start = frame.place(way[:1])[0]
    parts = [
        "" if grid is None else _seen(grid, frame),
        *(_wall(w, "#8a9199", frame, ' stroke-dasharray="5 4"') for w in walls if w.source == "inferred"),
        *(_wall(w, _colour(s / largest), frame) for w, s in zip(seen, sigmas, strict=True)),
        f'<path class="loops" d="{_loops(record, trajectory, frame)}"/>' if len(record.closures) else "",
        f'<path class="way" d="{frame.line(way[every])}"/>',
        f'<circle class="start" cx="{start[0]:.1f}" cy="{start[1]:.1f}" r="7"/>',
        _ruler(frame),
    ]
    words = f"Trajectory of {len(trajectory)} scans and {len(walls)} walls over the map of the scans"
    return frame.svg("map", words, parts) + _key(record, largest, len(seen) < len(walls))


def _wall(wall: Wall, colour: str, frame: Frame, more: str = "") -> str:
    d, said = frame.line(np.stack([wall.start, wall.end])), f"wall {wall.id}, {wall.source}, {wall.length:.3f} m"
    if wall.source != "inferred":
        said += f", \u00b1 {1000 * wall.sigma_offset:.1f} mm"
    return f'<path class="wall" stroke="{colour}"{more} d="{d}"><title>{said}</title></path>'


def _colour(share: float) -> str:
    """Of a standard deviation, as a share of the largest that is told apart."""
    place = float(np.clip(share, 0, 1)) * (len(COLOURS) - 1)
    mixed = [np.interp(place, range(len(COLOURS)), channel) for channel in zip(*COLOURS, strict=True)]
    return "#" + "".join(f"{round(float(value)):02x}" for value in mixed)


def _seen(grid: Occupancy, frame: Frame) -> str:
    """What the scans saw free, and where they met something: a cell of the picture shows the most that is in it."""
    step = int(np.ceil(max(grid.cells.shape) / MOST_CELLS))
    rows, columns = (np.arange(0, size, step) for size in grid.cells.shape)
    cells = np.maximum.reduceat(np.maximum.reduceat(grid.cells, rows, axis=0), columns, axis=1)
    picture: NDArray[np.uint8] = SHADES[cells][::-1]
    data = data_address(cv2.imencode(".png", picture, [cv2.IMWRITE_PNG_COMPRESSION, 6])[1].tobytes(), "image/png")
    size = step * grid.resolution * np.array([len(columns), len(rows)])
    x, y = frame.place((grid.origin + size * [0, 1])[None])[0]
    width, height = size * frame.scale
    return f'<image x="{x:.1f}" y="{y:.1f}" width="{width:.1f}" height="{height:.1f}" href="{data}"/>'


def _loops(record: Record, trajectory: Trajectory, frame: Frame) -> str:
    ends = np.stack([trajectory.at(record.closures[:, k])[:, :2] for k in (0, 1)], axis=1)
    return "".join(frame.line(pair) for pair in ends)


def _ruler(frame: Frame) -> str:
    """A bar of a round length."""
    decade = 10 ** np.floor(np.log10(0.3 * WIDTH / frame.scale))
    length = float(max(step for step in (1, 2, 5) if step * decade * frame.scale <= 0.3 * WIDTH) * decade)
    x, y = 0.03 * WIDTH, frame.height - 12
    bar = f'<path class="ruler" d="M{x:.1f},{y - 8:.1f}v8h{length * frame.scale:.1f}v-8"/>'
    return bar + f'<text class="ruler" x="{x + 8:.1f}" y="{y - 8:.1f}">{length:g} m</text>'


def _key(record: Record, largest: float, inferred: bool) -> str:
    """What the lines are."""
    stops = ", ".join(_colour(k / 6) for k in range(7))
    items = ['<span><i class="way"></i>trajectory, a dot where it starts</span>']
    if largest > 0:
        bar = f'<i class="bar" style="background: linear-gradient(to right, {stops})"></i>'
        items.append(f"<span>walls, standard deviation of their place: 0 {bar} {largest:.1f} mm and more</span>")
    if inferred:
        items.append('<span><i class="inferred"></i>walls, inferred</span>')
    if len(record.closures):
        items.append(f'<span><i class="loops"></i>{len(record.closures)} loop closures</span>')
    return f'<p class="key">{"".join(items)}</p>'


def _charts(record: Record, trajectory: Trajectory) -> str:
    """Standard deviations of the poses, and residuals of the scans, over time."""
    times, sigmas = trajectory.timestamps - trajectory.timestamps[0], record.model.pose_sigmas
    charts = []
    if len(sigmas):
        position: Array = 100 * np.hypot(sigmas[:, 0], sigmas[:, 1])
        charts.append(chart("Position, one standard deviation, cm", times, {"": position}))
        charts.append(chart("Heading, one standard deviation, degrees", times, {"": np.degrees(sigmas[:, 2])}))
    if record.scan_residuals:
        named = {
            f"{kind} {record.residuals[kind]:.2f}" if kind in record.residuals else kind: values
            for kind, values in record.scan_residuals.items()
        }
        title = "Residuals in standard deviations, root mean square; 1 is as expected"
        charts.append(chart(title, times, named, expected=1.0))
    return f'<div class="charts">{"".join(charts)}</div>' if charts else ""
