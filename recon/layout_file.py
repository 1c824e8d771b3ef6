"""layout.json (FORMAT.md) as a file."""

from __future__ import annotations

import json
from pathlib import Path

from recon.errors import InputError
from recon.files import atomic_path, read_text
from recon.layout_json import layout_from_json, layout_to_json
from recon.model import Layout


def read_layout(path: Path) -> Layout:
    """A layout.json, of ours or of ground truth. Raises InputError when it is missing, damaged or not of the schema."""
    try:
        content = json.loads(read_text(path), parse_int=_int)
    except json.JSONDecodeError as error:
        raise InputError(f"{path}:{error.lineno}: is not JSON: {error.msg}") from None
    except RecursionError:
        raise InputError(f"{path}: is nested too deeply") from None
    return layout_from_json(content, str(path))


def _int(digits: str) -> int | float:
    """Whole numbers too long for an id as floats, infinite ones among them, which are refused like any other."""
    return int(digits) if len(digits) < 16 else float(digits)


def write_layout(path: Path, layout: Layout) -> None:
    """Writes layout.json, whole or not at all."""
    with atomic_path(path) as temporary:
        temporary.write_text(json.dumps(layout_to_json(layout), indent=1) + "\n", encoding="utf-8")
