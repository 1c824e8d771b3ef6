"""How a build says how far it is. Stages count; who looks (terminal, log, nobody) is up to the caller."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Protocol


class Stage(Protocol):
    """One stage at work."""

    def advance(self, count: int = 1) -> None:
        """`count` more units are done. May be called from any thread."""


class Progress(Protocol):
    """`with progress.stage("image lines", total=43, unit="images") as stage: stage.advance()`."""

    def stage(self, name: str, total: int | None = None, unit: str = "") -> AbstractContextManager[Stage]:
        """A stage of `total` units (None: not known), shown until the block ends."""


class SilentStage:
    """Counts nothing."""

    def advance(self, count: int = 1) -> None:
        """Nothing."""


class SilentProgress:
    """Shows nothing: the default of the library."""

    @contextmanager
    def stage(self, name: str, total: int | None = None, unit: str = "") -> Iterator[Stage]:
        """A stage that nobody sees."""
        yield SilentStage()


SILENT = SilentProgress()
