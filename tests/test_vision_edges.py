"""Edges and segments against steps whose place is known, and the undistortion table against the camera model."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.special import erf
from vision_scene import fisheye, pinhole

from recon.config import VisionConfig
from recon.errors import ConfigError
from recon.geometry import Array
from recon.sequence.camera import Camera
from recon.vision.edges import find_edges
from recon.vision.frame_lines import detect_lines
from recon.vision.lines import fit_segments
from recon.vision.rectify import rectifier, stretch_at

SIZE = 160
PLAIN = Camera(SIZE, SIZE, np.array([[200.0, 0, 80], [0, 200, 80], [0, 0, 1]]))


def step_image(
    angle: float, offset: float, contrast: float = 90.0, noise: float = 2.0
) -> tuple[NDArray[np.uint8], Array]:
    """A blurred edge through the middle, moved by `offset` px along its unit normal (2,), which points to bright."""
    normal = np.array([-np.sin(angle), np.cos(angle)])
    v, u = np.mgrid[:SIZE, :SIZE]
    distance = (u - SIZE / 2) * normal[0] + (v - SIZE / 2) * normal[1] - offset
    image = 60 + contrast * 0.5 * (1 + erf(distance / (0.67 * np.sqrt(2))))
    image += np.random.default_rng(0).normal(0, noise, image.shape)
    return np.clip(np.round(image), 0, 255).astype(np.uint8), normal


@settings(max_examples=40, deadline=None)
@given(st.floats(0, 2 * np.pi), st.floats(-1, 1))
def test_a_step_is_found_to_a_twentieth_of_a_pixel(angle: float, offset: float) -> None:
    image, normal = step_image(angle, offset)
    frame = detect_lines(image, PLAIN, VisionConfig(), 0)
    off = (frame.endpoints[0] - SIZE / 2) @ normal - offset
    assert np.abs(off).max() < 0.05
    assert frame.lengths[0] > 0.9 * SIZE
    direction = frame.endpoints[0, 1] - frame.endpoints[0, 0]
    assert direction[0] * normal[1] - direction[1] * normal[0] > 0  # the bright side is on the right hand


@pytest.mark.parametrize("angle", [0.0, 0.3, 1.2, np.pi / 2, 2.0, 3.5, 5.0])
def test_lsd_has_no_offset(angle: float) -> None:
    offs = []
    for offset in np.linspace(-0.9, 0.9, 10):
        image, normal = step_image(angle, offset)
        frame = detect_lines(image, PLAIN, VisionConfig(detector="lsd"), 0)
        offs.append(((frame.endpoints[0] - SIZE / 2) @ normal - offset).mean())
        direction = frame.endpoints[0, 1] - frame.endpoints[0, 0]
        assert direction[0] * normal[1] - direction[1] * normal[0] > 0
    assert abs(np.mean(offs)) < 0.06


def test_the_scatter_of_edge_points_follows_the_noise() -> None:
    """Twice the noise, about twice the standard deviation of the fit."""
    sigma = [detect_lines(step_image(0.4, 0.2, noise=n)[0], PLAIN, VisionConfig(), 0).sigmas[0] for n in (4.0, 8.0)]
    assert 1.5 < sigma[1] / sigma[0] < 2.6
    assert 0.04 < sigma[0] < 0.15


@pytest.mark.parametrize("exposure", [0.3, 1.0, 1.6])
def test_edges_do_not_depend_on_exposure(exposure: float) -> None:
    image = step_image(0.4, 0.2, contrast=60.0, noise=0.0)[0] * exposure
    noisy = image + np.random.default_rng(1).normal(0, 2 * exposure, image.shape)
    frame = detect_lines(np.clip(noisy, 0, 255).astype(np.uint8), PLAIN, VisionConfig(), 0)
    assert len(frame) <= 3
    assert frame.lengths[0] > 0.9 * SIZE


def test_noise_alone_has_hardly_any_lines() -> None:
    image = np.random.default_rng(0).normal(120, 12, (240, 320)).clip(0, 255).astype(np.uint8)
    camera = Camera(320, 240, np.array([[300.0, 0, 160], [0, 300, 120], [0, 0, 1]]))
    assert len(detect_lines(image, camera, VisionConfig(), 0)) <= 2


def test_chains_end_at_junctions() -> None:
    """A T of three regions: three chains that meet, none running through the junction."""
    image = np.full((120, 120), 60, np.uint8)
    image[:60, :60], image[:60, 60:] = 120, 200
    chains = find_edges(image)
    assert len(chains) == 3
    ends = [chains.points[i] for c in range(3) for i in (chains.starts[c], chains.starts[c + 1] - 1)]
    assert sum(np.linalg.norm(e - 59.5) < 3 for e in ends) == 3


def test_broken_line_is_merged_and_parallel_lines_are_not() -> None:
    image = np.full((120, 200), 150, np.uint8)
    image[60:] = 80
    image[56:64, 90:96] = 110  # something small before the edge
    image[20:23] = 70  # a thin dark line has two edges
    camera = Camera(200, 120, PLAIN.matrix)
    frame = detect_lines(image, camera, VisionConfig(), 0)
    rows = np.sort(frame.endpoints[frame.lengths > 180].mean(axis=1)[:, 1])
    assert rows == pytest.approx([19.5, 22.5, 59.5], abs=0.6)


def test_a_polygon_is_split_at_its_corners() -> None:
    square = np.array([[0, 0], [100, 0], [100, 60], [0, 60], [0, 0.0]])
    points = np.concatenate([np.linspace(a, b, 120) for a, b in itertools.pairwise(square)])
    gradients = np.repeat([[0, 1], [-1, 0], [0, -1], [1, 0.0]], 120, axis=0)
    found = fit_segments(points, gradients, np.array([0, 480]), np.ones(480), 20.0, 0.05)
    assert np.sort(np.linalg.norm(found.endpoints[:, 1] - found.endpoints[:, 0], axis=1)) == pytest.approx(
        [60, 60, 100, 100], abs=1.5
    )


@pytest.mark.parametrize(
    "camera",
    [
        pinhole(distorted=True),
        fisheye(),
        Camera(320, 240, np.array([[260.0, 0, 160], [0, 262, 118], [0, 0, 1]]), "rational_polynomial",
               np.array([0.3, -0.1, 0.001, 0.0, 0.01, 0.5, -0.1, 0.0])),
    ],
    ids=["plumb_bob", "equidistant", "rational_polynomial"],
)  # fmt: skip
def test_rectifier_agrees_with_the_lens_model(camera: Camera) -> None:
    """Projecting the rectified points leads back to the raw ones; the stretch is the map's own."""
    rng = np.random.default_rng(0)
    raw = rng.uniform([0, 0], [camera.width - 1, camera.height - 1], (4000, 2))
    rectified, stretch = rectifier(camera)(raw)
    seen = np.isfinite(stretch)
    assert 0.5 < seen.mean() <= 1.0
    rays = np.concatenate([rectified[seen], np.ones((seen.sum(), 1))], axis=1) @ np.linalg.inv(camera.matrix).T
    back = camera.project(rays)
    assert np.abs(back - raw[seen]).max() < 0.15
    assert np.median(np.abs(back - raw[seen])) < 0.01
    off_axis = np.rad2deg(np.arctan(np.linalg.norm(rays[:, :2], axis=1)))
    assert off_axis.max() < 81
    assert stretch[seen] == pytest.approx(stretch_at(camera, rectified[seen]), rel=0.1)


def test_unknown_detector_is_an_error() -> None:
    with pytest.raises(ConfigError, match=r'"hough".*"canny" or "lsd"'):
        detect_lines(np.zeros((40, 40), np.uint8), PLAIN, VisionConfig(detector="hough"), 0)  # type: ignore[arg-type]


@pytest.mark.parametrize("config", [VisionConfig(detector="canny"), VisionConfig(detector="lsd")])
@pytest.mark.parametrize("shape", [(160, 160), (160, 160, 3), (8, 160)])
def test_a_bare_wall_gives_an_empty_frame(shape: tuple[int, ...], config: VisionConfig) -> None:
    frame = detect_lines(np.full(shape, 130, np.uint8), PLAIN, config, 0)
    assert len(frame) == 0
    assert frame.endpoints.shape == (0, 2, 2)
    assert np.isnan(frame.directions).all()
    assert len(frame.boundary) == 0
