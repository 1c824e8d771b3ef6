"""A sequence from whatever holds one: a folder, a ROS bag, a CARMEN log."""

from __future__ import annotations

from pathlib import Path

from recon.errors import InputError
from recon.sequence.jumps import without_jumps
from recon.sequence.sequence import Sequence
from recon.sequence.topics import Topics

FOLDER_FILES = ("scans.npz", "scans.csv", "camera.yaml", "images.txt")
"""Any of them makes a folder a sequence folder."""
BAG_SUFFIXES = (".bag", ".bag.active", ".db3", ".mcap")
CARMEN_SUFFIXES = (".log", ".log.gz", ".clf", ".clf.gz", ".carmen", ".carmen.gz")


def open_sequence(path: Path, topics: Topics | None = None) -> Sequence:
    """The sequence in `path`, read as what it is:

    - a folder with scans.npz or scans.csv (FORMAT.md),
    - a ROS 1 bag (.bag), a ROS 2 bag (.db3, .mcap, or their folder, with or without metadata.yaml),
    - a CARMEN log (.log, .clf, also .gz).

    topics: which to read of a bag, where several would do. Jumps of the odometry are taken out. Raises InputError, one
    line that names the file, the value and what was expected, for whatever cannot be used.
    """
    return without_jumps(_read(Path(path), topics))


def _read(path: Path, topics: Topics | None) -> Sequence:
    """By the reader of what `path` is."""
    if _is_bag(path):
        from recon.sequence.rosbag import read_rosbag

        return read_rosbag(path, topics)
    if topics is not None and topics.named:
        raise InputError(f"{path}: is no ROS bag, and has no topics to choose from")
    if path.name.lower().endswith(CARMEN_SUFFIXES) and not path.is_dir():
        from recon.sequence.carmen import read_carmen

        return read_carmen(path)
    if path.is_file():
        known = ", ".join((*BAG_SUFFIXES, *CARMEN_SUFFIXES))
        raise InputError(
            f"{path}: is a file of an unknown kind, expected a sequence folder or a file ending in {known}"
        )
    from recon.sequence.folder import read_sequence

    return read_sequence(path)


def _is_bag(path: Path) -> bool:
    """By the suffix; of a folder by what lies in it."""
    if not path.is_dir():
        if not path.name.lower().endswith(BAG_SUFFIXES):
            return False
        if not path.exists():
            raise InputError(f"{path}: no such file")
        return True
    if any((path / name).exists() for name in FOLDER_FILES):
        return False
    return (path / "metadata.yaml").is_file() or any(p.suffix.lower() in (".db3", ".mcap") for p in path.iterdir())
