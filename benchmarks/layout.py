"""Layouts of random simulated buildings as a markdown table: `python benchmarks/layout.py --buildings 20`.

1 to 12 rooms, every second building with bends and walls at any angle, clutter, range noise of 1 cm; scans alone, no
odometry. With `--images` the drives have a camera as well, which takes minutes a building.
"""

from __future__ import annotations

import argparse
import dataclasses
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import shapely

from recon.config import Config
from recon.evaluate.layout import LayoutScores, layout_scores
from recon.evaluate.score import total
from recon.evaluate.sigmas import Calibration
from recon.evaluate.walls import WallScores, wall_scores
from recon.model import Layout
from recon.pipeline import build
from recon.sequence.folder import read_sequence
from recon.sequence.sequence import Sequence
from recon.simulate import random_plan, run_simulation, simulate
from recon.simulate.plan import Plan

FIRST_SEED = 2000
COLUMNS = (
    "building",
    "rooms F1",
    "corners F1 at 0.1 m / 0.2 m / 10 px",
    "angles F1, 10 px",
    "IoU, median room",
    "area error, median room",
    "doors / passages / windows F1",
    "walls F1 at 5 cm",
    "offsets within 1 / 2 sigma",
    "distances within 1 / 2 sigma",
    "CPU, s",
)


@dataclass(frozen=True)
class Result:
    """One building: its scores and CPU seconds; sound: every room a simple polygon, none over another."""

    layout: LayoutScores
    walls: WallScores
    sound: bool
    seconds: float


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--buildings", type=int, default=20)
    parser.add_argument("--first", type=int, default=FIRST_SEED, help="seed of the first building")
    parser.add_argument("--images", action="store_true")
    arguments = parser.parse_args()
    print(f"| {' | '.join(COLUMNS)} |\n|{' --- |' * len(COLUMNS)}")
    results = []
    for k in range(arguments.buildings):
        seed, rooms, angles = arguments.first + k, 1 + k % 12, "any" if (k + k // 12) % 2 else "manhattan"
        plan = random_plan(seed, rooms, angles)  # type: ignore[arg-type]
        plan = dataclasses.replace(plan, lidar=dataclasses.replace(plan.lidar, sigma=0.01))
        results.append(with_images(plan, seed) if arguments.images else from_scans(plan, seed))
        print(f"| {seed}: {rooms} rooms, {angles} | {' | '.join(cells(results[-1]))} |", flush=True)
    print(f"| **all** | {' | '.join(summary(results))} |")
    print(f"\n{sum(r.sound for r in results)} of {len(results)} without crossing or overlapping rooms")


def from_scans(plan: Plan, seed: int) -> Result:
    """Build from the scans alone."""
    simulation = run_simulation(plan, seed)
    return score(Sequence(plan.name, simulation.scans), simulation.layout)


def with_images(plan: Plan, seed: int) -> Result:
    """Build from scans and images, which are drawn first."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "drive"
        simulate(plan, folder, seed)
        sequence = dataclasses.replace(read_sequence(folder), odometry=None)
        return score(sequence, run_simulation(plan, seed).layout)


def score(sequence: Sequence, truth: Layout) -> Result:
    """Build and compare."""
    start = time.process_time()
    layout = build(sequence, Config()).model.layout
    seconds = time.process_time() - start
    scores = layout_scores(layout, truth)
    assert scores is not None, "every simulated building has rooms"
    return Result(scores, wall_scores(layout.walls, truth.walls), is_sound(layout), seconds)


def is_sound(layout: Layout) -> bool:
    """Whether every room is a simple polygon and no two overlap."""
    polygons = [shapely.Polygon(room.polygon) for room in layout.rooms]
    if not all(p.is_valid and p.exterior.is_ccw for p in polygons):
        return False
    return all(a.intersection(b).area < 1e-6 for i, a in enumerate(polygons) for b in polygons[:i])


def cells(r: Result) -> list[str]:
    """One building, in the order of the head."""
    rooms, openings = r.layout.rooms, r.layout.openings
    return [
        f"{rooms.rooms.f1:.3f}",
        " / ".join(f"{c.corners.f1:.3f}" for c in rooms.corners),
        f"{rooms.corners[-1].angles.f1:.3f}",
        f"{rooms.iou:.3f}",
        f"{rooms.area_error:.2%}",
        " / ".join(f"{s.f1:.2f}" if s.found or s.true else "-" for s in openings.by_type.values()),
        f"{r.walls.f1[1]:.3f}",
        shares(r.layout.sigmas.offset),
        shares(r.layout.sigmas.dimension),
        f"{r.seconds:.1f}",
    ]


def summary(results: list[Result]) -> list[str]:
    """All buildings: scores of the counts added up, medians of medians, sigmas of all walls."""
    rooms = [r.layout.rooms for r in results]
    by_threshold = list(zip(*(room.corners for room in rooms), strict=True))
    types = [list(r.layout.openings.by_type.values()) for r in results]
    return [
        f"{total([room.rooms for room in rooms]).f1:.3f}",
        " / ".join(f"{total([c.corners for c in scores]).f1:.3f}" for scores in by_threshold),
        f"{total([c.angles for c in by_threshold[-1]]).f1:.3f}",
        f"{np.nanmedian([room.iou for room in rooms]):.3f}",
        f"{np.nanmedian([room.area_error for room in rooms]):.2%}",
        " / ".join(f"{total(list(scores)).f1:.2f}" for scores in zip(*types, strict=True)),
        f"{np.mean([r.walls.f1[1] for r in results]):.3f}",
        shares(*(r.layout.sigmas.offset for r in results)),
        shares(*(r.layout.sigmas.dimension for r in results)),
        f"{sum(r.seconds for r in results):.1f}",
    ]


def shares(*parts: Calibration) -> str:
    """Share of the errors of all parts within one and within two sigmas."""
    both = Calibration.joined(parts)
    return f"{both.within(1):.0%} / {both.within(2):.0%}" if len(both.ratios) else "-"


if __name__ == "__main__":
    main()
