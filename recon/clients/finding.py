"""What one client says about one file."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

State = Literal["ok", "broken", "not run"]


@dataclass(frozen=True)
class Finding:
    """client: its name. text: what it found, what is wrong, or why it was not run; one line."""

    client: str
    state: State
    text: str


class Broken(Exception):
    """A client cannot use the file; the message is for people."""


class Missing(Exception):
    """A client is not installed, or not for such a file; the message says which, and what would bring it."""
