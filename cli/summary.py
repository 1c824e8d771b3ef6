"""Five lines that say what a build found."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from recon.model import Layout, Model
    from recon.pipeline import Build


def by_hand(build: Build) -> list[str]:
    """Distances and points that people measured beside those of the model, one line each; none without any."""
    lines = []
    if (tape := build.measured.tape) is not None:
        measures = zip(tape.first, tape.second, tape.distance, tape.sigma, build.estimate.tape, strict=True)
        for a, b, said, sigma, solved in measures:
            off = f"{(solved - said) * 1000:+.1f} mm, {(solved - said) / sigma:+.1f} sigmas"
            lines.append(f"Tape:      walls {a} and {b}: {said:.3f} m, {off}")
    if (control := build.measured.control) is not None and (survey := build.estimate.survey) is not None:
        rows = zip(control.names, survey.solved - control.position, control.sigma, survey.kept, strict=True)
        for name, (x, y), sigma, kept in rows:
            off = f"x {x * 1000:+.1f} mm, y {y * 1000:+.1f} mm, {np.hypot(x, y) / sigma:.1f} sigmas"
            lines.append(f"Control:   {name}: {off}{'' if kept else ', left out'}")
        x, y, yaw = survey.survey_from_map
        place = f"the map's origin is at x {x:.3f} m, y {y:.3f} m, its x axis at {np.degrees(yaw):.3f} deg"
        sigma_x, sigma_y, sigma_yaw = survey.sigma * [1000, 1000, np.degrees(1)]
        lines.append(f"Survey:    {place} (sigmas {sigma_x:.1f} mm, {sigma_y:.1f} mm, {sigma_yaw:.3f} deg)")
    return lines


def summary(model: Model, folder: Path, outputs: tuple[Path, ...]) -> list[str]:
    """Walls, rooms, height, accuracy and what to open first, one line each."""
    return [
        _walls(model),
        _rooms(model.layout),
        _height(model.layout),
        _accuracy(model.layout),
        _open_first(folder, outputs),
    ]


def _walls(model: Model) -> str:
    walls = model.layout.walls
    inferred = sum(wall.source == "inferred" for wall in walls)
    textured = sum(face.texture is not None for face in model.faces if face.kind == "wall")
    parts = [f"{textured} textured" if textured else "no texture", f"{inferred} inferred"]
    return f"Walls:     {sum(wall.length for wall in walls):.1f} m in {len(walls)} walls ({', '.join(parts)})"


def _rooms(layout: Layout) -> str:
    if not layout.rooms:
        return "Rooms:     none closed"
    area = sum(abs(room.area) for room in layout.rooms)
    plural = "s" if len(layout.rooms) > 1 else ""
    doors = len(layout.openings)
    openings = f", {doors} door{'s' if doors > 1 else ''} and openings" if doors else ""
    return f"Rooms:     {len(layout.rooms)} room{plural}, {area:.1f} m2 of floor{openings}"


def _height(layout: Layout) -> str:
    if layout.ceiling_height is None:
        return f"Height:    ceiling not seen, {layout.extrusion_height:.2f} m assumed"
    sigma = "" if layout.sigma_ceiling is None else f" +- {layout.sigma_ceiling * 100:.1f} cm"
    return f"Height:    ceiling at {layout.ceiling_height:.2f} m{sigma}"


def _accuracy(layout: Layout) -> str:
    measured = [wall for wall in layout.walls if wall.source != "inferred"]
    if not measured:
        return "Accuracy:  no wall was measured"
    offset = float(np.median([wall.sigma_offset for wall in measured])) * 1000
    angle = float(np.degrees(np.median([wall.sigma_angle for wall in measured])))
    return f"Accuracy:  a wall's place is known to {offset:.1f} mm, its direction to {angle:.2f} deg (median sigma)"


def _open_first(folder: Path, outputs: tuple[Path, ...]) -> str:
    report = folder / "report.html"
    first = report if report.exists() else (outputs[0] if outputs else folder)
    rest = [str(path) for path in outputs if path != first]
    return f"Open:      {first}" + (f", then {', '.join(rest)}" if rest else "")
