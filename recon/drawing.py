"""One picture of an estimate: trajectory, walls, loop closures, residuals, uncertainty ellipses; truth where known."""

from __future__ import annotations

import io
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from recon.errors import OutputError
from recon.files import atomic_path
from recon.geometry import Array
from recon.model import Wall
from recon.occupancy import FREE, OCCUPIED, UNKNOWN, Occupancy
from recon.sequence.trajectory import Trajectory

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SUFFIXES = (".png", ".svg", ".pdf")
DPI = 130
ELLIPSES = 30
"""Poses that show their uncertainty."""
SIGMAS = 3.0
"""Standard deviations of an ellipse's half axis."""
ROWS = 4
"""Kinds of residuals that there is room for at least."""
SHOWN = 0.02
"""Part of the picture's width that the largest ellipse takes up."""
LEAST = 0.02
"""Standard deviations: smaller residuals are drawn here."""
INK, SOFT, PATH, RIGHT, WRONG, LOOP = "#1c1e21", "#9aa0a6", "#1f6feb", "#f0a35e", "#c62828", "#2e9e4f"

FLOOR_COLOURS = np.zeros((3, 3), np.uint8)
FLOOR_COLOURS[UNKNOWN], FLOOR_COLOURS[FREE], FLOOR_COLOURS[OCCUPIED] = (255, 255, 255), (238, 242, 247), (170, 178, 188)

KINDS = {"lidar": PATH, "image": WRONG, "motion": LOOP, "odometry": RIGHT}


@dataclass(frozen=True)
class Truth:
    """What is known of the truth, in the estimate's frame; empty where nothing is.

    way: (N, 2) m. walls: (2, 2) m each. errors: (n, 3) time s, distance m, heading deg. relations: (K, 2) errors of
    relative poses, m and deg; worst: (k, 2, 2) m, ends of those that are furthest off.
    """

    way: Array = field(default_factory=lambda: np.zeros((0, 2)))
    walls: tuple[Array, ...] = ()
    errors: Array = field(default_factory=lambda: np.zeros((0, 3)))
    relations: Array = field(default_factory=lambda: np.zeros((0, 2)))
    worst: Array = field(default_factory=lambda: np.zeros((0, 2, 2)))


@dataclass(frozen=True)
class Drawing:
    """What is drawn. sigmas: (N, 3) m, m, rad of the poses, or (0, 3). closures: (L, 2, 2) m, ends of each.

    residuals: root mean square of normalised residuals by kind of factor; scan_residuals: (N,) those of every scan.
    occupancy: the map of the scans, drawn below everything.
    """

    trajectory: Trajectory
    sigmas: Array
    walls: tuple[Wall, ...]
    closures: Array
    residuals: dict[str, float]
    truth: Truth = field(default_factory=Truth)
    scan_residuals: dict[str, Array] = field(default_factory=dict)
    occupancy: Occupancy | None = None


def check_suffix(path: Path) -> None:
    """Raises OutputError for a suffix that is not one of SUFFIXES."""
    if path.suffix.lower() not in SUFFIXES:
        raise OutputError(f"{path}: unknown suffix {path.suffix!r}, expected one of {', '.join(SUFFIXES)}")


def save_drawing(drawing: Drawing, path: Path) -> None:
    """Write the picture; raises as `check_suffix`."""
    check_suffix(path)
    content = render_drawing(drawing, path.suffix.lower()[1:])
    with atomic_path(path) as temporary:
        temporary.write_bytes(content)


def render_drawing(drawing: Drawing, kind: str) -> bytes:
    """The picture as "png", "svg" or "pdf", the same bytes for the same drawing."""
    import matplotlib
    from matplotlib.figure import Figure

    undated: dict[str, dict[str, Any]] = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}
    buffer = io.BytesIO()
    with matplotlib.rc_context({"svg.hashsalt": "recon", "font.size": 9.0}):
        figure = Figure(figsize=(13.0, 8.5))
        _draw(figure, drawing)
        figure.savefig(buffer, format=kind, dpi=DPI, metadata=undated.get(kind, {}))
    return buffer.getvalue()


def _draw(figure: Figure, drawing: Drawing) -> None:
    rows = 4 if drawing.scan_residuals else 3
    grid = figure.add_gridspec(
        rows, 2, width_ratios=[2.5, 1.0], left=0.05, right=0.99, bottom=0.1, top=0.96, wspace=0.1, hspace=0.4
    )
    _map(figure.add_subplot(grid[:, 0]), drawing)
    top, middle, bottom, *last = (figure.add_subplot(grid[k, 1]) for k in range(rows))
    if len(drawing.truth.relations):
        _shares(top, drawing.truth.relations[:, 0], "error of relative position, m")
        _shares(middle, drawing.truth.relations[:, 1], "error of relative heading, deg")
    else:
        _position(top, drawing)
        _heading(middle, drawing)
    if last:
        _over_the_drive(bottom, drawing)
        _histogram(last[0], drawing)
    else:
        _residuals(bottom, drawing.residuals)


def _map(axes: Axes, drawing: Drawing) -> None:
    from matplotlib.collections import LineCollection

    truth, way = drawing.truth, drawing.trajectory.poses[:, :2]
    if drawing.occupancy is not None:
        _seen_floor(axes, drawing.occupancy)
    inferred = [np.stack([w.start, w.end]) for w in drawing.walls if w.source == "inferred"]
    for lines, colour, width, style, label in (
        (truth.walls, RIGHT, 4.0, "solid", "true walls"),
        (inferred, SOFT, 1.0, (0, (2, 1)), "walls, inferred"),
        (list(drawing.closures), LOOP, 0.8, "solid", "loop closures"),
        (list(truth.worst), WRONG, 0.8, "solid", "worst relations"),
    ):
        if len(lines):
            axes.add_collection(
                LineCollection(list(lines), colors=colour, linewidths=width, linestyles=style, label=label)
            )
    _walls(axes, [wall for wall in drawing.walls if wall.source != "inferred"])
    if len(truth.way):
        axes.plot(*truth.way.T, color=RIGHT, linewidth=2.2, label="true trajectory")
    axes.plot(*way.T, color=PATH, linewidth=1.0, label="trajectory")
    axes.plot(*way[0], "o", color=PATH, markersize=4)
    axes.set_aspect("equal")
    axes.autoscale_view()
    _ellipses(axes, drawing)
    axes.set_xlabel("x, m")
    axes.set_ylabel("y, m")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.07), ncols=7, frameon=False, fontsize=8)


def _seen_floor(axes: Axes, grid: Occupancy) -> None:
    """What the scans saw free, and where they met something."""
    (left, bottom), (right, top) = grid.corners[0], grid.corners[2]
    picture = FLOOR_COLOURS[grid.cells]
    axes.imshow(picture, extent=(left, right, bottom, top), origin="lower", interpolation="antialiased", zorder=0)


def _walls(axes: Axes, walls: list[Wall]) -> None:
    """Measured walls, coloured by the standard deviation of their place."""
    from matplotlib.collections import LineCollection

    if not walls:
        return
    sigmas = 1000 * np.array([wall.sigma_offset for wall in walls])
    lines = LineCollection([np.stack([w.start, w.end]) for w in walls], cmap="plasma", linewidths=2.0, label="walls")
    lines.set_array(sigmas)
    lines.set_clim(0.0, max(float(np.percentile(sigmas, 95)), 0.1) * 1.15)  # the palest yellow is hard to see
    axes.add_collection(lines)
    bar = axes.figure.colorbar(lines, ax=axes, shrink=0.5, aspect=40, pad=0.01)
    bar.set_label("standard deviation of a wall's place, mm", fontsize=8)


def _ellipses(axes: Axes, drawing: Drawing) -> None:
    """Standard deviations along x and y at some poses, magnified by a round factor so that they show."""
    from matplotlib.patches import Ellipse

    if not len(drawing.sigmas) or not (largest := SIGMAS * float(drawing.sigmas[:, :2].max())) > 0:
        return
    low, high = axes.get_xlim()
    factor = max(1.0, _round(SHOWN * (high - low) / largest))
    for k in np.unique(np.linspace(0, len(drawing.sigmas) - 1, ELLIPSES).astype(np.int64)):
        x, y, _ = drawing.trajectory.poses[k]
        width, height = 2 * SIGMAS * factor * drawing.sigmas[k, :2]
        axes.add_patch(Ellipse((x, y), width, height, facecolor=PATH, alpha=0.25, edgecolor=PATH))
    times = f", {factor:.0f} times as large" if factor > 1 else ""
    axes.set_title(f"Ellipses: {SIGMAS:.0f} standard deviations of position{times}", fontsize=9, color=INK)


def _round(number: float) -> float:
    """The largest of 1, 2, 5, 10, 20... that is not above `number`."""
    decade = 10.0 ** np.floor(np.log10(number))
    return float(decade * max(step for step in (1.0, 2.0, 5.0) if step * decade <= number * (1 + 1e-9)))


def _position(axes: Axes, drawing: Drawing) -> None:
    spread = 100 * np.hypot(drawing.sigmas[:, 0], drawing.sigmas[:, 1])
    _over_time(axes, drawing, spread, 100 * drawing.truth.errors[:, 1], "position, cm")


def _heading(axes: Axes, drawing: Drawing) -> None:
    spread = np.degrees(drawing.sigmas[:, 2])
    _over_time(axes, drawing, spread, drawing.truth.errors[:, 2], "heading, deg")


def _over_time(axes: Axes, drawing: Drawing, sigma: Array, error: Array, label: str) -> None:
    """Standard deviation, and error where the truth is known, over time since the first scan."""
    start = drawing.trajectory.timestamps[0]
    if len(sigma):
        axes.plot(drawing.trajectory.timestamps - start, sigma, color=PATH, linewidth=1.0, label="standard deviation")
    if len(error):
        axes.plot(drawing.truth.errors[:, 0] - start, error, color=RIGHT, linewidth=1.0, label="error")
    if len(sigma) or len(error):
        axes.legend(loc="best", frameon=False, fontsize=8)
    axes.set_ylim(bottom=0)
    axes.set_xlabel("time, s")
    axes.set_ylabel(label)


def _shares(axes: Axes, errors: Array, label: str) -> None:
    """Which part of the relations has at most which error."""
    ordered = np.sort(np.maximum(errors, 1e-6))
    axes.plot(ordered, (np.arange(len(ordered)) + 1) / len(ordered), color=PATH, linewidth=1.2)
    axes.axvline(float(errors.mean()), color=RIGHT, linewidth=1.2, label=f"mean {errors.mean():.4f}")
    axes.set_xscale("log")
    axes.set_ylim(0, 1)
    axes.set_xlabel(label)
    axes.set_ylabel("part of the relations")
    axes.legend(loc="lower right", frameon=False, fontsize=8)


def _over_the_drive(axes: Axes, drawing: Drawing) -> None:
    """Residuals of every scan over time since the first."""
    times = drawing.trajectory.timestamps - drawing.trajectory.timestamps[0]
    for name, values in drawing.scan_residuals.items():
        axes.plot(times, np.clip(values, LEAST, None), ".", color=KINDS[name], markersize=1.5)
    axes.axhline(1.0, color=INK, linewidth=0.6)
    axes.set_yscale("log")
    axes.set_xlabel("time, s")
    axes.set_ylabel("residual, sigmas")


def _histogram(axes: Axes, drawing: Drawing) -> None:
    """How many scans have which residual; 1 is as expected."""
    edges = np.geomspace(LEAST, 100.0, 60)
    for name, values in drawing.scan_residuals.items():
        known = np.clip(values[np.isfinite(values)], edges[0], edges[-1])
        label = f"{name}, rms {drawing.residuals[name]:.2f}" if name in drawing.residuals else name
        axes.hist(known, edges.tolist(), histtype="step", color=KINDS[name], linewidth=1.2, label=label)
    axes.axvline(1.0, color=INK, linewidth=0.6)
    axes.set_xscale("log")
    axes.set_xlabel("residual of a scan, sigmas (root mean square)")
    axes.set_ylabel("scans")
    axes.legend(loc="best", frameon=False, fontsize=8)


def _residuals(axes: Axes, residuals: dict[str, float]) -> None:
    names = list(residuals)
    axes.barh(np.arange(len(names)), [residuals[n] for n in names], color=PATH, height=0.5)
    axes.axvline(1.0, color=RIGHT, linewidth=1.2)
    axes.set_yticks(np.arange(len(names)), names)
    axes.set_xlabel("residuals, root mean square in standard deviations")
    axes.set_ylim(max(len(names), ROWS) - 0.5, -0.5)
