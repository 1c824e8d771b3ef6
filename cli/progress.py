"""Progress for people: bars with rates on a terminal, one plain line a stage elsewhere, on standard error."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

import click

from recon.progress import SILENT, Progress, Stage

PATIENCE = 10.0
"""s between plain lines of one long stage."""


def terminal_progress(quiet: bool) -> Progress:
    """Silent, bars or plain lines, as asked and as standard error allows."""
    if quiet:
        return SILENT
    if not sys.stderr.isatty():
        return PlainProgress()
    from recon.cli.bars import BarProgress

    return BarProgress()


def done_line(name: str, count: int, unit: str, seconds: float) -> str:
    """How a stage went: its units, seconds and rate."""
    if count == 0:
        return f"{name}: {seconds:.1f} s"
    rate = f", {rate_text(count / seconds)}" if seconds > 0.05 else ""
    return f"{name}: {count} {unit} in {seconds:.1f} s{rate}"


def rate_text(rate: float) -> str:
    """Units a second, with a decimal where they are few."""
    return f"{rate:.0f}/s" if rate >= 10 else f"{rate:.1f}/s"


class _PlainStage:
    def __init__(self, name: str, total: int | None, unit: str) -> None:
        self.name, self.total, self.unit, self.count = name, total, unit, 0
        self.start = self.said = time.monotonic()

    def advance(self, count: int = 1) -> None:
        self.count += count
        now = time.monotonic()
        if now - self.said > PATIENCE:
            self.said = now
            of = f" of {self.total}" if self.total else ""
            click.echo(f"{self.name}: {self.count}{of} {self.unit} after {now - self.start:.0f} s", err=True)


class PlainProgress:
    """A line when a stage is done, and one every ten seconds of a long one."""

    @contextmanager
    def stage(self, name: str, total: int | None = None, unit: str = "") -> Iterator[Stage]:
        """A stage that says how it went when it is done."""
        stage = _PlainStage(name, total, unit)
        yield stage
        click.echo(done_line(name, stage.count, unit, time.monotonic() - stage.start), err=True)
