"""Filter against graph: error, consistency and time, as a table (markdown) for docs/benchmarks.md.

    python benchmarks/filter_vs_graph.py ../shared/data/corridor ../shared/data/intel --simulated 3

Folders need groundtruth/trajectory.txt or relations.txt; images are left out, so that scans alone are compared. NEES is
the squared error of a pose over its variance, the mean of x, y and heading over all poses: 1 is honest, more says that
the sigmas are too small.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np

from recon.config import Config, GraphConfig
from recon.evaluate.relations import relation_errors
from recon.evaluate.trajectory import trajectory_errors
from recon.evaluate.walls import wall_scores
from recon.geometry import between2, wrap_angle
from recon.graph.estimate import MapEstimate
from recon.lidar.clock import odometry_clock
from recon.pipeline import Build, build
from recon.progress import Stage
from recon.sequence.folder import read_sequence
from recon.sequence.groundtruth import GroundTruth, read_groundtruth
from recon.sequence.sequence import Sequence
from recon.sequence.trajectory import Trajectory
from recon.simulate import random_plan, run_simulation

ESTIMATE = ("image motion", "loop closure", "factor graph", "filter")
"""Stages whose time is the estimate's; the others both have."""
HEAD = ("drive", "scans", "", "position", "heading, deg", "NEES", "walls within 5 cm, F1", "CPU, s")


class _Clock:
    """CPU seconds of the stages that make the estimate."""

    def __init__(self) -> None:
        self.seconds = 0.0

    @contextmanager
    def stage(self, name: str, total: int | None = None, unit: str = "") -> Iterator[Stage]:
        start = time.process_time()
        yield _Silent()
        if name in ESTIMATE:
            self.seconds += time.process_time() - start


class _Silent:
    def advance(self, count: int = 1) -> None: ...


def rows(name: str, sequence: Sequence, truth: GroundTruth) -> Iterator[tuple[str, ...]]:
    """One row for the filter, one for the graph."""
    scans = replace(sequence, images=None, camera=None, platform_from_camera=None)
    for backend in ("ekf", "graph"):
        clock = _Clock()
        built = build(scans, replace(Config(), graph=GraphConfig(backend=backend)), clock)
        first = backend == "ekf"
        cells = _scores(built, truth)
        yield (name if first else "", f"{len(scans.scans)}" if first else "", "filter" if first else "graph", *cells,
               f"{clock.seconds:.1f}")  # fmt: skip


def _scores(built: Build, truth: GroundTruth) -> tuple[str, str, str, str]:
    walls = "-"
    if truth.layout is not None:
        walls = f"{wall_scores(built.model.layout.walls, truth.layout.walls).f1[1]:.3f}"
    if truth.trajectory is not None:
        e = trajectory_errors(built.estimate.trajectory, truth.trajectory)
        return f"{e.ate * 100:.2f} cm", f"{e.heading:.3f}", f"{nees(built.estimate, truth.trajectory):.2f}", walls
    assert truth.relations is not None
    odometry = built.sequence.odometry
    if odometry is not None:
        odometry = odometry_clock(built.estimate.trajectory, odometry).on_scan_clock(odometry)
    r = relation_errors(built.estimate.trajectory, truth.relations, odometry)
    position, heading = r.translation, r.rotation
    return (f"{position.mean:.4f} +- {position.deviation:.4f} m", f"{heading.mean:.3f} +- {heading.deviation:.3f}", "-",
            walls)  # fmt: skip


def nees(estimate: MapEstimate, truth: Trajectory) -> float:
    """Squared errors over variances, the mean of x, y and heading over all poses but the first."""
    true = truth.at(estimate.trajectory.timestamps)
    error = estimate.trajectory.poses - between2(true[0], true)
    error[:, 2] = wrap_angle(error[:, 2])
    return float(np.mean((error[1:] / estimate.pose_sigmas[1:]) ** 2))


def _simulated(seed: int, rooms: int) -> tuple[str, Sequence, GroundTruth]:
    plan = random_plan(seed, rooms)
    drive = run_simulation(plan, seed)
    sequence = Sequence("simulated", drive.scans, odometry=drive.odometry)
    return f"simulated, {rooms} rooms, seed {seed}", sequence, GroundTruth(drive.truth, layout=drive.layout)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="*", type=Path)
    parser.add_argument("--simulated", type=int, default=0, help="random buildings")
    arguments = parser.parse_args()
    print("| " + " | ".join(HEAD) + " |", "|" + " --- |" * len(HEAD), sep="\n")
    drives = [(f.name, read_sequence(f), read_groundtruth(f)) for f in arguments.folders]
    drives += [_simulated(seed, (4, 8, 12)[seed % 3]) for seed in range(arguments.simulated)]
    for drive in drives:
        for row in rows(*drive):
            print("| " + " | ".join(row) + " |", flush=True)


if __name__ == "__main__":
    main()
