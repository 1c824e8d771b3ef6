"""Seconds of every stage and peak memory of one build: `python benchmarks/build.py samples/corridor`."""

from __future__ import annotations

import resource
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from recon.config import Config
from recon.pipeline import build
from recon.progress import Stage
from recon.sequence.folder import read_sequence


class _Count:
    def __init__(self) -> None:
        self.count = 0

    def advance(self, count: int = 1) -> None:
        self.count += count


class Stopwatch:
    """Prints wall and CPU seconds of every stage when it ends."""

    @contextmanager
    def stage(self, name: str, total: int | None = None, unit: str = "") -> Iterator[Stage]:
        """One line of the table."""
        count, wall, cpu = _Count(), time.perf_counter(), time.process_time()
        yield count
        wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
        each = f"{cpu / count.count * 1000:8.2f} ms a unit of {count.count} {unit}" if count.count else ""
        print(f"{name:<28}{wall:8.2f} s wall {cpu:8.2f} s CPU  {each}")


def main() -> None:
    watch = Stopwatch()
    with watch.stage("whole build"):
        with watch.stage("reading"):
            sequence = read_sequence(Path(sys.argv[1]))
        build(sequence, Config(), watch)
    print(f"peak memory {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MiB")


if __name__ == "__main__":
    main()
