"""report.html: what a person looks at first. One self-contained page."""

from __future__ import annotations

import base64
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.dollhouse import render_dollhouse
from recon.drawing import Drawing, render_drawing
from recon.exporters.svg import write_svg
from recon.model import Layout

if TYPE_CHECKING:
    from recon.pipeline import Build

STYLE = """
:root { color-scheme: light dark; --ink: #1c1e21; --paper: #fff; --soft: #6b7076; --line: #dfe2e6; }
@media (prefers-color-scheme: dark) { :root { --ink: #e8eaed; --paper: #17191c; --soft: #9aa0a6; --line: #34383d; } }
body { margin: 0 auto; max-width: 70rem; padding: 1rem; background: var(--paper); color: var(--ink);
  font: 16px/1.5 system-ui, sans-serif; }
h1 { font-size: 1.6rem; margin: 0.5rem 0; } h2 { font-size: 1.15rem; margin: 2rem 0 0.5rem; }
img, svg { max-width: 100%; height: auto; } .plan, .house { background: #fff; border-radius: 6px; }
.facts { display: flex; flex-wrap: wrap; gap: 0.5rem 2rem; margin: 1rem 0; padding: 0; list-style: none; }
.facts b { display: block; font-size: 1.3rem; } .facts span, figcaption { color: var(--soft); font-size: 0.9rem; }
.views { display: grid; grid-template-columns: repeat(auto-fill, minmax(16rem, 1fr)); gap: 0.75rem; }
figure { margin: 0; } .scroll { overflow-x: auto; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
td, th { border-bottom: 1px solid var(--line); padding: 0.2rem 0.8rem 0.2rem 0; text-align: right; }
td:first-child, th:first-child { text-align: left; }
"""


def write_report(build: Build, folder: Path) -> None:
    """Write folder/report.html from a build and the overlays that lie in the folder."""
    model = build.model
    parts = [
        f"<h1>{escape(model.name)}</h1>",
        _facts(build),
        _section("The model", f'<img class="house" alt="The model from above" src="{_jpeg(render_dollhouse(model))}">'),
        _section("The plan", f'<div class="plan">{_plan(build)}</div>'),
        _messages("Warnings", build.warnings),
        _messages("What was assumed", model.notes),
        _overlays(folder),
        _section("Trajectory and accuracy", _drawing(build)),
        _tape(build),
        _control(build),
        _section("Walls", _walls(model.layout)),
        _section("Time", _table(("stage", "seconds"), [(name, f"{s:.2f}") for name, s in build.seconds.items()])),
    ]
    page = (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(model.name)} - recon</title><style>{STYLE}</style></head>\n<body>\n"
    )
    (folder / "report.html").write_text(page + "\n".join(parts) + "\n</body></html>\n", encoding="utf-8")


def _facts(build: Build) -> str:
    layout, calibration = build.model.layout, build.calibration
    measured = [w.sigma_offset for w in layout.walls if w.source != "inferred"]
    facts = [
        (f"{sum(w.length for w in layout.walls):.1f} m", f"of wall in {len(layout.walls)} walls"),
        (f"{len(layout.rooms)}", "room" if len(layout.rooms) == 1 else "rooms"),
        (f"{len(layout.openings)}", "doors and openings"),
        (f"{layout.extrusion_height:.2f} m", "high" if layout.ceiling_height is not None else "high (assumed)"),
    ]
    if measured:
        facts.append((f"{np.median(measured) * 1000:.1f} mm", "standard deviation of a wall, median"))
    if calibration is not None:
        height = calibration.platform_from_camera.translation[2]
        facts.append((f"{height:.3f} m", f"camera height ({calibration.source})"))
        if calibration.time_offset:
            facts.append((f"{1000 * calibration.time_offset:+.0f} ms", "added to image stamps: the camera's clock"))
    return '<ul class="facts">' + "".join(f"<li><b>{v}</b><span>{n}</span></li>" for v, n in facts) + "</ul>"


def _section(title: str, content: str) -> str:
    return f"<h2>{escape(title)}</h2>\n{content}"


def _messages(title: str, messages: tuple[str, ...]) -> str:
    if not messages:
        return ""
    return _section(title, "<ul>" + "".join(f"<li>{escape(m)}</li>" for m in messages) + "</ul>")


def _plan(build: Build) -> str:
    """The floorplan's SVG element, without its XML declaration."""
    text = write_svg(build.model, "plan").content.decode("utf-8")
    return text[text.index("<svg") :]


def _drawing(build: Build) -> str:
    """Trajectory, walls, loop closures, uncertainty and residuals in one picture."""
    estimate = build.estimate
    places = estimate.trajectory.poses[estimate.closures, :2]
    drawing = Drawing(
        estimate.trajectory,
        estimate.pose_sigmas,
        build.model.layout.walls,
        places,
        dict(estimate.residuals),
        scan_residuals=estimate.scan_residuals,
    )
    data = _base64(render_drawing(drawing, "png"))
    return f'<img class="plan" alt="Trajectory and accuracy" src="data:image/png;base64,{data}">'


def _overlays(folder: Path) -> str:
    pictures = sorted((folder / "overlays").glob("*.jpg")) if (folder / "overlays").is_dir() else []
    if not pictures:
        return ""
    figures = [
        f'<figure><img alt="{escape(p.stem)}" src="data:image/jpeg;base64,{_base64(p.read_bytes())}">'
        f"<figcaption>{escape(p.stem)}</figcaption></figure>"
        for p in pictures
    ]
    return _section("What every pixel shows", f'<div class="views">{"".join(figures)}</div>')


def _tape(build: Build) -> str:
    """Distances measured by hand beside those of the model."""
    if (tape := build.measured.tape) is None:
        return ""
    rows: list[tuple[str, ...]] = [
        (f"{a} to {b}", f"{d:.3f}", f"{s * 1000:.1f}", f"{m:.3f}", f"{(m - d) * 1000:+.1f}", f"{(m - d) / s:+.1f}")
        for a, b, d, s, m in zip(tape.first, tape.second, tape.distance, tape.sigma, build.estimate.tape, strict=True)
    ]
    head = ("walls", "measured, m", "sigma, mm", "model, m", "residual, mm", "residual, sigmas")
    return _section("Measured by hand", _table(head, rows))


def _control(build: Build) -> str:
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
    return _section("Surveyed points", f"<p>{place}</p>" + _table(head, rows))


def _walls(layout: Layout) -> str:
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
    return _table(("wall", "length, m", "sigma across, mm", "sigma angle, deg", "source", "observations"), rows)


def _table(head: tuple[str, ...], rows: list[tuple[str, ...]]) -> str:
    cells = "".join(f"<th>{escape(c)}</th>" for c in head)
    body = "".join("<tr>" + "".join(f"<td>{escape(c)}</td>" for c in row) + "</tr>" for row in rows)
    return f'<div class="scroll"><table><tr>{cells}</tr>{body}</table></div>'


def _jpeg(rgb: NDArray[np.uint8]) -> str:
    data = cv2.imencode(".jpg", rgb[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, 88])[1].tobytes()
    return f"data:image/jpeg;base64,{_base64(data)}"


def _base64(data: bytes) -> str:
    return base64.b64encode(data).decode("ascii")
