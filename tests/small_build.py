"""A small simulated drive with images, built and written: two rooms, some seconds."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path

from recon.config import Config
from recon.pipeline import Build, build
from recon.results import save_result
from recon.sequence.folder import read_sequence
from recon.simulate import simulate_file

PLAN = {
    "name": "<two> & rooms",
    "rooms": [
        {"name": "hall", "polygon": [[0, 0], [5, 0], [5, 4], [0, 4]]},
        {"name": "side", "polygon": [[5.2, 0], [9, 0], [9, 4], [5.2, 4]]},
    ],
    "openings": [{"type": "passage", "room": 0, "wall": 1, "offset": 1.5, "width": 1.0}],
    "path": [[1, 2], [7, 2], [7.5, 3]],
    "camera": {"image_width": 160, "image_height": 120, "fx": 110, "fy": 110, "cx": 79.5, "cy": 59.5, "rate": 2.0},
    "write_extrinsics": True,
}


@dataclass(frozen=True)
class Small:
    """A build, its sequence, and its result folder, whose report links to model.usd beside it."""

    build: Build
    sequence: Path
    folder: Path


def build_small(place: Path) -> Small:
    """Simulated, built and saved below `place`."""
    (place / "plan.json").write_text(json.dumps(PLAN), encoding="utf-8")
    simulate_file(place / "plan.json", place / "seq", 0)
    built = build(read_sequence(place / "seq"), Config(workers=1))
    built = replace(built, warnings=("wheels <slip>; give odometry.txt",))
    save_result(built, place / "model.recon", (place / "out" / "the model.usd", place / "model.recon" / "plan.dxf"))
    return Small(built, place / "seq", place / "model.recon")
