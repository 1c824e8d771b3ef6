"""Objects: closed prisms, heights measured from images, labels."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from box_room import SIZE, WIDE, Block, box_layout, camera_at, photograph
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from recon.faces import extrude
from recon.geometry import Pose3
from recon.labels import OBJECT, LabelRenderer
from recon.layout_json import layout_from_json, layout_to_json
from recon.model import FloorObject, Layout
from recon.prisms import measure_objects, prism

STANDING = Block(np.array([3.2, 2.2, 0.0]), np.array([3.7, 2.8, 0.75]))
HANGING = Block(np.array([4.5, 0.6, 1.1]), np.array([4.9, 1.2, 1.6]))
NOTHING = np.array([[3.0, 0.6], [3.4, 0.6], [3.4, 1.0], [3.0, 1.0]])
POSES = tuple(camera_at(0.5 + 0.3 * i, 1.6 + 0.05 * i, 0.05, 0.15) for i in range(7))


@cache
def pictures() -> tuple[NDArray[np.uint8], ...]:
    return tuple(photograph(WIDE, pose, 1 + 0.05 * (i % 3), (STANDING, HANGING)) for i, pose in enumerate(POSES))


def furnished() -> Layout:
    prints = (STANDING.footprint(), NOTHING, HANGING.footprint())
    return replace(box_layout(), objects=tuple(FloorObject(i, footprint) for i, footprint in enumerate(prints)))


def measured(poses: tuple[Pose3 | None, ...] = POSES) -> tuple[FloorObject, ...]:
    layout = furnished()
    return measure_objects(layout, extrude(layout), WIDE, poses, lambda i: pictures()[i])


@given(st.integers(3, 12), st.floats(0, 1.0), st.floats(0.1, 2.0), st.floats(0.1, 3.0))
def test_prism_is_closed_and_faces_outwards(n: int, bottom: float, height: float, radius: float) -> None:
    angles = 2 * np.pi * np.arange(n) / n
    footprint = radius * np.stack([np.cos(angles), np.sin(angles)], axis=1) + [3.0, -2.0]
    face = prism(footprint, bottom, bottom + height, 4)
    a, b, c = (face.vertices[face.triangles[:, i]] for i in range(3))
    area = n / 2 * radius**2 * np.sin(2 * np.pi / n)
    assert float(np.sum(a * np.cross(b, c)) / 6) == pytest.approx(area * height, rel=1e-6, abs=1e-9)
    assert np.abs(np.cross(b - a, c - a).sum(axis=0)).max() < 1e-6, "a closed surface"


def test_heights_are_measured() -> None:
    standing, nothing, hanging = measured()
    assert standing.top == pytest.approx(STANDING.high[2], abs=0.1) and standing.bottom == 0.0
    assert nothing.top is None, "nothing stands there"
    assert hanging.top == pytest.approx(HANGING.high[2], abs=0.1)
    assert hanging.bottom == pytest.approx(HANGING.low[2], abs=0.15), "images show the wall below it"


def test_nothing_is_claimed_without_images() -> None:
    assert [o.top for o in measured((None,) * len(POSES))] == [None] * 3
    assert [o.top for o in measured((POSES[0], *[None] * 6))] == [None] * 3, "one image alone tells nothing"
    layout = furnished()
    assert [o.top for o in measure_objects(layout, extrude(layout), WIDE, POSES, lambda _: None)] == [None] * 3
    bare = box_layout()
    assert measure_objects(bare, extrude(bare), WIDE, POSES, lambda i: pictures()[i]) == ()


def test_labels_show_objects() -> None:
    known = replace(FloorObject(0, STANDING.footprint()), top=0.75)
    renderer = LabelRenderer(extrude(box_layout()), WIDE, (known, FloorObject(1, NOTHING)))
    for pose in POSES:
        rays = WIDE.rays().reshape(-1, 3) @ pose.rotation.T
        truth = np.isfinite(STANDING.reach(pose.translation, rays)).reshape(WIDE.height, WIDE.width)
        assert float(((renderer.render(pose) == OBJECT) != truth).mean()) < 0.001
        assert 0.001 < truth.mean() < 0.5


def test_heights_survive_the_layout_file() -> None:
    layout = replace(furnished(), objects=measured(), ceiling_height=float(SIZE[2]))
    again = layout_from_json(layout_to_json(layout), "layout.json")
    assert [(o.bottom, o.top) for o in again.objects] == [(o.bottom, o.top) for o in layout.objects]
