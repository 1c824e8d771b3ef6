"""Ceiling heights from synthetic image lines and from the path-traced corridor."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from recon.geometry import Array, Pose3, rotation2
from recon.layout.heights import measure_ceiling
from recon.model import Layout, Room, Wall
from recon.sequence.camera import Camera
from recon.vision.frame import HORIZONTAL_1, OUTLIER, VERTICAL, FrameLines

CAMERA = Camera(640, 480, np.array([[500.0, 0, 319.5], [0, 500.0, 239.5], [0, 0, 1]]))
CORNERS = np.array([[0.0, 0.0], [9.0, 0.0], [9.0, 3.0], [0.0, 3.0]])


def room_layout() -> Layout:
    ends = zip(CORNERS, np.roll(CORNERS, -1, axis=0), strict=True)
    walls = tuple(Wall(i, a, b, 0.005, 0.001, "lidar", 20) for i, (a, b) in enumerate(ends))
    return Layout(walls, (Room(0, "room 1", CORNERS),))


def camera_pose(x: float, y: float, yaw: float, tilt: float = np.radians(3.0)) -> Pose3:
    optical = np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])
    down = np.array([[np.cos(tilt), 0, np.sin(tilt)], [0, 1, 0], [-np.sin(tilt), 0, np.cos(tilt)]])
    turn = np.eye(3)
    turn[:2, :2] = rotation2(yaw)
    return Pose3(turn @ down @ optical, np.array([x, y, 1.2]))


def edge_lines(pose: Pose3, edges: list[tuple[Array, int]], rng: np.random.Generator) -> FrameLines:
    """What a camera sees of edges (2, 3) with labels: cut to the image, 0.3 pixels of noise."""
    ends, labels = [], []
    for edge, label in edges:
        points = edge[0] + np.linspace(0, 1, 200)[:, None] * (edge[1] - edge[0])
        pixels = CAMERA.project(pose.inverse().apply(points))
        with np.errstate(invalid="ignore"):
            inside = np.flatnonzero(((pixels >= 0) & (pixels < [640, 480])).all(axis=1))
        if len(inside) > 1 and np.linalg.norm(pixels[inside[0]] - pixels[inside[-1]]) > 25:
            ends.append(pixels[inside[[0, -1]]] + rng.normal(0, 0.3, (2, 2)))
            labels.append(label)
    shape = np.array(ends).reshape(-1, 2, 2)
    sigmas = np.full(len(shape), 0.2)
    return FrameLines(shape, sigmas, np.array(labels, np.int64), np.full((3, 3), np.nan), np.zeros(0, np.int64))


def at_height(height: float, walls: tuple[int, ...] = (0, 1, 2, 3)) -> list[tuple[Array, int]]:
    out = []
    for i in walls:
        a, b = CORNERS[i], CORNERS[(i + 1) % 4]
        out.append((np.array([[*a, height], [*b, height]]), HORIZONTAL_1))
    return out


def door(wall: int, start: float, end: float, top: float) -> list[tuple[Array, int]]:
    a, b = CORNERS[wall], CORNERS[(wall + 1) % 4]
    d = (b - a) / np.linalg.norm(b - a)
    p, q = a + start * d, a + end * d
    uprights = [(np.array([[*foot, 0.0], [*foot, top]]), VERTICAL) for foot in (p, q)]
    return [(np.array([[*p, top], [*q, top]]), HORIZONTAL_1), *uprights]


def corner_uprights(height: float) -> list[tuple[Array, int]]:
    return [(np.array([[*c, 0.0], [*c, height]]), VERTICAL) for c in CORNERS]


def drive() -> list[Pose3]:
    return [camera_pose(0.8 + 0.25 * k, 1.2 + 0.02 * k, 0.15 * np.sin(k)) for k in range(16)]


def frames_of(edges: list[tuple[Array, int]], poses: list[Pose3]) -> list[FrameLines | None]:
    rng = np.random.default_rng(1)
    return [edge_lines(pose, edges, rng) for pose in poses]


@pytest.mark.parametrize("height", [2.4, 2.75, 3.3])
def test_ceiling_is_found_among_doors_and_boards(height: float) -> None:
    edges = (
        at_height(height) + corner_uprights(height) + door(0, 3, 4, 2.05) + door(2, 2, 3, 2.05) + door(1, 1, 2, 2.05)
    )
    edges += [(np.array([[*CORNERS[0] + [5.0, 0], 1.8], [*CORNERS[0] + [7.0, 0], 1.8]]), HORIZONTAL_1)]
    found, sigma = measure_ceiling(room_layout(), frames_of(edges, drive()), drive(), CAMERA)
    assert found is not None and sigma is not None
    assert abs(found - height) < 0.03 and 0.001 < sigma < 0.06


def test_doors_alone_tell_no_ceiling() -> None:
    edges = corner_uprights(2.7) + door(0, 3, 4, 2.2) + door(0, 5, 6, 2.2) + door(2, 2, 3, 2.2) + door(1, 1, 2, 2.2)
    assert measure_ceiling(room_layout(), frames_of(edges, drive()), drive(), CAMERA) == (None, None)


def test_lines_of_the_ceiling_itself_tell_no_height() -> None:
    """Rows of lamps: level, straight, and at no height on any wall."""
    lamps = [(np.array([[1.0, y, 2.7], [8.5, y, 2.7]]), OUTLIER) for y in (1.0, 1.6, 2.2)]
    found, _ = measure_ceiling(room_layout(), frames_of(lamps, drive()), drive(), CAMERA)
    assert found is None


def test_no_images_no_height() -> None:
    poses = drive()
    assert measure_ceiling(room_layout(), [None] * len(poses), poses, CAMERA) == (None, None)
    assert measure_ceiling(room_layout(), frames_of(at_height(2.6), poses), [None] * len(poses), CAMERA) == (None, None)
    assert measure_ceiling(Layout((), ()), frames_of(at_height(2.6), poses), poses, CAMERA) == (None, None)


def test_corridor_shows_its_ceiling(shared_data: Callable[[str], Path]) -> None:
    """43 path-traced images, tilted down: the ceiling, 2.6 m, is in view from 8.6 m on."""
    from recon.config import VisionConfig
    from recon.layout_file import read_layout
    from recon.sequence.extrinsics import read_extrinsics
    from recon.sequence.folder import read_sequence
    from recon.sequence.images import iterate_images
    from recon.sequence.tum import read_planar
    from recon.vision.frame_lines import detect_lines

    folder = shared_data("corridor")
    sequence, truth = read_sequence(folder), read_layout(folder / "groundtruth" / "layout.json")
    assert sequence.camera is not None and sequence.images is not None
    camera, chosen = sequence.camera, list(range(0, len(sequence.images), 2))
    mount = read_extrinsics(folder / "groundtruth" / "extrinsics.yaml")
    trajectory = read_planar(folder / "groundtruth" / "trajectory.txt")
    frames, poses = [], []
    for index, image in iterate_images(sequence.images, camera, grey=True, indices=chosen):
        assert image is not None
        frames.append(detect_lines(image, camera, VisionConfig(), 0))
        poses.append(Pose3.from_planar(trajectory.at(sequence.images.timestamps[index])[0]) @ mount)
    found, sigma = measure_ceiling(truth, frames, poses, camera)
    assert found == pytest.approx(2.6, abs=0.03) and sigma is not None and 0.01 < sigma < 0.06
