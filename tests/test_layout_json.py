from __future__ import annotations

import copy
import dataclasses
import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from two_rooms import two_rooms

from recon.errors import InputError
from recon.layout_json import layout_from_json, layout_to_json


def test_round_trip() -> None:
    layout = dataclasses.replace(two_rooms().layout, ceiling_height=None, sigma_ceiling=0.02)
    data = json.loads(json.dumps(layout_to_json(layout), allow_nan=False))
    back = layout_from_json(data, "layout.json")
    assert layout_to_json(back) == layout_to_json(layout)
    assert (back.ceiling_height, back.sigma_ceiling) == (None, 0.02)
    for one, other in zip(back.walls, layout.walls, strict=True):
        np.testing.assert_allclose([one.start, one.end], [other.start, other.end], atol=1e-6)
        assert (one.id, one.source, one.observations) == (other.id, other.source, other.observations)
        assert one.sigma_offset == pytest.approx(other.sigma_offset)


def test_unknown_accuracy_is_null() -> None:
    layout = two_rooms().layout
    wall = dataclasses.replace(layout.walls[0], sigma_offset=math.inf, sigma_angle=math.nan)
    data = layout_to_json(dataclasses.replace(layout, walls=(wall, *layout.walls[1:])))
    assert data["walls"][0]["sigma_offset"] is None
    assert layout_from_json(data, "x").walls[0].sigma_offset == math.inf


def test_true_layout_without_accuracy(shared_data: Callable[[str], Path]) -> None:
    path = shared_data("corridor") / "groundtruth" / "layout.json"
    layout = layout_from_json(json.loads(path.read_text()), str(path))
    assert (len(layout.walls), len(layout.rooms), layout.ceiling_height) == (6, 1, 2.6)
    assert all(wall.sigma_offset == 0 for wall in layout.walls)


def change(place: list[Any], value: Any) -> Any:
    data = copy.deepcopy(layout_to_json(two_rooms().layout))
    target: Any = data
    for key in place[:-1]:
        target = target[key]
    target[place[-1]] = value
    return data


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        ([], "layout is [], expected an object"),
        (change(["version"], 2), "version is 2"),
        (change(["units"], "mm"), "units is 'mm'"),
        (change(["walls"], {}), "walls is {}"),
        (change(["walls", 1, "start"], [1]), r"walls\[1\].start is \[1\], expected \[x, y\]"),
        (change(["walls", 1, "start"], [1, math.nan]), r"walls\[1\].start.y is nan, expected a number"),
        (change(["walls", 1, "id"], 0), "id 0 twice"),
        (change(["walls", 1, "id"], True), "id is True"),
        (change(["walls", 1, "source"], "guess"), "'guess', expected one of lidar, image, inferred"),
        (change(["rooms", 0, "polygon"], [[0, 0], [1, 1]]), "at least three points"),
        (change(["rooms", 0, "name"], 5), "name is 5, expected a text"),
        (change(["openings", 0, "type"], "gate"), "'gate', expected one of door, passage, window"),
        (change(["openings", 0, "wall"], 77), "opening 0 is in wall 77"),
        (change(["openings", 0, "top"], "high"), "top is 'high'"),
        (change(["ceiling_height"], "high"), "ceiling_height is 'high'"),
    ],
)
def test_what_cannot_be_is_refused(data: Any, expected: str) -> None:
    with pytest.raises(
        InputError, match=f"plan.json: .*{expected}" if "[]" not in expected else "plan.json: layout is"
    ):
        layout_from_json(data, "plan.json")
