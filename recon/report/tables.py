"""Tables of the report."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from recon.model import Layout
from recon.report.html import folded, section, table

if TYPE_CHECKING:
    from recon.pipeline import Build


def tape(build: Build) -> str:
    """Distances measured by hand beside those of the model."""
    if (tape := build.measured.tape) is None:
        return ""
    rows: list[tuple[str, ...]] = [
        (f"{a} to {b}", f"{d:.3f}", f"{s * 1000:.1f}", f"{m:.3f}", f"{(m - d) * 1000:+.1f}", f"{(m - d) / s:+.1f}")
        for a, b, d, s, m in zip(tape.first, tape.second, tape.distance, tape.sigma, build.estimate.tape, strict=True)
    ]
    head = ("walls", "measured, m", "sigma, mm", "model, m", "residual, mm", "residual, sigmas")
    return section("Measured by hand", table(head, rows))


def control(build: Build) -> str:
    """Surveyed points beside those of the model, and where the map lies in the survey."""
    points, survey = build.measured.control, build.estimate.survey
    if points is None or survey is None:
        return ""
    rows: list[tuple[str, ...]] = []
    for name, (x, y), (dx, dy), sigma, kept in zip(
        points.names, points.position, survey.solved - points.position, points.sigma, survey.kept, strict=True
    ):
        off = f"{dx * 1000:+.1f}", f"{dy * 1000:+.1f}", f"{np.hypot(dx, dy) / sigma:.1f}"
        rows.append((name, f"{x:.3f}", f"{y:.3f}", f"{sigma * 1000:.1f}", *off, "yes" if kept else "left out"))
    head = ("point", "x, m", "y, m", "sigma, mm", "residual x, mm", "residual y, mm", "sigmas", "used")
    x, y, yaw = survey.survey_from_map
    place = f"The map's origin is at x {x:.3f} m, y {y:.3f} m of the survey, its x axis at {np.degrees(yaw):.4f} deg."
    return section("Surveyed points", f"<p>{place}</p>" + table(head, rows))


def rooms(layout: Layout) -> str:
    """Areas and heights."""
    rows: list[tuple[str, ...]] = []
    for room in layout.rooms:
        height = layout.ceiling_height if room.ceiling_height is None else room.ceiling_height
        sigma = layout.sigma_ceiling if room.ceiling_height is None else room.sigma_ceiling
        spread = "" if sigma is None else f" \u00b1 {sigma:.3f}"
        high = "not seen" if height is None else f"{height:.3f}{spread}"
        rows.append((room.name, f"{room.area:.2f}", f"{room.perimeter:.2f}", high))
    return section("Rooms", table(("room", "area, m\u00b2", "perimeter, m", "height, m"), rows)) if rows else ""


def walls(layout: Layout) -> str:
    """What is known of every wall."""
    rows: list[tuple[str, ...]] = [
        (
            f"{w.id}",
            f"{w.length:.3f}",
            f"{w.sigma_offset * 1000:.1f}",
            f"{np.degrees(w.sigma_angle):.3f}",
            w.source,
            f"{w.observations}",
        )
        for w in layout.walls
    ]
    head = ("wall", "length, m", "sigma across, mm", "sigma angle, deg", "source", "observations")
    return section("Walls", folded(f"{len(rows)} walls", table(head, rows))) if rows else ""


def time(build: Build) -> str:
    """Seconds of every stage."""
    rows = [(name, f"{seconds:.2f}") for name, seconds in build.seconds.items()]
    rows.append(("all", f"{sum(build.seconds.values()):.2f}"))
    return section("Time", table(("stage", "seconds"), rows))
