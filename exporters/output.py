"""What a writer gives: the bytes of one file, and of those that belong beside it."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class Output:
    """One exported file. beside: content of further files, by path relative to the folder of the file.

    notes: lines for people about what could not be done as asked.
    """

    content: bytes
    beside: dict[str, bytes] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
