"""What the report says first: numbers, warnings, and what was assumed."""

from __future__ import annotations

import os
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import quote

import numpy as np

from recon.model import Layout
from recon.report.html import listing, section

if TYPE_CHECKING:
    from recon.pipeline import Build

FILES = ("layout.json", "trajectory.txt", "textures", "metrics.json")
"""Of the result folder, worth a link."""


def facts(build: Build) -> str:
    """The largest numbers."""
    layout, calibration = build.model.layout, build.calibration
    measured = [w.sigma_offset for w in layout.walls if w.source != "inferred"]
    found = [
        (f"{sum(w.length for w in layout.walls):.1f} m", f"of wall in {len(layout.walls)} walls"),
        (f"{len(layout.rooms)}", "room" if len(layout.rooms) == 1 else "rooms"),
        (f"{sum(room.area for room in layout.rooms):.1f} m\u00b2", "of floor"),
        (f"{len(layout.openings)}", "doors and openings"),
        (f"{layout.extrusion_height:.2f} m", "high" if layout.ceiling_height is not None else "high (assumed)"),
    ]
    if measured:
        found.append((f"{np.median(measured) * 1000:.1f} mm", "standard deviation of a wall, median"))
    if calibration is not None:
        height = calibration.platform_from_camera.translation[2]
        found.append((f"{height:.3f} m", f"camera height ({calibration.source})"))
        if calibration.time_offset:
            found.append((f"{1000 * calibration.time_offset:+.0f} ms", "added to image stamps: the camera's clock"))
    return '<ul class="facts">' + "".join(f"<li><b>{v}</b><span>{n}</span></li>" for v, n in found) + "</ul>"


def links(folder: Path, target: Path, outputs: Sequence[Path]) -> str:
    """The exported files, and those of the result folder, as links relative to where the report will lie.

    folder: where the result is written now; target: the name that it will have."""
    there = [Path(os.path.relpath(path.absolute(), target.absolute())) for path in outputs]
    own = [Path(name) for name in FILES if (folder / name).exists()]
    items = [f'<a href="{quote(path.as_posix())}">{escape(path.name)}</a>' for path in (*there, *own)]
    return "<p>Files: " + ", ".join(items) + "</p>" if items else ""


def messages(build: Build) -> str:
    """Warnings, with what mends them, and what was assumed where nothing was seen."""
    assumed = [*build.model.notes, *_assumed(build.model.layout)]
    return section("Warnings", listing(build.warnings)) + section("What was assumed", listing(assumed))


def _assumed(layout: Layout) -> list[str]:
    """What of the layout no sensor saw."""
    out = []
    inferred = [wall for wall in layout.walls if wall.source == "inferred"]
    if inferred:
        names = ", ".join(str(wall.id) for wall in inferred[:20]) + (", ..." if len(inferred) > 20 else "")
        length = sum(wall.length for wall in inferred)
        out.append(f"{length:.1f} m of wall in {len(inferred)} walls were seen by no sensor (walls {names}).")
    hidden = sum(b - a for wall in layout.walls if wall.source != "inferred" for a, b in wall.unseen)
    if hidden > 0:
        out.append(f"{hidden:.1f} m of walls that were seen elsewhere are hidden behind something.")
    heads = sum(opening.sigma_top is None for opening in layout.openings)
    if heads:
        out.append(f"The head of {heads} of {len(layout.openings)} openings was in no image; its height is assumed.")
    heights = [room for room in layout.rooms if room.ceiling_height is None]
    if heights and layout.ceiling_height is not None and len(heights) < len(layout.rooms):
        out.append(f"The ceiling of {len(heights)} rooms was in no image; the building's is assumed.")
    return out
