"""Frozen dataclasses from JSON and back: types, ranges and unknown keys checked, errors that say where."""

from __future__ import annotations

import dataclasses
import math
import types
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

from recon.errors import InputError

T = TypeVar("T")


def number(default: float, low: float, high: float) -> Any:
    """A dataclass field holding a number in [low, high]."""
    return dataclasses.field(default=default, metadata={"low": low, "high": high})


def from_dict(cls: type[T], data: object, where: str) -> T:
    """`cls` from a JSON object; `where` names it in errors ("camera", "rooms[2]").

    Raises InputError: not an object, an unknown or missing key, a value of another type or out of its range.
    """
    if not isinstance(data, dict):
        raise InputError(f"{where}: an object is expected, not {_short(data)}")
    fields = {f.name: f for f in dataclasses.fields(cls)}  # type: ignore[arg-type]
    unknown = sorted(set(data) - set(fields))
    if unknown:
        raise InputError(f"{where}: unknown key {unknown[0]!r} (known: {', '.join(fields)})")
    hints = get_type_hints(cls)
    values: dict[str, Any] = {}
    for name, field in fields.items():
        if name in data:
            values[name] = _convert(hints[name], data[name], f"{where}.{name}")
            _check_range(values[name], field.metadata, f"{where}.{name}")
        elif field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING:
            raise InputError(f"{where}: the key {name!r} is missing")
    return cls(**values)


def to_dict(value: Any) -> Any:
    """The JSON value of a dataclass made of what `from_dict` reads; `from_dict` gives the same dataclass back."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: to_dict(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, tuple | list):
        return [to_dict(item) for item in value]
    return value


def check_ranges(value: Any, where: str) -> None:
    """The ranges of a dataclass built in Python, as `from_dict` checks those of JSON; raises InputError."""
    for field in dataclasses.fields(value):
        _check_range(getattr(value, field.name), field.metadata, f"{where}.{field.name}")


def _check_range(value: Any, metadata: Any, where: str) -> None:
    if value is None or "low" not in metadata:
        return
    low, high = metadata["low"], metadata["high"]
    if not low <= value <= high:
        raise InputError(f"{where}: {value:g} is out of range, {low:g} to {high:g} is expected")


def _convert(hint: Any, value: object, where: str) -> Any:
    origin, args = get_origin(hint), get_args(hint)
    if origin in (Union, types.UnionType):
        if value is None and type(None) in args:
            return None
        return _convert(next(a for a in args if a is not type(None)), value, where)
    if origin is Literal:
        if value not in args:
            raise InputError(f"{where}: {_short(value)} is unknown (known: {', '.join(map(str, args))})")
        return value
    if origin is tuple:
        return _convert_tuple(args, value, where)
    if dataclasses.is_dataclass(hint):
        return from_dict(hint, value, where)  # type: ignore[arg-type]
    return _convert_scalar(hint, value, where)


def _convert_tuple(args: tuple[Any, ...], value: object, where: str) -> tuple[Any, ...]:
    if not isinstance(value, list | tuple):
        raise InputError(f"{where}: a list is expected, not {_short(value)}")
    if len(args) == 2 and args[1] is Ellipsis:
        return tuple(_convert(args[0], item, f"{where}[{i}]") for i, item in enumerate(value))
    if len(value) != len(args):
        raise InputError(f"{where}: {len(args)} numbers are expected, not {len(value)}")
    return tuple(_convert(a, item, f"{where}[{i}]") for i, (a, item) in enumerate(zip(args, value, strict=True)))


def _convert_scalar(hint: Any, value: object, where: str) -> Any:
    if hint is bool or hint is str:
        if not isinstance(value, hint):
            raise InputError(
                f"{where}: {'true or false' if hint is bool else 'a string'} is expected, not {_short(value)}"
            )
        return value
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise InputError(f"{where}: a number is expected, not {_short(value)}")
    if hint is int:
        if value != int(value):
            raise InputError(f"{where}: a whole number is expected, not {_short(value)}")
        return int(value)
    return float(value)


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 40 else text[:37] + "..."
