"""Progress bars (rich), loaded only on a terminal."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

import click
from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    SpinnerColumn,
    Task,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
)
from rich.text import Text

from recon.cli.progress import done_line, rate_text
from recon.progress import Stage


class RateColumn(ProgressColumn):
    """Units a second, once there are any."""

    def render(self, task: Task) -> Text:
        """The unit and the rate."""
        rate = f" {rate_text(task.speed)}" if task.speed else ""
        return Text(f"{task.fields['unit']}{rate}")


class _BarStage:
    def __init__(self, bars: Progress, task: TaskID) -> None:
        self.bars, self.task, self.count = bars, task, 0

    def advance(self, count: int = 1) -> None:
        self.count += count
        self.bars.advance(self.task, count)


class BarProgress:
    """A bar with the rate while a stage works, a line when it is done."""

    @contextmanager
    def stage(self, name: str, total: int | None = None, unit: str = "") -> Iterator[Stage]:
        """A stage with a bar."""
        counts = [BarColumn(), MofNCompleteColumn(), RateColumn()] if total else []
        columns = [SpinnerColumn(), TextColumn("{task.description}"), *counts, TimeElapsedColumn()]
        start = time.monotonic()
        with Progress(*columns, console=Console(stderr=True), transient=True) as bars:
            stage = _BarStage(bars, bars.add_task(name, total=total, unit=unit))
            yield stage
        click.echo(done_line(name, stage.count, unit, time.monotonic() - start), err=True)
