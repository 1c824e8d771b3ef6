"""Five lines that say what a build found."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from recon.geometry import Array

if TYPE_CHECKING:
    from recon.model import Layout, Model


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
    area = sum(abs(_area(room.polygon)) for room in layout.rooms)
    plural = "s" if len(layout.rooms) > 1 else ""
    doors = len(layout.openings)
    openings = f", {doors} door{'s' if doors > 1 else ''} and openings" if doors else ""
    return f"Rooms:     {len(layout.rooms)} room{plural}, {area:.1f} m2 of floor{openings}"


def _area(polygon: Array) -> float:
    x, y = polygon[:, 0], polygon[:, 1]
    return float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)) / 2


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
