"""What no image saw of a face: what repeats goes on, what is there once does not."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from recon.texture.render import fill_unseen
from recon.texture.repeats import likeness, moves

Picture = NDArray[np.uint8]
Mask = NDArray[np.bool_]
SHAPE = (480, 640)
WALL, SKIRTING = (190, 200, 210), (60, 50, 40)


def filled(picture: Picture, seen: Mask, upright: bool) -> NDArray[np.float64]:
    """The picture, of which the rest was not seen, filled."""
    out = np.where(seen[..., None], picture, 0).astype(np.uint8)
    fill_unseen(out, np.where(seen, 255, 0).astype(np.uint8), np.ones(SHAPE, bool), upright)
    assert np.array_equal(out[seen], picture[seen]), "what was seen stays"
    return out.astype(np.float64)


def checkerboard(side: float, dark: int, light: int, angle: float = 0.0) -> Picture:
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]].astype(np.float64)
    u, v = x * np.cos(angle) + y * np.sin(angle), y * np.cos(angle) - x * np.sin(angle)
    odd = (np.floor(u / side) + np.floor(v / side)) % 2
    return np.repeat(np.where(odd, light, dark).astype(np.uint8)[..., None], 3, axis=2)


def noisy(picture: Picture, seed: int, sigma: float = 3.0) -> Picture:
    noise = np.random.default_rng(seed).normal(0, sigma, picture.shape)
    return np.clip(np.rint(picture + noise), 0, 255).astype(np.uint8)


@given(st.integers(0, 2**31), st.integers(3, 9), st.integers(3, 9))
@settings(max_examples=15, deadline=None)
def test_likeness_is_what_sums_say(seed: int, rows: int, columns: int) -> None:
    rng = np.random.default_rng(seed)
    detail = rng.normal(0, 20, (rows, columns, 3)).astype(np.float32)
    known = rng.random((rows, columns)) < 0.8
    score = likeness(detail, known)
    dy, dx = int(rng.integers(-rows + 1, rows)), int(rng.integers(-columns + 1, columns))
    pairs = [
        (detail[i, j].astype(float), detail[i + dy, j + dx].astype(float))
        for i in range(max(0, -dy), min(rows, rows - dy))
        for j in range(max(0, -dx), min(columns, columns - dx))
        if known[i, j] and known[i + dy, j + dx]
    ]
    expected = -1.0
    if len(pairs) > 0.25 * known.sum():
        expected = 2 * sum(float(a @ b) for a, b in pairs) / sum(float(a @ a + b @ b) for a, b in pairs)
    assert score[dy + rows - 1, dx + columns - 1] == pytest.approx(expected, abs=1e-3)


@pytest.mark.parametrize(("side", "angle"), [(48, 0.0), (61, 0.0), (56, 0.3)])
def test_tiles_go_on(side: float, angle: float) -> None:
    """Whatever the tiles' size and angle to the picture: half a floor is known, a metre beyond it is right."""
    truth = checkerboard(side, 90, 170, angle)
    seen = np.zeros(SHAPE, bool)
    seen[:, :400] = True
    beyond = np.s_[20:-20, 410:600]
    got = filled(noisy(truth, 1), seen, upright=False)[beyond].mean(axis=2)
    light = truth[beyond][..., 0] > 130
    assert np.mean((got > 130) == light) > 0.9
    assert got[light].mean() - got[~light].mean() == pytest.approx(80, abs=25)


def test_skirting_goes_on_and_a_poster_does_not() -> None:
    wall = np.full((*SHAPE, 3), WALL, np.uint8)
    wall[-22:] = SKIRTING
    wall[150:330, 60:240] = (30, 30, 220)
    wall = noisy(wall, 2)
    seen = np.zeros(SHAPE, bool)
    seen[60:, :420] = True
    beyond = filled(wall, seen, upright=True)[:, 480:].mean(axis=1)
    assert beyond[-18:-2].mean(axis=0) == pytest.approx(SKIRTING, abs=15)
    assert np.abs(beyond[:-40] - WALL).max() < 15, "nothing red at the poster's height, no edge where images ended"


def test_what_does_not_repeat_is_not_made_up() -> None:
    rng = np.random.default_rng(3)
    blobs = cv2.GaussianBlur(rng.normal(size=(*SHAPE, 3)), (0, 0), 12)
    stains = np.clip(128 + 40 * blobs / blobs.std(), 0, 255).astype(np.uint8)
    seen = np.ones(SHAPE, bool)
    seen[:, 500:] = False
    assert filled(stains, seen, upright=False)[:, 560:].std() < 0.4 * stains.std()
    assert not len(moves(np.zeros((30, 40, 3), np.float32), np.ones((30, 40), bool)))


@pytest.mark.parametrize("upright", [True, False])
def test_one_lamp_in_a_corner_makes_no_rows_of_lamps(upright: bool) -> None:
    """A small seen part says nothing about the rest, far from it."""
    ceiling = np.full((*SHAPE, 3), 150, np.uint8)
    ceiling[20:40, 20:160] = 250
    seen = np.zeros(SHAPE, bool)
    seen[:120, :200] = True
    got = filled(noisy(ceiling, 4), seen, upright)
    assert got[200:, 300:] == pytest.approx(np.full((280, 340, 3), 150), abs=35)
