"""Ceiling heights from synthetic image lines and from the path-traced corridor."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from recon.faces import extrude
from recon.geometry import Array, Pose3, rotation2
from recon.layout.heights import measure_heights
from recon.model import Layout, Opening, Room, Wall
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
    layout = measure_heights(room_layout(), frames_of(edges, drive()), drive(), CAMERA)
    found, sigma = layout.ceiling_height, layout.sigma_ceiling
    assert found is not None and sigma is not None
    assert abs(found - height) < 0.03 and 0.001 < sigma < 0.06


def test_doors_alone_tell_no_ceiling() -> None:
    edges = corner_uprights(2.7) + door(0, 3, 4, 2.2) + door(0, 5, 6, 2.2) + door(2, 2, 3, 2.2) + door(1, 1, 2, 2.2)
    assert measure_heights(room_layout(), frames_of(edges, drive()), drive(), CAMERA).ceiling_height is None


def test_lines_of_the_ceiling_itself_tell_no_height() -> None:
    """Rows of lamps: level, straight, and at no height on any wall."""
    lamps = [(np.array([[1.0, y, 2.7], [8.5, y, 2.7]]), OUTLIER) for y in (1.0, 1.6, 2.2)]
    assert measure_heights(room_layout(), frames_of(lamps, drive()), drive(), CAMERA).ceiling_height is None


def test_without_a_ceiling_walls_are_as_high_as_they_are_seen() -> None:
    """A camera 1.2 m up that sees 14 degrees above level is shown 3.0 m from 7 m away, without an edge; one that is
    tilted more is not shown 2.6 m. What sees no edge up to 4 m sees none at all."""
    boards = door(0, 3, 4, 2.2) + corner_uprights(3.4)
    default = room_layout().default_ceiling_height
    for tilt, low, high in ((0.2, 2.75, 3.3), (0.4, default, default), (0.05, default, default)):
        poses = [camera_pose(0.8 + 0.25 * k, 1.2 + 0.02 * k, 0.0, tilt) for k in range(16)]
        layout = measure_heights(room_layout(), frames_of(boards, poses), poses, CAMERA)
        assert layout.ceiling_height is None and low <= layout.default_ceiling_height <= high


def test_an_edge_too_short_for_a_ceiling_may_be_one() -> None:
    """Half of one wall shows an edge at 2.9 m: nothing is claimed, and nothing is built above it."""
    edges = [(np.array([[*CORNERS[1], 2.9], [*(CORNERS[1] + [0.0, 1.2]), 2.9]]), HORIZONTAL_1)]
    layout = measure_heights(room_layout(), frames_of(edges, drive()), drive(), CAMERA)
    assert layout.ceiling_height is None and layout.default_ceiling_height <= 2.95


def opening(id_: int, wall: int, start: float, end: float) -> Opening:
    a, b = CORNERS[wall], CORNERS[(wall + 1) % 4]
    d = (b - a) / np.linalg.norm(b - a)
    return Opening(id_, "door", wall, a + start * d, a + end * d, 0.0, 2.0)


def test_heads_of_doors_are_measured() -> None:
    """Casings 6 cm above the heads stand 3 cm before the wall, and wander; the third door is never seen."""
    tops = (2.05, 2.21)
    edges = at_height(2.75) + corner_uprights(2.75) + door(0, 6, 7, tops[0]) + door(1, 1, 2, tops[1])
    edges.append((np.array([[5.94, 0.03, tops[0] + 0.06], [7.06, 0.03, tops[0] + 0.06]]), HORIZONTAL_1))
    openings = (opening(0, 0, 6, 7), opening(1, 1, 1, 2), opening(2, 3, 1, 2))
    seen = replace(room_layout(), openings=openings)
    found = measure_heights(seen, frames_of(edges, drive()), drive(), CAMERA).openings
    for one, top in zip(found[:2], tops, strict=True):
        assert one.top == pytest.approx(top, abs=0.015)
        assert one.sigma_top is not None and 0.002 < one.sigma_top < 0.05
    assert found[2].sigma_top is None and found[2].top == pytest.approx(sum(tops) / 2, abs=0.02)


def test_rooms_have_ceilings_of_their_own() -> None:
    """Two halls, one after the other, the second 0.5 m lower; the path leads through both."""
    shift, move = np.array([12.0, 0.0]), np.array([12.0, 0.0, 0.0])
    one = room_layout()
    walls = tuple(replace(w, id=w.id + 4, start=w.start + shift, end=w.end + shift) for w in one.walls)
    both = Layout(one.walls + walls, (*one.rooms, Room(1, "room 2", CORNERS + shift)))
    first, second = drive(), [Pose3(p.rotation, p.translation + move) for p in drive()]
    edges = at_height(2.5) + corner_uprights(2.5)
    moved = [(points + move, label) for points, label in edges]
    frames = frames_of(at_height(3.0) + corner_uprights(3.0), first) + frames_of(moved, second)
    found = measure_heights(both, frames, first + second, CAMERA)
    assert [room.ceiling_height for room in found.rooms] == [pytest.approx(3.0, abs=0.03), pytest.approx(2.5, abs=0.03)]
    assert all(room.sigma_ceiling is not None and 0.001 < room.sigma_ceiling < 0.06 for room in found.rooms)
    heights = {face.ref: np.ptp(face.vertices[:, 2]) for face in extrude(found) if face.kind == "wall"}
    wanted = [room.ceiling_height for room in found.rooms for _ in range(4)]
    assert [heights[k] for k in range(8)] == pytest.approx(wanted, abs=1e-5)


def test_no_images_no_height() -> None:
    poses = drive()
    layout, frames = room_layout(), frames_of(at_height(2.6), poses)
    assert measure_heights(layout, [None] * len(poses), poses, CAMERA) is layout
    assert measure_heights(layout, frames, [None] * len(poses), CAMERA) is layout
    assert measure_heights(Layout((), ()), frames, poses, CAMERA).ceiling_height is None


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
    layout = measure_heights(truth, frames, poses, camera)
    sigma = layout.sigma_ceiling
    assert layout.ceiling_height == pytest.approx(2.6, abs=0.03) and sigma is not None and 0.01 < sigma < 0.06
