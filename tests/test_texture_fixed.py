"""What stays in the same place of every image: a platform's shadow on the floor, and the platform itself."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
from box_room import SIZE, WIDE, Shoot, box_layout, camera_at, face_colours, shoot, solid
from numpy.typing import NDArray

from recon.config import TextureConfig
from recon.faces import extrude
from recon.geometry import Array
from recon.model import Face
from recon.sampling import uv_from_points
from recon.texture import texture_faces
from recon.texture.fixed import CELLS, COLUMNS, ROWS, SHAPE, Seen, cell_of, find_fixed

Image = NDArray[np.uint8]


@cache
def tour() -> Shoot:
    """Round the room, looking ahead: places of the floor pass through images from the middle to the lower border."""
    turns = np.linspace(0, 2 * np.pi, 30, endpoint=False)
    places = SIZE[:2] * (0.5 + 0.25 * np.stack([np.cos(turns), np.sin(turns)], axis=1))
    yaws = turns + np.pi / 2 + 0.3 * np.sin(5 * turns)
    return shoot(WIDE, tuple(camera_at(x, y, yaw, 0.3, 0.9) for (x, y), yaw in zip(places, yaws, strict=True)))


def blob(image: Image) -> NDArray[np.bool_]:
    """Pixels (h, w) at the lower border, left of the middle."""
    y, x = (np.indices(image.shape[:2]).T / image.shape[:2]).T
    return np.asarray(((x - 0.45) / 0.3) ** 2 + ((y - 1.02) / 0.25) ** 2 < 1)


def plain(image: Image) -> Image:
    return image


def shadow(image: Image) -> Image:
    return np.where(blob(image)[..., None], np.rint(image * 0.45), image).astype(np.uint8)


def bumper(image: Image) -> Image:
    return np.where(blob(image)[..., None], (40, 50, 90), image).astype(np.uint8)


def black(image: Image) -> Image:
    return np.where(blob(image)[..., None], 4, image).astype(np.uint8)


@cache
def floor(change: Callable[[Image], Image]) -> Face:
    """The floor's picture from all images, each changed."""
    bare = tuple(face for face in extrude(box_layout()) if face.kind == "floor")
    config = TextureConfig(metres_per_texel=0.006)
    return texture_faces(bare, WIDE, tour().poses, lambda i: change(tour().images[i]), config)[0]


def errors(face: Face) -> Array:
    """Levels (n,) by which the floor's picture differs from the truth, where the untouched images show the floor."""
    points = np.random.default_rng(0).uniform([0.05, 0.05, 0], [SIZE[0] - 0.05, SIZE[1] - 0.05, 0], (4000, 3))
    sources = floor(plain).sources
    assert sources is not None
    uv = points @ uv_from_points(face)[:3] + uv_from_points(face)[3]
    rows, columns = (1 - uv[:, 1]) * sources.shape[0], uv[:, 0] * sources.shape[1]
    points = points[sources[rows.astype(int), columns.astype(int)] >= 0]
    return np.asarray(np.abs(face_colours(face, points) - solid(points)[:, ::-1]).mean(axis=1))


@pytest.mark.parametrize("change", [shadow, bumper, black])
def test_what_goes_with_the_platform_is_not_on_the_floor(change: Callable[[Image], Image]) -> None:
    """Without a word against it, 9 % of the floor are 30 levels off under the shadow, 7 % under the bumper."""
    clean, found = errors(floor(plain)), errors(floor(change))
    assert clean.mean() < 1
    assert found.mean() < clean.mean() + 2
    assert (found > 30).mean() < 0.025


def test_where_nothing_is_fixed_nothing_changes(monkeypatch: pytest.MonkeyPatch) -> None:
    """The picture is, to the bit, that of a program that does not look for shadows."""
    usual = floor(plain)
    monkeypatch.setattr("recon.texture.gains.find_fixed", lambda _: None)
    never = floor.__wrapped__(plain)
    assert usual.texture is not None and never.texture is not None
    assert usual.texture.tobytes() == never.texture.tobytes()


def samples(seed: int, light: Array, noise: float = 0.02) -> Seen:
    """3000 points of random colours, each in twelve random cells of forty images; light: (CELLS,), a logarithm."""
    rng = np.random.default_rng(seed)
    point = np.repeat(np.arange(3000), 12)
    view, cell = rng.integers(0, 40, len(point)), rng.integers(0, CELLS, len(point))
    log = rng.normal(4.5, 0.4, (3000, 3))[point] + light[cell][:, None] + rng.normal(0, noise, (len(point), 3))
    return Seen(point, view, cell, log, np.ones(len(point), bool))


@pytest.mark.parametrize("depth", [-1.0, -0.5, -0.25, 0.3])
def test_the_light_of_a_shadow_is_measured(depth: float) -> None:
    light = np.zeros(SHAPE)
    light[1, 16:, 8:20] = depth
    found = find_fixed(samples(1, light.ravel()))
    assert found is not None
    inside = found.log[1, 17:, 9:19]
    assert np.median(inside) == pytest.approx(depth, abs=0.03)
    assert (np.abs(inside - depth) < 0.06).mean() > 0.95
    assert found.doubtful[1, 16:, 8:20].all() and not found.log[0].any()
    far = np.ones(SHAPE, bool)
    far[:, 14:, 6:22] = False
    assert not found.doubtful[far].any()


@pytest.mark.parametrize("seed", range(5))
def test_noise_is_no_shadow(seed: int) -> None:
    assert find_fixed(samples(seed, np.zeros(CELLS), 0.3)) is None


def test_a_floor_that_shines_is_no_shadow() -> None:
    """Half of all places darker than the rest: that is how the floor looks, not what lies on it."""
    light = np.zeros(SHAPE)
    light[1, : ROWS // 2] = 0.3
    assert find_fixed(samples(2, light.ravel())) is None


def test_cells_cover_the_image() -> None:
    corners = np.array([[0, 0], [WIDE.width - 1, 0], [0, WIDE.height - 1], [WIDE.width - 1, WIDE.height - 1]], float)
    last = ROWS * COLUMNS
    assert cell_of(corners, WIDE, False).tolist() == [0, COLUMNS - 1, last - COLUMNS, last - 1]
    assert cell_of(corners, WIDE, True).tolist() == [last, last + COLUMNS - 1, 2 * last - COLUMNS, 2 * last - 1]
