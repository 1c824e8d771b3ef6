"""Text tables of numbers: errors name the file, the line and what is wrong with it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from recon.errors import InputError
from recon.files import read_text
from recon.geometry import Array


def content_lines(path: Path) -> list[tuple[int, str]]:
    """(line number from 1, text) of every line that is not blank; `#` at a line's start or after a blank comments."""
    lines = []
    for number, line in enumerate(read_text(path).splitlines(), start=1):
        text = "" if line.lstrip().startswith("#") else line.split(" #")[0].split("\t#")[0].strip()
        if text:
            lines.append((number, text))
    return lines


def read_table(path: Path, columns: str, separator: str | None = None, header: bool = False) -> Array:
    """Rows (N, C) of finite or infinite numbers, C columns named in `columns` (for messages), in file order.

    `header`: the first line must hold those names. Raises InputError, naming the line, for anything else.
    """
    names = columns.split()
    lines = content_lines(path)
    if header:
        found = [c.strip().lower() for c in lines[0][1].split(separator)] if lines else []
        if found != names:
            raise InputError(f"{path}: header is {','.join(found)!r}, expected {','.join(names)!r}")
        lines = lines[1:]
    rows = np.empty((len(lines), len(names)))
    for i, (number, text) in enumerate(lines):
        fields = text.split(separator)
        if len(fields) != len(names):
            raise InputError(f"{path}:{number}: {len(fields)} columns, expected {len(names)}: {columns}")
        try:
            rows[i] = [float(field) for field in fields]
        except ValueError:
            raise InputError(f"{path}:{number}: {text[:60]!r} is not all numbers, expected {columns}") from None
    return rows


def check_increasing(path: Path, timestamps: ArrayLike, what: str) -> None:
    """Raises InputError unless the time stamps (N,) are finite and each is later than the one before."""
    t = np.asarray(timestamps, dtype=np.float64)
    bad = np.flatnonzero(~np.isfinite(t))
    if len(bad):
        raise InputError(f"{path}: time stamp of {what} {bad[0]} is {t[bad[0]]}, expected a finite number of seconds")
    bad = np.flatnonzero(np.diff(t) <= 0)
    if len(bad):
        i = int(bad[0]) + 1
        raise InputError(
            f"{path}: time stamps are not increasing: {what} {i} is at {t[i]:.6f} s, the one before at {t[i - 1]:.6f} s"
        )
