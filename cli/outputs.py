"""Where results go, checked before anything is computed."""

from __future__ import annotations

import tempfile
from pathlib import Path

from recon.errors import OutputError

RESULT_SUFFIX = ".recon"
MARKER = "layout.json"
"""A folder that holds it is a result folder and may be replaced."""


def work_folder(outputs: tuple[Path, ...], work: Path | None) -> Path:
    """The result folder: `work`, else the first output with the suffix `.recon`.

    Raises OutputError when it cannot be made or written, or is something else's: a file, or a folder with other things.
    """
    folder = work if work is not None else outputs[0].with_suffix(RESULT_SUFFIX)
    if folder.exists() and not folder.is_dir():
        raise OutputError(f"{folder}: is a file, expected the result folder or nothing there")
    if folder.is_dir() and any(folder.iterdir()) and not (folder / MARKER).is_file():
        raise OutputError(f"{folder}: is not empty and no result folder of recon, choose another with --work")
    check_writable(folder)
    return folder


def check_writable(path: Path) -> None:
    """Raises OutputError unless `path` can be made, or replaced, in a folder that is there and writable."""
    parent = path.absolute().parent
    if not parent.is_dir():
        raise OutputError(f"{path}: folder {parent} does not exist")
    try:  # a try tells more than permission bits: read-only mounts, full disks, the super-user
        for place in (parent, path) if path.is_dir() else (parent,):
            with tempfile.TemporaryFile(dir=place):
                pass
    except OSError as error:
        raise OutputError(f"{path}: cannot be written: {error.strerror or error}") from None
