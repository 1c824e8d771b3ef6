from __future__ import annotations

import copy
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from recon.errors import InputError
from recon.layout_file import read_layout, write_layout

WRONG: tuple[Any, ...] = (None, True, -1, float("nan"), 10**400, "x", [], {}, [1, 2])
TRUTH = Path(__file__).resolve().parents[1] / "samples/corridor/groundtruth/layout.json"


def test_round_trip(tmp_path: Path) -> None:
    layout = read_layout(TRUTH)
    write_layout(tmp_path / "layout.json", layout)
    back = read_layout(tmp_path / "layout.json")
    write_layout(tmp_path / "again.json", back)
    assert (tmp_path / "layout.json").read_bytes() == (tmp_path / "again.json").read_bytes()
    assert len(back.walls) == 6
    assert len(back.openings) == len(layout.openings) > 5
    assert back.ceiling_height == 2.6


def places(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Where in a JSON value something could be replaced; of lists, the first two items."""
    if path:
        yield path
    items = value.items() if isinstance(value, dict) else enumerate(value[:2]) if isinstance(value, list) else ()
    for key, item in items:
        yield from places(item, (*path, key))


def test_wrong_values_are_refused_by_name_or_harmless(tmp_path: Path) -> None:
    content, file, refused = json.loads(TRUTH.read_text()), tmp_path / "layout.json", 0
    for path in places(content):
        for value in WRONG:
            changed = copy.deepcopy(content)
            target = changed
            for key in path[:-1]:
                target = target[key]
            target[path[-1]] = value
            file.write_text(json.dumps(changed))
            try:
                read_layout(file)
            except InputError as error:
                refused += 1
                assert str(error).startswith(str(file))
                assert "\n" not in str(error)
    assert refused > 200


@pytest.mark.parametrize(
    ("text", "fragment"), [("", "JSON"), ("{", "JSON"), ("[]", "layout"), ("[" * 99999, "deep"), ("\0", "text")]
)
def test_damaged_file(text: str, fragment: str, tmp_path: Path) -> None:
    (tmp_path / "layout.json").write_text(text)
    with pytest.raises(InputError, match=rf"layout\.json.*{fragment}"):
        read_layout(tmp_path / "layout.json")
