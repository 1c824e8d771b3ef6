"""The report, top to bottom."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from recon.drawing import Drawing, render_drawing
from recon.exporters.svg import write_svg
from recon.model import Model
from recon.report.facts import facts, links, messages
from recon.report.frames import frames
from recon.report.house import house
from recon.report.html import data_address, page, section
from recon.report.tables import control, rooms, tape, time, walls

if TYPE_CHECKING:
    from recon.pipeline import Build


def write_report(build: Build, folder: Path, target: Path | None = None, outputs: Sequence[Path] = ()) -> None:
    """Write folder/report.html from a build and the overlays that lie in the folder.

    target: the name that the folder will have when all is written; outputs: files exported beside it.
    """
    model = build.model
    parts = [
        facts(build),
        links(folder, folder if target is None else target, outputs),
        section("The model", house(model)),
        section("The plan", f'<div class="plan">{_plan(model)}</div>'),
        messages(build),
        section("Trajectory and accuracy", _drawing(build)),
        frames(build, folder),
        tape(build),
        control(build),
        rooms(model.layout),
        walls(model.layout),
        time(build),
    ]
    (folder / "report.html").write_text(page(model.name, parts), encoding="utf-8")


def _plan(model: Model) -> str:
    """The floorplan's SVG element, without its XML declaration."""
    text = write_svg(model, "plan").content.decode("utf-8")
    return text[text.index("<svg") :]


def _drawing(build: Build) -> str:
    """Trajectory, walls by their uncertainty, loop closures and residuals over the map of the scans."""
    estimate = build.estimate
    drawing = Drawing(
        estimate.trajectory,
        estimate.pose_sigmas,
        build.model.layout.walls,
        estimate.trajectory.poses[estimate.closures, :2],
        dict(estimate.residuals),
        scan_residuals=estimate.scan_residuals,
        occupancy=build.model.occupancy,
    )
    data = data_address(render_drawing(drawing, "png"), "image/png")
    return f'<img class="plan" alt="Trajectory and accuracy" src="{data}">'
