"""Jambs of openings in random simulated buildings: `python benchmarks/jambs.py --first 2000 --buildings 20`.

The buildings of `benchmarks/layout.py`, those of more than nine rooms with four: scans alone, range noise of 1 cm. An
error is the distance along the wall between a jamb and the true one, positive where the opening is too narrow.
"""

from __future__ import annotations

import argparse
import dataclasses

import numpy as np

from recon.config import Config
from recon.evaluate.openings import matched_openings
from recon.geometry import Array
from recon.model import Layout, Opening
from recon.pipeline import build
from recon.sequence.sequence import Sequence
from recon.simulate import random_plan, run_simulation

KINDS = ("closed door", "open door", "passage", "window")
COLUMNS = ("jambs of", "openings", "too narrow, median, mm", "off, median, mm", "95 %, mm", "largest, mm")
SIGMAS = ("with a sigma", "within 1 / 2 sigma", "median sigma, mm")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--buildings", type=int, default=20)
    parser.add_argument("--first", type=int, default=2000, help="seed of the first building")
    arguments = parser.parse_args()
    found: list[tuple[str, Array, float]] = []
    for k in range(arguments.buildings):
        found += errors(arguments.first + k, 1 + k % 12, "any" if (k + k // 12) % 2 else "manhattan")
    columns = COLUMNS + SIGMAS
    print(f"| {' | '.join(columns)} |\n|{' --- |' * len(columns)}")
    for kind in (*KINDS, "all"):
        rows = [row for row in found if kind in (row[0], "all")]
        if rows:
            print(f"| {kind} | {' | '.join(cells(rows))} |")


def errors(seed: int, rooms: int, angles: str) -> list[tuple[str, Array, float]]:
    """Kind, errors (2,) m and sigma (nan for None) of the openings of one building that are found."""
    plan = random_plan(seed, rooms if rooms <= 9 else 4, angles)  # type: ignore[arg-type]
    plan = dataclasses.replace(plan, lidar=dataclasses.replace(plan.lidar, sigma=0.01))
    simulation = run_simulation(plan, seed)
    layout = build(Sequence(plan.name, simulation.scans), Config(), plan_only=True).model.layout
    truth = simulation.layout
    pairs = matched_openings(layout, list(layout.openings), truth, list(truth.openings))
    return [(kind(a, b), narrow(layout, a, b), np.nan if a.sigma_jambs is None else a.sigma_jambs) for a, b in pairs]


def kind(found: Opening, true: Opening) -> str:
    return true.type if true.type != "door" else "open door" if found.is_hole else "closed door"


def narrow(layout: Layout, found: Opening, true: Opening) -> Array:
    """(2,) m: how far inside the true opening both ends are."""
    wall = layout.wall(found.wall)
    ends, true_ends = (np.sort((np.stack([o.start, o.end]) - wall.start) @ wall.direction) for o in (found, true))
    return np.array([ends[0] - true_ends[0], true_ends[1] - ends[1]])


def cells(rows: list[tuple[str, Array, float]]) -> list[str]:
    """One kind, in the order of the head."""
    error = np.array([row[1] for row in rows])
    sigma = np.array([row[2] for row in rows])
    known = np.isfinite(sigma)
    ratios = np.abs(error[known]) / sigma[known, None]
    off = 1000 * np.abs(error)
    shares = " / ".join(f"{np.mean(ratios < k):.0%}" for k in (1, 2)) if known.any() else "-"
    return [
        f"{len(rows)}",
        f"{1000 * np.median(error):+.1f}",
        f"{np.median(off):.1f}",
        f"{np.quantile(off, 0.95):.1f}",
        f"{off.max():.0f}",
        f"{known.sum()}",
        shares,
        f"{1000 * np.median(sigma[known]):.1f}" if known.any() else "-",
    ]


if __name__ == "__main__":
    main()
