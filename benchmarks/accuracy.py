"""Accuracy of whole builds as a markdown table: `python benchmarks/accuracy.py SEQ [SEQ ...] --buildings 6`.

Every sequence is built with its odometry and without, never with its extrinsics; then simulated buildings follow, which
differ in camera, lens, mounting, scanner, angles and clutter from one to the next.
"""

from __future__ import annotations

import argparse
import dataclasses
import tempfile
import time
from pathlib import Path

from recon.config import Config
from recon.evaluate import Evaluation, evaluate
from recon.pipeline import build
from recon.results import save_result
from recon.sequence.folder import read_sequence
from recon.simulate import random_plan, simulate

HEAD = (
    "| drive | ATE, cm | heading, deg | camera x, y, height, cm | camera rotation, deg | wall F1 at 2 / 5 / 10 cm "
    "| ceiling, cm | labels | CPU, s |\n| --- | --- | --- | --- | --- | --- | --- | --- | --- |"
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("sequences", nargs="*", type=Path)
    parser.add_argument("--buildings", type=int, default=0, help="how many simulated buildings")
    arguments = parser.parse_args()
    print(HEAD)
    with tempfile.TemporaryDirectory() as scratch:
        for folder in arguments.sequences:
            for odometry in (True, False):
                name = f"{folder.name}, {'with' if odometry else 'without'} odometry"
                print(row(name, folder, odometry, Path(scratch) / "result.recon"), flush=True)
        for seed in range(100, 100 + arguments.buildings):
            folder = Path(scratch) / f"drive{seed}"
            rooms, angles = 1 + seed % 4, "any" if seed % 2 else "manhattan"
            simulate(random_plan(seed, rooms, angles), folder, seed)  # type: ignore[arg-type]
            name = f"simulated {seed}: {rooms} rooms, {angles}"
            print(row(name, folder, False, Path(scratch) / f"{seed}.recon"), flush=True)


def row(name: str, folder: Path, odometry: bool, result: Path) -> str:
    """Build, compare, and one line of the table."""
    sequence = dataclasses.replace(read_sequence(folder), platform_from_camera=None)
    if not odometry:
        sequence = dataclasses.replace(sequence, odometry=None)
    start = time.process_time()
    save_result(build(sequence, Config()), result)
    seconds = time.process_time() - start
    return f"| {name} | {' | '.join(cells(evaluate(folder, result)))} | {seconds:.1f} |"


def cells(scores: Evaluation) -> list[str]:
    """Numbers in the order of the head, a dash where the truth says nothing."""
    t, e, w, s = scores.trajectory, scores.extrinsics, scores.walls, scores.labels
    return [
        "-" if t is None else f"{t.ate * 100:.2f}",
        "-" if t is None else f"{t.heading:.3f}",
        "-" if e is None else f"{e.x * 100:+.1f}, {e.y * 100:+.1f}, {e.height * 100:+.1f}",
        "-" if e is None else f"{e.rotation:.3f}",
        "-" if w is None else " / ".join(f"{f:.3f}" for f in w.f1),
        "-" if scores.ceiling is None else f"{scores.ceiling * 100:+.1f}",
        "-" if s is None else f"{s.accuracy:.1%}",
    ]


if __name__ == "__main__":
    main()
