"""ROS bags, written by the writers of `rosbags` from a room of known size: what is read must lie on its walls."""

from __future__ import annotations

import tempfile
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
from bag_drive import (
    CAMERA,
    HEIGHT,
    IMAGE_PERIOD,
    KINDS,
    START,
    WIDTH,
    Drive,
    Mounting,
    off_walls,
    pose,
    read,
    turned,
    upside_down,
    write_bag,
)
from hypothesis import given, settings
from hypothesis import strategies as st

from recon.geometry import apply2, compose2
from recon.sequence.folder import read_sequence
from recon.sequence.images import load_image
from recon.sequence.open import open_sequence
from recon.sequence.sequence import Sequence
from recon.sequence.tf import TransformTree
from recon.sequence.topics import Topics
from recon.sequence.write import write_sequence


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_bag(kind: str, tmp_path: Path) -> None:
    drive = Drive(images=3, camera=CAMERA, floor=0.05)
    sequence = open_sequence(write_bag(drive, tmp_path, kind))
    assert sequence.warnings == ()
    assert sequence.name == "drive"
    np.testing.assert_allclose(sequence.scans.timestamps, drive.times() * 1e-9, atol=1e-6)
    assert off_walls(sequence) < 1e-4
    assert sequence.images is not None and sequence.camera is not None
    np.testing.assert_allclose(sequence.images.timestamps, (START + IMAGE_PERIOD * np.arange(3)) * 1e-9, atol=1e-6)
    for i in range(3):
        np.testing.assert_array_equal(load_image(sequence.images, i, sequence.camera), drive.picture(i))
    np.testing.assert_array_equal(sequence.camera.matrix, [[30, 0, 15.5], [0, 30, 11.5], [0, 0, 1]])
    np.testing.assert_allclose(sequence.camera.distortion, [-0.1, 0.02, 0.0005, -0.0004, 0])
    assert sequence.platform_from_camera is not None
    np.testing.assert_allclose(sequence.platform_from_camera.translation, [0.12, 0.03, 0.55], atol=1e-9)
    np.testing.assert_allclose(sequence.platform_from_camera.rotation, pose(CAMERA).rotation, atol=1e-9)


@given(x=st.floats(-0.5, 0.5), y=st.floats(-0.5, 0.5), yaw=st.floats(-3.1, 3.1), flipped=st.booleans())
@settings(max_examples=10, deadline=None)
def test_any_level_mounting_of_the_scanner(x: float, y: float, yaw: float, flipped: bool) -> None:
    """Turned, upside down, off the middle: beams counter-clockwise, platform x forward, odometry at the scanner."""
    laser = (upside_down if flipped else turned)(x, y, yaw)
    sequence = read(Drive(scans=4, laser=laser, camera=CAMERA, floor=0.1, images=1), "mcap")
    assert sequence.scans.angle_increment > 0
    assert off_walls(sequence) < 1e-4
    assert sequence.odometry is not None
    expected = compose2(Drive().base(START), np.array([x, y, 0.0]))
    np.testing.assert_allclose(sequence.odometry.poses[0], expected, atol=1e-6)
    assert sequence.platform_from_camera is not None
    np.testing.assert_allclose(sequence.platform_from_camera.translation, [0.12 - x, 0.03 - y, 0.6], atol=1e-9)


def test_sweep_of_a_scanner_upside_down_takes_its_time() -> None:
    """Its first beam in time is the last one counter-clockwise."""

    def change(topic: str, message: Any) -> None:
        if topic == "/scan":
            message.time_increment = 0.001

    scans = read(Drive(laser=upside_down(0, 0, 0), change=change)).scans
    assert scans.time_increment == pytest.approx(-0.001)
    assert scans.timestamps[0] == pytest.approx(START * 1e-9 + 0.089, abs=1e-6)


@pytest.mark.parametrize(
    "encoding", ["mono8", "bgr8", "rgb8", "bgra8", "rgba8", "mono16", "jpeg", "png", *(f"bayer_{p}8" for p in
    ("rggb", "bggr", "gbrg", "grbg"))]
)  # fmt: skip
def test_encodings(encoding: str, tmp_path: Path) -> None:
    """What can be exact is; mosaics and JPEG come close (the picture is smooth)."""
    drive = Drive(images=2, encoding=encoding)
    sequence = open_sequence(write_bag(drive, tmp_path, "db3"))
    assert sequence.images is not None and sequence.camera is not None
    truth = drive.picture(1)
    if encoding.startswith("mono"):
        truth = cv2.cvtColor(cv2.cvtColor(truth, cv2.COLOR_BGR2GRAY), cv2.COLOR_GRAY2BGR)
    picture = load_image(sequence.images, 1, sequence.camera)
    assert picture is not None and picture.shape == (HEIGHT, WIDTH, 3) and picture.dtype == np.uint8
    off = np.abs(picture.astype(int) - truth.astype(int))
    if encoding == "jpeg" or encoding.startswith("bayer"):
        assert off[2:-2, 2:-2].max() <= 12
    else:
        assert off.max() == 0
    grey = load_image(sequence.images, 1, sequence.camera, grey=True)
    assert grey is not None and grey.shape == (HEIGHT, WIDTH)


def test_memory_does_not_grow_with_the_number_of_images() -> None:
    def larger(topic: str, message: Any) -> None:
        if topic.startswith("/cam/"):
            message.width, message.height = 640, 480
        if topic == "/cam/image_raw":
            message.step, message.data = 640, np.full(640 * 480, 7, np.uint8)

    def peak(images: int) -> int:
        with tempfile.TemporaryDirectory() as folder:
            path = write_bag(Drive(images=images, encoding="mono8", change=larger), Path(folder))
            tracemalloc.start()
            sequence = open_sequence(path)
            assert sequence.images is not None and len(sequence.images) == images
            assert all(len(sequence.images.read(i)) == 480 for i in range(images))
            _, most = tracemalloc.get_traced_memory()
            tracemalloc.stop()
            return most

    peak(5)  # imports
    assert peak(110) - peak(10) < 20 * 640 * 480  # of the 100 images that were added


@pytest.mark.parametrize("encoding", ["rgb8", "jpeg"])
def test_convert_loses_nothing(encoding: str, tmp_path: Path, run_recon: Any) -> None:
    drive = Drive(images=3, camera=CAMERA, floor=0.0, encoding=encoding, laser=upside_down(0.2, 0.1, 1.0))
    bag = write_bag(drive, tmp_path, "mcap")
    result = run_recon("convert", bag, "-o", tmp_path / "seq")
    assert result.status == 0
    direct, folder = open_sequence(bag), read_sequence(tmp_path / "seq")
    np.testing.assert_array_equal(folder.scans.ranges, direct.scans.ranges)
    np.testing.assert_array_equal(folder.scans.timestamps, direct.scans.timestamps)
    np.testing.assert_array_equal(folder.scans.bearings, direct.scans.bearings)
    assert folder.odometry is not None and direct.odometry is not None
    np.testing.assert_allclose(folder.odometry.poses, direct.odometry.poses, atol=2e-6)
    assert folder.images is not None and direct.images is not None and folder.camera is not None
    assert folder.images.names == direct.images.names
    np.testing.assert_allclose(folder.images.timestamps, direct.images.timestamps, atol=1e-6)
    for i in range(3):
        here, there = (load_image(images, i, folder.camera) for images in (folder.images, direct.images))
        np.testing.assert_array_equal(here, there)
    assert direct.camera is not None
    np.testing.assert_array_equal(folder.camera.matrix, direct.camera.matrix)
    assert folder.platform_from_camera is not None and direct.platform_from_camera is not None
    np.testing.assert_allclose(folder.platform_from_camera.matrix(), direct.platform_from_camera.matrix(), atol=1e-6)
    again = run_recon("convert", bag, "-o", tmp_path / "seq")
    assert again.status == 2
    assert "new or empty folder" in again.errors[0]
    write_sequence(folder, tmp_path / "copy")
    for file in ("scans.npz", "images.txt", "images/000001.jpg" if encoding == "jpeg" else "images/000001.png"):
        assert (tmp_path / "copy" / file).read_bytes() == (tmp_path / "seq" / file).read_bytes()


def test_odometry_from_the_transforms() -> None:
    laser = turned(0.2, -0.1, 0.7)
    sequence = read(Drive(odometry="tf", laser=laser))
    assert sequence.odometry is not None and len(sequence.odometry) == 20
    assert off_walls(sequence) < 1e-4
    assert read(Drive(odometry="none")).odometry is None
    for odometry in ("tf", "topic"):
        assert read(Drive(odometry=odometry), topics=Topics(odometry="none")).odometry is None


def test_an_empty_child_frame_is_the_base() -> None:
    def change(topic: str, message: Any) -> None:
        if topic == "/odom":
            message.child_frame_id = ""

    assert off_walls(read(Drive(laser=turned(0.3, 0.1, -2.0), change=change))) < 1e-4


def test_frames_missing_in_the_tree_are_said() -> None:
    def no_tree(topic: str, _message: Any) -> bool:
        return topic != "/tf_static"

    sequence = read(Drive(change=no_tree))  # the laser happens to be at the base
    said = [w for w in sequence.warnings if "scanner (laser) is mounted" in w]
    assert len(said) == 1 and "taken as upright and looking forward" in said[0]
    assert any("base_link (/odom)" in w for w in sequence.warnings)
    assert off_walls(sequence) < 1e-4

    def other_frame(topic: str, message: Any) -> None:
        if topic == "/scan":
            message.header.frame_id = "hokuyo"

    sequence = read(Drive(change=other_frame))
    assert any("base_link, laser" in w and "hokuyo" in w for w in sequence.warnings)


def test_camera_height_is_taken_only_from_the_floor(tmp_path: Path) -> None:
    unknown = read(Drive(images=1, camera=CAMERA))
    assert unknown.platform_from_camera is None
    assert any("base_footprint" in w and "estimated" in w for w in unknown.warnings)
    missing = read(Drive(images=1, floor=0.1))
    assert missing.platform_from_camera is None
    assert any("camera's frame camera" in w for w in missing.warnings)
    body: Mounting = (CAMERA[0], (0.0, 0.0, 0.0, 1.0))
    turned_right = read(Drive(images=1, camera=body, floor=0.1))
    assert turned_right.platform_from_camera is not None
    np.testing.assert_allclose(turned_right.platform_from_camera.rotation, pose(CAMERA).rotation, atol=1e-9)
    assert any("not as an optical frame" in w for w in turned_right.warnings)


def test_a_mounting_that_is_said_over_and_over_is_fixed_and_one_that_moves_is_none() -> None:
    stamp: Any = SimpleNamespace(header=0, recorded=0)
    tree = TransformTree()
    for i in range(5):
        tree.add("base_link", "laser", (0.1, 0.0, 0.3), (0.0, 0.0, 0.0, 1.0), stamp)
        tree.add("base_link", "tilting", (0.0, 0.0, 0.1 * i), (0.0, 0.0, 0.0, 1.0), stamp)
    fixed = tree.mounting("laser", "base_link")
    assert fixed is not None
    np.testing.assert_allclose(fixed.translation, [-0.1, 0, -0.3])
    assert tree.mounting("base_link", "tilting") is None
    assert tree.base_of("laser") == "base_link"


def test_frames_that_move_together_are_mounted_on_each_other() -> None:
    """base_link and base_footprint are often both said from odom."""
    tree = TransformTree()
    for i in range(5):
        stamp: Any = SimpleNamespace(header=i, recorded=i)
        tree.add("odom", "base_link", (0.3 * i, 0.1, 0.07), (0.0, 0.0, 0.0, 1.0), stamp)
        tree.add("odom", "base_footprint", (0.3 * i, 0.1, 0.0), (0.0, 0.0, 0.0, 1.0), stamp)
    found = tree.mounting("base_footprint", "base_link")
    assert found is not None
    np.testing.assert_allclose(found.translation, [0, 0, 0.07], atol=1e-12)
    assert tree.mounting("odom", "base_link") is None


# choice among topics


def test_the_topic_with_the_most_messages_is_used_and_the_others_named(tmp_path: Path) -> None:
    """Two bags of ROS 2 in one folder: the second holds scans of another name."""
    folder = tmp_path / "both"
    folder.mkdir()
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    bag = write_bag(Drive(scans=30), tmp_path / "a", "mcap")
    data = next(iter(bag.glob("*.mcap"))).read_bytes()
    (folder / "x_0.mcap").write_bytes(data)
    other = write_bag(Drive(scans=10), tmp_path / "b", "mcap")
    data = next(iter(other.glob("*.mcap"))).read_bytes().replace(b"/scan", b"/rear")
    (folder / "x_1.mcap").write_bytes(data)
    sequence = open_sequence(folder)
    assert len(sequence.scans) == 30
    assert "/scan (30 messages) is used, not /rear; choose with --scan-topic" in sequence.warnings
    chosen = open_sequence(folder, Topics(scan="/rear"))
    assert len(chosen.scans) == 10
    assert not any("is used, not" in w for w in chosen.warnings)


def test_images_need_intrinsics(tmp_path: Path) -> None:
    def no_info(topic: str, _message: Any) -> bool:
        return topic != "/cam/camera_info"

    def uncalibrated(topic: str, message: Any) -> None:
        if topic == "/cam/camera_info":
            message.K[:] = 0

    for change, why in ((no_info, "has no CameraInfo"), (uncalibrated, "is not calibrated")):
        sequence = read(Drive(images=2, change=change))
        assert sequence.images is None and sequence.camera is None
        assert any("images left out: /cam/image_raw" in w and why in w for w in sequence.warnings)

    def larger_sensor(topic: str, message: Any) -> None:
        if topic == "/cam/camera_info":
            message.width, message.height = 2 * WIDTH, 2 * HEIGHT

    camera = read(Drive(images=2, change=larger_sensor)).camera
    assert camera is not None and (camera.width, camera.height) == (WIDTH, HEIGHT)
    np.testing.assert_allclose(camera.matrix, np.array([[15, 0, 7.5], [0, 15, 5.5], [0, 0, 1]]))  # corners stay corners


def test_depth_images_are_no_pictures(tmp_path: Path) -> None:
    def depth(topic: str, message: Any) -> None:
        if topic == "/cam/image_raw":
            message.encoding = "16UC1"

    drive = Drive(images=2, encoding="mono16", change=depth)
    path = write_bag(drive, tmp_path)
    assert open_sequence(path).images is None
    assert open_sequence(path, Topics(image="/cam/image_raw")).images is not None


# a robot's own bag


def test_turtlebot(shared_data: Callable[[str], Path]) -> None:
    """No message definitions in the bag; the scanner is turned by 90 degrees."""
    folder = shared_data("turtlebot4_bag")
    sequence = open_sequence(folder)
    assert sequence.warnings == ()
    assert sequence.scans.ranges.shape == (357, 720)
    assert sequence.odometry is not None and len(sequence.odometry) == 920
    assert sequence.scans.time_increment == pytest.approx(0.000187, rel=0.01)
    sharp = _crispness(sequence, 0.0)
    assert sharp < min(_crispness(sequence, turn) for turn in (np.pi / 2, -np.pi / 2, np.pi))


def _crispness(sequence: Sequence, turn: float) -> float:
    """Cells that scans fall into while the robot drives and turns: fewer where they lie on each other."""
    assert sequence.odometry is not None
    poses = sequence.odometry.at(sequence.scans.timestamps)
    points = [apply2(poses[i] + [0, 0, turn], sequence.scans.points(i)) for i in range(0, 357, 4)]
    return float(len(np.unique(np.floor(np.concatenate(points) / 0.1).astype(int), axis=0)))
