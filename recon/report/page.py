"""The report, top to bottom."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

from recon.errors import OutputError
from recon.exporters.svg import write_svg
from recon.files import atomic_path
from recon.model import Model
from recon.report.drive import drive
from recon.report.facts import facts, links, messages
from recon.report.frames import frames
from recon.report.house import house
from recon.report.html import page, section
from recon.report.sketch import sketch
from recon.report.tables import control, rooms, tape, time, walls
from recon.results.record import Record, load_record


def write_report(folder: Path, path: Path | None = None) -> None:
    """Write the report of a result folder anew: to `path`, else to report.html in it. Links lead to what is there.

    Raises InputError for a damaged result, OutputError where the report cannot be written.
    """
    place = folder / "report.html" if path is None else path
    record = load_record(folder)
    there = tuple(name for name in record.outputs if (folder / name).exists())
    home = Path(os.path.relpath(folder.absolute(), place.absolute().parent)).as_posix()
    text = report(replace(record, outputs=there), home)
    try:
        with atomic_path(place) as temporary:
            temporary.write_text(text, encoding="utf-8")
    except OSError as error:
        raise OutputError(f"{place}: cannot be written: {error.strerror or error}") from error


def report(record: Record, home: str = ".") -> str:
    """The page; home: the way from where it will lie to the result folder. InputError where pictures are damaged."""
    model = record.model
    parts = [
        facts(record),
        links(record, home),
        section("The model", house(model)),
        section("The plan", _plan(model)),
        messages(record),
        section("Trajectory and accuracy", drive(record)),
        frames(record),
        tape(record),
        control(record),
        rooms(model.layout),
        walls(model.layout),
        time(record),
    ]
    return page(model.name, parts)


def _plan(model: Model) -> str:
    """The sheet to scale, which a narrow screen shows in part, and for it a sketch of the whole."""
    text = write_svg(model, "plan").content.decode("utf-8")
    sheet = text[text.index("<svg") :]
    full = '<label class="full"><input type="checkbox"> as large as on paper</label>'
    part = '<p class="part">The sheet to scale, a part of it: slide it to see the rest.</p>'
    return f'{sketch(model.layout)}<div class="sheet">{full}{part}<div class="scroll" tabindex="0">{sheet}</div></div>'
