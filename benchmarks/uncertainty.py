"""How honest sigmas are, as a markdown table: `python benchmarks/uncertainty.py [SEQ ...] --buildings 20`.

Simulated buildings of 1 to 6 rooms, every second with walls at any angle, clutter, range noise of 1 cm; scans alone.
Sequences with a true layout come first. Every row: how many were compared, and how many percent lie within one and two
sigma of the truth. Walls of source "inferred" are left out. Walls of one building share the error of its first pose,
which fixes the map, so that their offsets do not count as so many samples; dimensions and angles to each other do.
"""

from __future__ import annotations

import argparse
import dataclasses
from pathlib import Path

import numpy as np

from recon.config import Config
from recon.evaluate.sigmas import Calibration, SigmaScores, sigma_scores
from recon.layout_file import read_layout
from recon.model import Layout
from recon.pipeline import build
from recon.sequence.folder import read_sequence
from recon.sequence.sequence import Sequence
from recon.simulate import random_plan, run_simulation

PARTS = ("offset", "angle", "dimension")
FIRST_SEED = 500
LARGEST = 6
"""rooms"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("sequences", nargs="*", type=Path)
    parser.add_argument("--buildings", type=int, default=20)
    parser.add_argument("--first", type=int, default=FIRST_SEED, help="seed of the first building")
    arguments = parser.parse_args()
    print("| building | offsets of walls | their angles | distances between facing walls | median error, mm |")
    print("| --- | --- | --- | --- | --- |")
    for folder in arguments.sequences:
        truth = read_layout(folder / "groundtruth" / "layout.json")
        sequence = dataclasses.replace(read_sequence(folder), images=None, camera=None)
        print(row(folder.name, scores(sequence, truth)), flush=True)
    found = []
    for seed in range(arguments.first, arguments.first + arguments.buildings):
        rooms, angles = 1 + seed % 100 % LARGEST, "any" if seed % 2 else "manhattan"
        plan = random_plan(seed, rooms, angles)  # type: ignore[arg-type]
        plan = dataclasses.replace(plan, lidar=dataclasses.replace(plan.lidar, sigma=0.01))
        simulation = run_simulation(plan, seed)
        found.append(scores(Sequence(plan.name, simulation.scans), simulation.layout))
        print(row(f"{seed}: {rooms} rooms, {angles}", found[-1]), flush=True)
    if found:
        print(row("**all**", SigmaScores(*(Calibration.joined(getattr(f, part) for f in found) for part in PARTS))))


def scores(sequence: Sequence, truth: Layout) -> SigmaScores:
    """Build from the scans alone and compare."""
    return sigma_scores(build(sequence, Config()).model.layout, truth)


def row(name: str, found: SigmaScores) -> str:
    """One line of the table."""
    parts = [getattr(found, part) for part in PARTS]
    shares = [
        f"{len(p.ratios)}: {p.within(1) * 100:.0f} / {p.within(2) * 100:.0f}" if len(p.ratios) else "-" for p in parts
    ]
    errors = [f"{np.median(np.abs(p.errors)) * 1000:.2f}" if len(p.errors) else "-" for p in (parts[0], parts[2])]
    return f"| {name} | {' | '.join(shares)} | {' / '.join(errors)} |"


if __name__ == "__main__":
    main()
