"""What the report says first: numbers, warnings, and what was assumed."""

from __future__ import annotations

import posixpath
from html import escape
from urllib.parse import quote

import numpy as np

from recon.model import Layout
from recon.report.html import listing, section
from recon.results.record import Record

FILES = ("layout.json", "trajectory.txt", "textures", "metrics.json", "config.toml")
"""Of the result folder, worth a link."""


def facts(record: Record) -> str:
    """The largest numbers."""
    layout, calibration = record.model.layout, record.calibration
    measured = [w.sigma_offset for w in layout.walls if w.source != "inferred"]
    found = [
        (f"{sum(w.length for w in layout.walls):.1f} m", f"of wall in {len(layout.walls)} walls"),
        (f"{len(layout.rooms)}", "room" if len(layout.rooms) == 1 else "rooms"),
        (f"{sum(room.area for room in layout.rooms):.1f} m\u00b2", "of floor"),
        (f"{len(layout.openings)}", "door or opening" if len(layout.openings) == 1 else "doors and openings"),
        (f"{layout.extrusion_height:.2f} m", "high" if layout.ceiling_height is not None else "high (assumed)"),
    ]
    if measured:
        found.append((f"{np.median(measured) * 1000:.1f} mm", "standard deviation of a wall, median"))
    if calibration is not None and record.camera_height is not None:
        found.append((f"{record.camera_height:.3f} m", f"camera height ({calibration['source']})"))
        if offset := calibration.get("time_offset"):
            found.append((f"{1000 * offset:+.0f} ms", "added to image stamps: the camera's clock"))
    return '<ul class="facts">' + "".join(f"<li><b>{v}</b><span>{n}</span></li>" for v, n in found) + "</ul>"


def links(record: Record, home: str) -> str:
    """The exported files, and those of the result folder; home: the way to that folder from the report's place."""
    own = [name for name in FILES if (record.folder / name).exists()]
    items = []
    for name in (*record.outputs, *own):
        target = posixpath.normpath(posixpath.join(home, name))
        items.append(f'<a href="{quote(target)}">{escape(posixpath.basename(name))}</a>')
    return "<p>Files: " + ", ".join(items) + "</p>" if items else ""


def messages(record: Record) -> str:
    """Warnings, with what mends them, and what was assumed where nothing was seen."""
    assumed = [*record.model.notes, *record.model.picture_notes, *_assumed(record.model.layout)]
    return section("Warnings", listing(record.warnings)) + section("What was assumed", listing(assumed))


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
