"""Words of messages, and names."""

from pathlib import Path

SUFFIXES = (".gz", ".log", ".clf", ".active", ".bag", ".db3", ".mcap")


def drive_name(path: Path) -> str:
    """Name of a log or folder, without the suffixes of logs."""
    name = path.resolve().name
    for suffix in SUFFIXES:
        name = name.removesuffix(suffix)
    return name or path.name


def plural(count: int, noun: str) -> str:
    """`1 scan`, `2 scans`."""
    return f"{count} {noun}{'' if count == 1 else 's'}"
