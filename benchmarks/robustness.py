"""Public logs made worse: error over the reference relations, as a table (markdown) for docs/benchmarks.md.

    python benchmarks/robustness.py ../shared/data/intel ../shared/data/killian --variants "range 8 m" "field 120 deg"

Each variant takes something from the scans or spoils the odometry; relations are read along the odometry as it was, as
`recon eval` does.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from recon.config import Config
from recon.evaluate.relations import given_odometry, relation_errors
from recon.geometry import Array, between2, compose2
from recon.pipeline import build
from recon.sequence.folder import read_sequence
from recon.sequence.groundtruth import read_groundtruth
from recon.sequence.sequence import Scans, Sequence
from recon.sequence.trajectory import Trajectory

SEED = 0


def every(step: int) -> Callable[[Sequence], Sequence]:
    def left(sequence: Sequence) -> Sequence:
        scans = sequence.scans
        return replace(
            sequence, scans=replace(scans, timestamps=scans.timestamps[::step], ranges=scans.ranges[::step].copy())
        )

    return left


def with_ranges(change: Callable[[Scans], Array]) -> Callable[[Sequence], Sequence]:
    def changed(sequence: Sequence) -> Sequence:
        ranges = change(sequence.scans).astype(np.float32)
        return replace(sequence, scans=replace(sequence.scans, ranges=ranges))

    return changed


def dropped(share: float) -> Callable[[Scans], Array]:
    return lambda scans: np.where(np.random.default_rng(SEED).random(scans.ranges.shape) < share, np.nan, scans.ranges)


def noisy(sigma: float) -> Callable[[Scans], Array]:
    return lambda scans: scans.ranges + np.random.default_rng(SEED).normal(0, sigma, scans.ranges.shape)


def near(reach: float) -> Callable[[Scans], Array]:
    return lambda scans: np.where(scans.ranges > reach, np.inf, scans.ranges)


def narrow(degrees: float) -> Callable[[Sequence], Sequence]:
    def cut(sequence: Sequence) -> Sequence:
        scans = sequence.scans
        bearings = scans.angle_min + scans.angle_increment * np.arange(scans.ranges.shape[1])
        kept = np.flatnonzero(np.abs(bearings) <= np.radians(degrees) / 2)
        return replace(
            sequence, scans=replace(scans, ranges=scans.ranges[:, kept].copy(), angle_min=float(bearings[kept[0]]))
        )

    return cut


def with_odometry(change: Callable[[Array], Array], late: float = 0.0) -> Callable[[Sequence], Sequence]:
    def changed(sequence: Sequence) -> Sequence:
        odometry = sequence.odometry
        if odometry is None:
            return sequence
        poses = [odometry.poses[0]]
        for step in change(between2(odometry.poses[:-1], odometry.poses[1:])):
            poses.append(compose2(poses[-1], step))
        return replace(sequence, odometry=Trajectory(odometry.timestamps + late, np.array(poses)))

    return changed


def drifting(rate: float) -> Callable[[Array], Array]:
    """Heading lost with the way driven, rad a metre."""
    return lambda steps: steps + np.hypot(steps[:, 0], steps[:, 1])[:, None] * np.array([0.0, 0.0, rate])


VARIANTS: dict[str, Callable[[Sequence], Sequence]] = {
    "as it is": lambda sequence: sequence,
    "every 2nd scan": every(2),
    "every 3rd scan": every(3),
    "5 % of the beams dropped": with_ranges(dropped(0.05)),
    "20 % of the beams dropped": with_ranges(dropped(0.2)),
    "range 8 m": with_ranges(near(8.0)),
    "field 120 deg": narrow(120.0),
    "noise 3 cm": with_ranges(noisy(0.03)),
    "odometry 5 % long": with_odometry(lambda steps: steps * np.array([1.05, 1.05, 1.0])),
    "odometry turning 2 deg a metre": with_odometry(drifting(np.radians(2.0))),
    "odometry 0.3 s late": with_odometry(lambda steps: steps, 0.3),
    "no odometry": lambda sequence: replace(sequence, odometry=None),
}


def row(folder: Path, name: str) -> str:
    sequence, relations = read_sequence(folder), read_groundtruth(folder).relations
    if relations is None:
        raise SystemExit(f"{folder} has no relations.txt")
    start = time.process_time()
    built = build(VARIANTS[name](sequence), Config())
    seconds = time.process_time() - start
    trajectory = built.estimate.trajectory
    found = relation_errors(trajectory, relations, given_odometry(folder, trajectory)[0])
    position, heading = found.translation, found.rotation
    cells = (folder.name, name, f"{position.mean:.4f} +- {position.deviation:.4f}", f"{heading.mean:.3f}",
             str(built.counts.get("loop closures", 0)), f"{seconds:.0f}")  # fmt: skip
    return "| " + " | ".join(cells) + " |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("--variants", nargs="+", choices=list(VARIANTS), default=list(VARIANTS))
    arguments = parser.parse_args()
    print("| log | variant | m | deg | closures | CPU, s |", "|" + " --- |" * 6, sep="\n")
    for folder in arguments.folders:
        for name in arguments.variants:
            print(row(folder, name), flush=True)


if __name__ == "__main__":
    main()
