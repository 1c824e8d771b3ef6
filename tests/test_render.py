from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates
from two_rooms import QUADRANTS, corner, two_rooms

from recon.dollhouse import render_dollhouse
from recon.geometry import Pose3, rotation2
from recon.model import NEUTRAL_COLOURS, Layout, Model
from recon.occlusion import ambient_shades
from recon.render import render_model
from recon.sampling import FaceColours, sample_texture, uv_from_points
from recon.sequence.camera import Camera

PLATFORM_FROM_OPTICAL = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
MATRIX = np.array([[200.0, 0.0, 159.5], [0.0, 200.0, 119.5], [0.0, 0.0, 1.0]])
CAMERAS = {
    "ideal": Camera(320, 240, MATRIX),
    "barrel": Camera(320, 240, MATRIX, "plumb_bob", np.array([-0.25, 0.05, 0.001, -0.002, 0.0])),
    "fisheye": Camera(320, 240, MATRIX, "equidistant", np.array([0.02, -0.01, 0.002, 0.0])),
}


def looking(position: list[float], yaw: float) -> Pose3:
    """map_from_camera of a level camera."""
    turn = np.eye(3)
    turn[:2, :2] = rotation2(yaw)
    return Pose3(turn @ PLATFORM_FROM_OPTICAL, np.array(position))


@pytest.mark.parametrize("name", CAMERAS)
def test_a_camera_sees_textures_where_they_project(name: str) -> None:
    model, camera = two_rooms(), CAMERAS[name]
    pose = looking([3.0, 1.9, 1.25], -np.pi / 2 + 0.05)  # toward wall_000
    picture = render_model(model, camera, pose)
    assert picture.shape == (240, 320, 3)
    wall = next(f for f in model.faces if f.name == "wall_000")
    centre = wall.vertices.mean(axis=0)
    for quarter, expected in QUADRANTS.items():
        point = centre + 0.3 * (corner(wall, quarter) - centre)
        ((u, v),) = np.rint(camera.project(pose.inverse().apply(point[None]))).astype(int)
        np.testing.assert_allclose(picture[v, u], expected, atol=2)


def test_background_and_neutral_colours() -> None:
    model = two_rooms(textured=False)
    outside = render_model(model, CAMERAS["ideal"], looking([20.0, 0.0, 1.0], 0.0), background=(1, 2, 3))
    assert np.all(outside == [1, 2, 3])
    inside = render_model(model, CAMERAS["ideal"], looking([3.0, 1.0, 1.25], 0.0))
    assert tuple(inside[120, 160]) == NEUTRAL_COLOURS["wall"]
    nothing = render_model(Model("empty", Layout((), ()), ()), CAMERAS["ideal"], looking([0, 0, 0], 0.0))
    assert np.all(nothing == 255)


def test_edges_are_smooth() -> None:
    model = two_rooms(textured=False)
    picture = render_model(model, CAMERAS["ideal"], looking([1.0, 1.0, 1.25], 0.2)).reshape(-1, 3)
    neutral = np.array([NEUTRAL_COLOURS[kind] for kind in ("wall", "floor", "ceiling")])
    between = ~(picture[:, None] == neutral).all(axis=2).any(axis=1)
    assert 0.001 < between.mean() < 0.05
    assert picture.min(axis=0) == pytest.approx(neutral.min(axis=0))
    assert picture.max(axis=0) == pytest.approx(neutral.max(axis=0))


@settings(max_examples=30, deadline=None)
@given(st.integers(1, 7), st.integers(1, 7), st.integers(0, 2**32 - 1))
def test_bilinear_sampling_is_scipys(height: int, width: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    texture = rng.integers(0, 256, (height, width, 3), dtype=np.uint8)
    uv = rng.uniform(-0.1, 1.1, (50, 2))
    rows, columns = (1 - uv[:, 1]) * height - 0.5, uv[:, 0] * width - 0.5
    channels = [
        map_coordinates(texture[..., c].astype(float), [rows, columns], order=1, mode="nearest") for c in range(3)
    ]
    np.testing.assert_allclose(sample_texture(texture, uv), np.stack(channels, axis=1), atol=1e-2)


def test_uv_comes_back_from_points() -> None:
    for face in two_rooms().faces:
        uv_map = uv_from_points(face)
        found = np.column_stack([face.vertices, np.ones(len(face.vertices))]) @ uv_map
        np.testing.assert_allclose(found, face.uv, atol=1e-9)
        assert (
            np.abs(face.normal @ uv_map[:3]).max() < 1e-12
        )  # lengths in the plane, whatever the distance to the origin


def test_coarse_sampling_averages() -> None:
    face = next(f for f in two_rooms().faces if f.name == "wall_000")
    assert face.texture is not None
    noise = np.random.default_rng(3).integers(0, 256, face.texture.shape, dtype=np.uint8)
    noisy = FaceColours(dataclasses.replace(face, texture=noise))
    points = face.vertices.mean(axis=0) + np.random.default_rng(4).uniform(-0.5, 0.5, (200, 1)) * [1.0, 0.0, 1.0]
    fine, coarse = noisy.at(points, 0.02), noisy.at(points, 0.64)
    assert fine.std() > 40
    assert coarse.std() < 8
    np.testing.assert_allclose(coarse.mean(axis=0), noise.reshape(-1, 3).mean(axis=0), atol=4)


def test_corners_are_darker_than_open_floor() -> None:
    model = two_rooms()
    floor = next(f for f in model.faces if f.name == "floor_001")
    (shade,) = ambient_shades((floor,), tuple(f for f in model.faces if f.kind != "ceiling"))
    middle, edge, inner_corner = shade(np.array([[4.1, 3.6, 0.0], [4.1, 2.25, 0.0], [2.25, 2.25, 0.0]]))
    assert 1 >= middle > edge + 0.1 > inner_corner + 0.1
    assert inner_corner > 0.3
    (alone,) = ambient_shades((floor,), (floor,))
    assert alone(np.array([[4.1, 3.6, 0.0]])) == pytest.approx(1.0)


def recoloured(model: Model, kind: str, colour: tuple[int, int, int]) -> Model:
    texture = np.full((8, 8, 3), colour, np.uint8)
    faces = tuple(dataclasses.replace(f, texture=texture) if f.kind == kind else f for f in model.faces)
    return dataclasses.replace(model, faces=faces)


def share(picture: NDArray[np.uint8], colour: tuple[int, int, int]) -> float:
    """Share of pixels of a hue: direction in RGB within a few degrees, so that shading does not matter."""
    p = picture.reshape(-1, 3).astype(float)
    cosine = p @ np.array(colour) / (np.linalg.norm(p, axis=1) * np.linalg.norm(colour) + 1e-9)
    return float(np.mean(cosine > 0.995))


def test_dollhouse_looks_into_the_rooms_from_above() -> None:
    model = recoloured(recoloured(two_rooms(), "ceiling", (255, 0, 255)), "floor", (0, 160, 40))
    picture = render_dollhouse(model, size=(400, 300))
    assert picture.shape == (300, 400, 3)
    assert np.all(picture[[0, 0, -1, -1], [0, -1, 0, -1]] > 235)  # white around it
    assert share(picture, (255, 0, 255)) == 0  # no ceiling
    assert share(picture, (0, 160, 40)) > 0.1
    assert all(share(picture, colour) > 0.005 for colour in QUADRANTS.values())  # walls toward the viewer
    middle = np.abs(picture.astype(int) - 255).sum(axis=2) > 60
    rows, columns = np.nonzero(middle)
    assert 0.75 < max(np.ptp(rows) / 300, np.ptp(columns) / 400) < 0.95
    np.testing.assert_array_equal(picture, render_dollhouse(model, size=(400, 300)))


def test_dollhouse_without_texture_rooms_or_anything() -> None:
    bare = two_rooms(textured=False)
    assert render_dollhouse(bare, size=(200, 150)).std() > 20
    walls_only = dataclasses.replace(bare, layout=dataclasses.replace(bare.layout, rooms=()))
    assert render_dollhouse(walls_only, size=(200, 150)).std() > 20
    assert np.all(render_dollhouse(Model("empty", Layout((), ()), ()), size=(64, 48)) == 255)
