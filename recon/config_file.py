"""The configuration as TOML: read with unknown keys refused, written resolved into the result folder."""

from __future__ import annotations

import json
import math
import tomllib
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any, Literal, get_args, get_origin, get_type_hints

from recon.config import Config
from recon.errors import ConfigError, InputError
from recon.files import read_text


def load_config(path: Path) -> Config:
    """The configuration of a TOML file; keys that are absent keep their defaults.

    Raises ConfigError, naming the file and the key, for a missing or damaged file, an unknown key, and a value of the
    wrong kind or out of range (numbers are finite and positive; where the default is 0, it is allowed).
    """
    try:
        content = tomllib.loads(read_text(path))
    except (ValueError, RecursionError) as error:  # damaged, a number of thousands of digits, nesting without end
        raise ConfigError(f"{path}: is not TOML: {error}") from None
    except InputError as error:
        raise ConfigError(str(error)) from None
    config: Config = _filled(Config(), content, str(path), "")
    return config


def to_toml(config: Config) -> str:
    """Every value, resolved, as TOML text that `load_config` reads back to the same configuration."""
    plain = [f for f in fields(config) if not is_dataclass(getattr(config, f.name))]
    lines = [f"{f.name} = {_literal(getattr(config, f.name))}" for f in plain]
    for field in fields(config):
        stage = getattr(config, field.name)
        if is_dataclass(stage):
            lines += ["", f"[{field.name}]"]
            lines += [f"{f.name} = {_literal(getattr(stage, f.name))}" for f in fields(stage)]
    return "\n".join(lines) + "\n"


def _filled(defaults: Any, content: dict[str, Any], path: str, prefix: str) -> Any:
    """A copy of the dataclass with the values of `content`; `prefix` is the table's name and a dot."""
    hints = get_type_hints(type(defaults))
    known = [field.name for field in fields(defaults)]
    values = {name: getattr(defaults, name) for name in known}
    for key, value in content.items():
        if key not in values:
            raise ConfigError(
                f"{path}: unknown key {prefix}{key}; known are {', '.join(prefix + name for name in known)}"
            )
        if is_dataclass(values[key]):
            if not isinstance(value, dict):
                raise ConfigError(f"{path}: {key} is {value!r}, expected a table [{key}]")
            values[key] = _filled(values[key], value, path, f"{key}.")
        else:
            values[key] = _checked(value, hints[key], values[key], f"{path}: {prefix}{key}")
    return type(defaults)(**values)


def _checked(value: Any, kind: Any, default: Any, where: str) -> Any:
    """`value` as `kind` (bool, int, float, str or a Literal of strings)."""
    if get_origin(kind) is Literal:
        if value not in get_args(kind):
            raise ConfigError(f"{where} is {value!r}, expected one of {', '.join(get_args(kind))}")
        return value
    if kind is float and isinstance(value, int) and not isinstance(value, bool):
        value = float(value)
    if type(value) is not kind:
        raise ConfigError(f"{where} is {value!r}, expected {kind.__name__}")
    if kind in (int, float):
        limit = ">= 0" if default == 0 else "> 0"
        if not math.isfinite(value) or value < 0 or (value == 0 and default != 0):
            raise ConfigError(f"{where} is {value!r}, expected a number {limit}")
    return value


def _literal(value: bool | int | float | str) -> str:
    """JSON's spelling of booleans, numbers and strings is TOML's."""
    return json.dumps(value)
