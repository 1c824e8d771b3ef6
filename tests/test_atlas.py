"""Small pictures on shared pages: what a renderer reads there is what it read before."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from open_house import open_house

from recon.exporters import export
from recon.exporters.atlas import BORDER, PAGE, SMALL, on_pages
from recon.exporters.options import ExportOptions
from recon.exporters.pictures import mean_colour
from recon.geometry import Array
from recon.model import Face
from recon.sampling import sample_texture

SIZES = st.tuples(st.integers(1, SMALL + 40), st.integers(1, SMALL + 40))


def face(number: int, size: tuple[int, int], rng: np.random.Generator) -> Face:
    """A square metre with a picture of noise and the whole of it, or a part, as its uv."""
    width, height = size
    uv = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=np.float64)
    vertices = np.column_stack([uv, np.zeros(4)])
    texture = rng.integers(0, 256, (height, width, 3), dtype=np.uint8)
    return Face(f"wall_{number:03d}", "wall", number, vertices, np.array([[0, 1, 2], [0, 2, 3]]), uv, texture)


def shape_of(one: Face) -> tuple[int, ...]:
    assert one.texture is not None
    return one.texture.shape


def half(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The next level of a mip map; a last odd row or column stands for itself."""
    height, width = picture.shape[:2]
    even = cv2.copyMakeBorder(picture, 0, height % 2, 0, width % 2, cv2.BORDER_REPLICATE)
    size = even.shape[1] // 2, even.shape[0] // 2
    return np.asarray(cv2.resize(even, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)


@given(st.lists(SIZES, min_size=2, max_size=12), st.integers(0, 99))
@settings(deadline=None, max_examples=40)
def test_a_page_shows_what_the_picture_showed(sizes: list[tuple[int, int]], seed: int) -> None:
    rng = np.random.default_rng(seed)
    faces = tuple(face(k, size, rng) for k, size in enumerate(sizes))
    packed = on_pages(faces, 4096)
    for old, new in zip(faces, packed, strict=True):
        small = max(sizes[old.ref]) <= SMALL
        if new is old:
            assert not small or sum(max(size) <= SMALL for size in sizes) == 1
            continue
        assert small and new.texture is not None and max(new.texture.shape) <= PAGE
        at = rng.uniform(0, 1, (200, 2))
        there = new.uv[0] + at * (new.uv[2] - new.uv[0])
        assert old.texture is not None
        np.testing.assert_allclose(sample_texture(new.texture, there), sample_texture(old.texture, at), atol=0.01)
        assert mean_colour(new) == pytest.approx(old.texture.reshape(-1, 3).mean(axis=0), abs=0.5)
    assert {new.page for new in packed} == {new.page for new in on_pages(faces, 4096)}


@pytest.mark.parametrize("level", [1, 2, 3, 4])
def test_nothing_bleeds_from_picture_to_picture_in_mip_maps(level: int) -> None:
    rng = np.random.default_rng(0)
    colours = rng.integers(0, 256, (12, 3))
    faces = tuple(
        replace(one, texture=np.broadcast_to(colours[k].astype(np.uint8), shape_of(one)).copy())
        for k, one in enumerate(
            face(k, (int(w), int(h)), rng) for k, (w, h) in enumerate(rng.integers(9, 300, (12, 2)))
        )
    )
    packed = on_pages(faces, 4096)
    page = packed[0].texture
    assert page is not None
    for _ in range(level):
        page = half(page)
    for k, one in enumerate(packed):
        at: Array = one.uv[0] + rng.uniform(0, 1, (100, 2)) * (one.uv[2] - one.uv[0])
        np.testing.assert_allclose(sample_texture(page, at), np.tile(colours[k], (100, 1)), atol=1)
    assert 2**level <= BORDER


def test_faces_keep_their_nodes_and_share_materials(tmp_path: Path) -> None:
    model = open_house()
    export(model, tmp_path / "house.gltf", ExportOptions(texture_format="png"))
    document = json.loads((tmp_path / "house.gltf").read_text())
    meshes = {node["name"] for node in document["nodes"] if "mesh" in node}
    assert meshes == {one.name for one in model.faces}
    assert [image["name"] for image in document["images"]] == ["page_00"]
    textured = {material["name"] for material in document["materials"] if not material["name"].startswith("neutral")}
    assert textured == {"page_00"}
    export(model, tmp_path / "house.obj", ExportOptions(texture_format="png"))
    assert (tmp_path / "house.mtl").read_text().count("map_Kd house.textures/page_00.png") == 1
