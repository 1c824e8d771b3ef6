"""Time and memory of a scan as drives grow: `python benchmarks/scale.py --most 100000 --picture docs/images/scale.png`.

One patrol through a simulated office of 200 rooms, a scan every 10 cm (100,000 scans are 10 km), no images; its first
1,000, 3,000, 10,000 ... scans are built one after the other, each in a process of its own.
"""

from __future__ import annotations

import argparse
import dataclasses
import multiprocessing
import pickle
import re
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from recon.config import Config
from recon.evaluate.trajectory import trajectory_errors
from recon.geometry import between2
from recon.pipeline import Build, build
from recon.progress import Stage
from recon.sequence.sequence import Scans, Sequence
from recon.sequence.trajectory import Trajectory
from recon.simulate import office_plan, run_simulation
from recon.simulate.drive import drive_path

SIZES = (1_000, 3_000, 10_000, 30_000, 100_000)
SPACING = 0.1
"""m between scans."""
ROUNDED = 1.045
"""Length of the way points' polygon over that of the drive, whose corners are rounded."""
WRONG = 0.5
"""m between the two scans of a closure by the result and by the truth from which it was wrong."""
WARM = 300
"""Scans built before the clock starts, so that compiled code is loaded."""


@dataclass(frozen=True)
class Run:
    """One build. stages: name to (wall, CPU) seconds; wall, cpu: s, whole; memory: peak, MiB; ate: m; wrong: closures
    that the result agrees with and the truth does not."""

    scans: int
    stages: dict[str, tuple[float, float]]
    wall: float
    cpu: float
    memory: float
    ate: float
    heading: float
    closures: int
    wrong: int


class _Clocks:
    """Wall and CPU seconds of every stage."""

    def __init__(self) -> None:
        self.stages: dict[str, tuple[float, float]] = {}

    @contextmanager
    def stage(self, name: str, total: int | None = None, unit: str = "") -> Iterator[Stage]:
        wall, cpu = time.perf_counter(), time.process_time()
        yield _Silent()
        before = self.stages.get(name, (0.0, 0.0))
        self.stages[name] = (before[0] + time.perf_counter() - wall, before[1] + time.process_time() - cpu)


class _Silent:
    def advance(self, count: int = 1) -> None: ...


def drive(scans: int, rooms: int, seed: int) -> tuple[Scans, Trajectory, Trajectory]:
    """Scans, truth and odometry of a patrol."""
    plan = office_plan(seed, rooms, ROUNDED * SPACING * scans)
    rate = (scans + 1) / drive_path(plan).duration
    simulation = run_simulation(dataclasses.replace(plan, lidar=dataclasses.replace(plan.lidar, rate=rate)), seed)
    return simulation.scans, simulation.truth, simulation.odometry


def measure(path: Path, count: int, odometry: bool) -> Run:
    """Build the first `count` scans of the drive in `path`."""
    with path.open("rb") as file:
        scans, truth, wheels = pickle.load(file)
    sequence = Sequence("patrol", _first(scans, count), odometry=wheels if odometry else None)
    del scans
    build(dataclasses.replace(sequence, scans=_first(sequence.scans, WARM)), Config())
    clocks, wall, cpu = _Clocks(), time.perf_counter(), time.process_time()
    built = build(sequence, Config(), clocks)
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    memory = _peak()
    errors = trajectory_errors(built.estimate.trajectory, truth)
    closures, wrong = _closures(built, truth)
    return Run(count, clocks.stages, wall, cpu, memory, errors.ate, errors.heading, closures, wrong)


def _peak() -> float:
    """MiB that this process had at most; getrusage would count what its parent had when it was started."""
    found = re.search(r"VmHWM:\s+(\d+) kB", Path("/proc/self/status").read_text())
    return int(found[1]) / 1024 if found else float("nan")


def _first(scans: Scans, count: int) -> Scans:
    return dataclasses.replace(scans, timestamps=scans.timestamps[:count], ranges=scans.ranges[:count].copy())


def _closures(built: Build, truth: Trajectory) -> tuple[int, int]:
    first, second = built.estimate.closures.T
    mine, true = (between2(t.poses[first], t.poses[second]) for t in (built.estimate.trajectory, truth))
    return len(first), int((np.linalg.norm((mine - true)[:, :2], axis=1) > WRONG).sum())


def table(runs: list[Run]) -> str:
    """The runs as a markdown table; seconds are wall (CPU), growth is that of the CPU time a scan."""
    names = list(runs[0].stages)
    head = ["scans", *(f"{name}, s" for name in names), "whole, s", "CPU ms a scan", "growth", "peak, MiB", "ATE, cm",
            "heading, deg", "closures", "of these wrong"]  # fmt: skip
    lines = ["| " + " | ".join(head) + " |", "|" + " --- |" * len(head)]
    for run in runs:
        each = run.cpu / run.scans
        cells = [f"{run.scans:,}", *("{:.1f} ({:.1f})".format(*run.stages[name]) for name in names)]
        cells += [f"{run.wall:.0f} ({run.cpu:.0f})", f"{each * 1e3:.2f}"]
        cells += [f"{each / (runs[0].cpu / runs[0].scans):.2f}", f"{run.memory:.0f}", f"{run.ate * 100:.1f}"]
        cells += [f"{run.heading:.3f}", f"{run.closures}", f"{run.wrong}"]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def picture(runs: list[Run], path: Path) -> None:
    """Time a scan by stage, and peak memory, over the length of the drive."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4))
    places, bottom = np.arange(len(runs)), np.zeros(len(runs))
    for name in runs[0].stages:
        each = np.array([run.stages[name][1] / run.scans * 1e3 for run in runs])
        left.bar(places, each, 0.6, bottom, label=name)
        bottom += each
    left.set_xticks(places, [f"{run.scans:,}" for run in runs])
    left.axhline(1.3 * bottom[0], color="k", ls="--", lw=0.8, label="1.3 times the shortest drive")
    left.set(xlabel="scans", ylabel="CPU time a scan, ms", title="Time")
    left.set_ylim(0.0, 1.9 * bottom.max())
    left.legend(fontsize=8, loc="upper left", ncol=2)
    right.plot([run.scans for run in runs], [run.memory for run in runs], "o-")
    right.axhline(3072, color="k", ls="--", lw=0.8)
    right.set(xlabel="scans", ylabel="peak memory, MiB", title="Memory", xscale="log", ylim=(0, 3700))
    figure.tight_layout()
    figure.savefig(path, dpi=110)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--most", type=int, default=10_000, help="scans of the longest drive")
    parser.add_argument("--rooms", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--no-odometry", action="store_true")
    parser.add_argument("--picture", type=Path, help="where to write the plot")
    arguments = parser.parse_args()
    sizes = [size for size in SIZES if size <= arguments.most]
    runs = []
    with tempfile.TemporaryDirectory() as scratch:
        path = Path(scratch) / "drive.pkl"
        path.write_bytes(pickle.dumps(drive(max(sizes), arguments.rooms, arguments.seed)))
        spawn = multiprocessing.get_context("spawn")
        with ProcessPoolExecutor(1, spawn, max_tasks_per_child=1) as pool:
            for size in sizes:
                runs.append(pool.submit(measure, path, size, not arguments.no_odometry).result())
                print(table(runs[-1:]), flush=True)
    print(table(runs))
    if arguments.picture is not None:
        picture(runs, arguments.picture)


if __name__ == "__main__":
    main()
