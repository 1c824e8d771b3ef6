"""YAML mappings of numbers: camera.yaml and extrinsics.yaml."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from recon.errors import InputError
from recon.files import read_text
from recon.geometry import Array

MAX_NUMBER = 1e12
"""Nothing here is larger: pixels, metres, coefficients."""


def read_mapping(path: Path) -> dict[str, Any]:
    """The mapping that a YAML file holds. Raises InputError when it is missing, damaged or something else."""
    import yaml

    text = read_text(path)
    try:
        content = yaml.load(text, Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader))
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        line = f":{mark.line + 1}" if mark is not None else ""
        raise InputError(f"{path}{line}: is not YAML: {getattr(error, 'problem', None) or 'damaged'}") from None
    except (ValueError, RecursionError):  # a date that is none, a number of thousands of digits, nesting without end
        raise InputError(f"{path}: holds a value that is none, expected numbers") from None
    if not isinstance(content, dict):
        raise InputError(f"{path}: expected a mapping of keys to values")
    return content


def require(path: Path, mapping: dict[str, Any], key: str) -> Any:
    """The value of a key. Raises InputError, naming it, when it is absent."""
    if mapping.get(key) is None:
        raise InputError(f"{path}: {key} is missing")
    return mapping[key]


def numbers(path: Path, key: str, value: Any, sizes: tuple[int, ...]) -> Array:
    """`value` as (n,) finite numbers, n one of `sizes`. Raises InputError, naming the key, otherwise."""
    expected = " or ".join(str(size) for size in sizes)
    if not isinstance(value, list) or len(value) not in sizes:
        count = f"{len(value)} values" if isinstance(value, list) else repr(value)[:40]
        raise InputError(f"{path}: {key} has {count}, expected a list of {expected} numbers")
    for item in value:
        if isinstance(item, bool) or not isinstance(item, int | float) or not abs(item) < MAX_NUMBER:
            raise InputError(f"{path}: {key} holds {str(item)[:40]}, expected finite numbers")
    return np.array(value, dtype=np.float64)
