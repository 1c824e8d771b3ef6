"""Tables of the report."""

from __future__ import annotations

import numpy as np

from recon.model import Layout
from recon.report.html import folded, section, table
from recon.results.record import Record


def tape(record: Record) -> str:
    """Distances measured by hand beside those of the model."""
    rows: list[tuple[str, ...]] = []
    for row in record.tape:
        (a, b), measured, sigma, solved = row["walls"], row["measured"], row["sigma"], row["solved"]
        off = f"{(solved - measured) * 1000:+.1f}", f"{(solved - measured) / sigma:+.1f}"
        rows.append((f"{a} to {b}", f"{measured:.3f}", f"{sigma * 1000:.1f}", f"{solved:.3f}", *off))
    head = ("walls", "measured, m", "sigma, mm", "model, m", "residual, mm", "residual, sigmas")
    return section("Measured by hand", table(head, rows)) if rows else ""


def control(record: Record) -> str:
    """Surveyed points beside those of the model, and where the map lies in the survey."""
    if record.control is None:
        return ""
    rows: list[tuple[str, ...]] = []
    for point in record.control["points"]:
        (x, y), sigma = point["surveyed"], point["sigma"]
        dx, dy = np.subtract(point["solved"], point["surveyed"])
        off = f"{dx * 1000:+.1f}", f"{dy * 1000:+.1f}", f"{np.hypot(dx, dy) / sigma:.1f}"
        used = "yes" if point["used"] else "left out"
        rows.append((point["name"], f"{x:.3f}", f"{y:.3f}", f"{sigma * 1000:.1f}", *off, used))
    head = ("point", "x, m", "y, m", "sigma, mm", "residual x, mm", "residual y, mm", "sigmas", "used")
    x, y, yaw = record.control["survey_from_map"]
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


def time(record: Record) -> str:
    """Seconds of every stage."""
    rows = [(name, f"{seconds:.2f}") for name, seconds in record.seconds.items()]
    rows.append(("all", f"{sum(record.seconds.values()):.2f}"))
    return section("Time", table(("stage", "seconds"), rows))
