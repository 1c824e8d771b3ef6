"""ROS bags, written by the writers of `rosbags` from a room of known size: what is read must lie on its walls."""

from __future__ import annotations

import shutil
import sqlite3
import tempfile
import tracemalloc
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
from bag_drive import (
    HALF,
    HEIGHT,
    IMAGE_PERIOD,
    KINDS,
    OPTICAL,
    SCAN_PERIOD,
    START,
    WIDTH,
    Drive,
    Mounting,
    pose,
    turned,
    upside_down,
    write_bag,
)
from hypothesis import given, settings
from hypothesis import strategies as st

from recon.errors import InputError
from recon.geometry import apply2, compose2
from recon.sequence.folder import read_sequence
from recon.sequence.images import load_image
from recon.sequence.open import open_sequence
from recon.sequence.rosbag_storage import open_indexed, open_salvaged
from recon.sequence.scan_grid import Sweep, common_grid
from recon.sequence.sequence import Sequence
from recon.sequence.stamps import increasing
from recon.sequence.tf import TransformTree
from recon.sequence.topics import Topics
from recon.sequence.write import write_sequence

CAMERA: Mounting = ((0.12, 0.03, 0.5), OPTICAL)


def read(drive: Drive, kind: str = "bag", topics: Topics | None = None) -> Sequence:
    """The drive by way of a bag that is gone when this returns."""
    with tempfile.TemporaryDirectory() as folder:
        return open_sequence(write_bag(drive, Path(folder), kind), topics)


def off_walls(sequence: Sequence) -> float:
    """m: how far the farthest return lies from the room's walls, scans laid out by the odometry."""
    assert sequence.odometry is not None
    poses = sequence.odometry.at(sequence.scans.timestamps)
    worst = 0.0
    for i in range(len(sequence.scans)):
        points = apply2(poses[i], sequence.scans.points(i))
        assert len(points) == sequence.scans.ranges.shape[1]
        beyond = np.abs(points) - HALF
        worst = max(worst, float(np.abs(beyond.max(axis=1)).max()))
    return worst


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


# bags that are not whole


@pytest.mark.parametrize("kind", ["bag", "bag.bz2", "bag.lz4", "mcap", "mcap.zstd", "db3"])
def test_a_bag_cut_off_in_mid_record_gives_what_is_before(kind: str, tmp_path: Path) -> None:
    many = kind in ("bag.bz2", "mcap.zstd")  # they compress so well that much must be written
    drive = Drive(scans=200 if many else 60, images=30, beams=4000 if many else 360, encoding="rgb8", camera=CAMERA)
    whole = open_sequence(write_bag(drive, tmp_path, kind))
    path = tmp_path / "drive.bag" if kind.startswith("bag") else next(iter((tmp_path / "drive").glob("drive.*")))
    size = path.stat().st_size
    lengths = []
    for share in (0.9, 0.6):
        cut = tmp_path / f"cut{path.suffix}"
        cut.write_bytes(path.read_bytes()[: int(size * share) - 7])
        part = open_sequence(cut)
        assert "cannot be read" in part.warnings[0]
        n = len(part.scans)
        np.testing.assert_array_equal(part.scans.timestamps, whole.scans.timestamps[:n])
        np.testing.assert_array_equal(part.scans.ranges, whole.scans.ranges[:n])
        assert off_walls(part) < 1e-4
        assert part.images is not None and part.camera is not None
        picture = load_image(part.images, len(part.images) - 1, part.camera)
        np.testing.assert_array_equal(picture, drive.picture(len(part.images) - 1))
        lengths.append(n)
    assert drive.scans * 0.2 < lengths[1] < lengths[0] < drive.scans  # chunks are lost whole


def test_a_bag_whose_recorder_was_killed(tmp_path: Path) -> None:
    """Its header names no index yet."""
    sequence = open_sequence(write_bag(Drive(scans=400, beams=720), tmp_path, "bag", cut=True))
    assert 200 < len(sequence.scans) < 400  # the writer holds the last messages back
    (tmp_path / "drive.bag").rename(tmp_path / "drive.bag.active")
    assert len(open_sequence(tmp_path / "drive.bag.active").scans) == len(sequence.scans)


@pytest.mark.parametrize("kind", ["db3", "mcap"])
def test_without_metadata(kind: str, tmp_path: Path) -> None:
    folder = write_bag(Drive(images=2), tmp_path, kind)
    file = next(iter(folder.glob(f"*.{kind}")))
    assert "metadata" not in str(open_sequence(file).warnings)
    (folder / "metadata.yaml").unlink()
    sequence = open_sequence(folder)
    assert any("metadata.yaml is missing" in warning for warning in sequence.warnings)
    assert off_walls(sequence) < 1e-4
    assert sequence.images is not None and len(sequence.images) == 2


def test_files_of_one_recording_follow_each_other(tmp_path: Path) -> None:
    """Without metadata.yaml, numbers of files count, not their order as words."""
    folder = tmp_path / "split"
    folder.mkdir()
    for number in (2, 10):
        (tmp_path / f"{number}").mkdir()
        later = SimpleNamespace(ns=10_000_000_000 if number == 10 else 0)

        def change(_topic: str, message: Any, later: Any = later) -> None:
            for header in [message.header] if hasattr(message, "header") else [t.header for t in message.transforms]:
                header.stamp.sec += later.ns // 10**9

        bag = write_bag(Drive(scans=5, change=change, images=1), tmp_path / f"{number}", "mcap")
        shutil.copy(next(iter(bag.glob("*.mcap"))), folder / f"split_{number}.mcap")
    sequence = open_sequence(folder)
    assert len(sequence.scans) == 10
    assert np.diff(sequence.scans.timestamps).max() == pytest.approx(10 - 0.4, abs=1e-6)
    assert sequence.images is not None
    assert [len(sequence.images.read(i)) for i in (1, 0)] == [HEIGHT, HEIGHT]


def test_messages_in_a_journal_are_read(tmp_path: Path) -> None:
    """SQLite's write-ahead log, left by a recorder that was killed."""
    folder = write_bag(Drive(), tmp_path, "db3")
    database = sqlite3.connect(folder / "drive.db3", isolation_level=None)
    rows = database.execute("SELECT * FROM messages").fetchall()
    database.execute("DELETE FROM messages WHERE id > 20")
    database.execute("PRAGMA journal_mode = WAL")
    database.executemany("INSERT INTO messages VALUES (?, ?, ?, ?)", [row for row in rows if row[0] > 20])
    (tmp_path / "killed").mkdir()
    for file in ("drive.db3", "drive.db3-wal"):
        shutil.copy(folder / file, tmp_path / "killed" / file)
    database.close()
    sequence = open_sequence(tmp_path / "killed")
    assert len(sequence.scans) == 20
    assert off_walls(sequence) < 1e-4


def test_a_recording_with_a_file_missing_says_so(tmp_path: Path) -> None:
    folder = write_bag(Drive(), tmp_path, "mcap")
    metadata = (folder / "metadata.yaml").read_text()
    (folder / "metadata.yaml").write_text(metadata.replace("- drive.mcap", "- drive.mcap\n  - drive_1.mcap"))
    sequence = open_sequence(folder)
    assert len(sequence.scans) == 20
    assert any("drive_1.mcap" in w and "read without its index" in w for w in sequence.warnings)


@pytest.mark.parametrize("kind", KINDS[:6])
def test_reading_front_to_back_agrees_with_the_library(kind: str, tmp_path: Path) -> None:
    path = write_bag(Drive(images=2), tmp_path, kind)
    indexed, salvaged = open_indexed(path), open_salvaged(path)
    assert salvaged.lost == ""
    assert {t.name: (t.type, t.messages) for t in indexed.topics} == {
        t.name: (t.type, t.messages) for t in salvaged.topics
    }
    names = [topic.name for topic in indexed.topics]
    first, second = (sorted(store.messages(names), key=lambda m: (m.time, m.topic)) for store in (indexed, salvaged))
    assert len(first) == 45
    assert [m[:3] for m in first] == [m[:3] for m in second]
    for storage, found in ((indexed, first), (salvaged, second)):
        for message in reversed(found):
            assert storage.read(message.place) == message.data


@given(seed=st.integers(0, 10**6), kind=st.sampled_from(["bag", "bag.lz4", "mcap", "mcap.zstd", "db3"]))
@settings(max_examples=20, deadline=None)
def test_damaged_bytes_give_a_part_or_one_line(seed: int, kind: str) -> None:
    """Never another exception, whatever bytes are changed."""
    rng = np.random.default_rng(seed)
    with tempfile.TemporaryDirectory() as folder:
        path = write_bag(Drive(scans=6, images=2), Path(folder), kind)
        file = path if path.is_file() else next(p for p in path.iterdir() if p.suffix in (".db3", ".mcap"))
        data = bytearray(file.read_bytes())
        for at in rng.integers(0, len(data), rng.integers(1, 30)):
            data[at] = rng.integers(0, 256)
        file.write_bytes(data)
        try:
            sequence = open_sequence(file)
        except InputError as error:
            assert str(file) in str(error) and "\n" not in str(error)
            return
        assert 1 <= len(sequence.scans) <= 6
        if sequence.images is not None and sequence.camera is not None:
            for i in range(len(sequence.images)):
                load_image(sequence.images, i, sequence.camera, warnings=[])


# records that are wrong


def dropping(topic: str, damage: Callable[[Any, int], bool | None]) -> Callable[[str, Any], bool | None]:
    """Calls `damage` with the messages of one topic and their numbers."""
    count = iter(range(10**6))
    return lambda name, message: damage(message, next(count)) if name == topic else None


def _set(message: Any, index: int, at: int, **values: Any) -> None:
    if index == at:
        for name, value in values.items():
            setattr(message, name, value)


def test_stamps_that_jump_cost_only_their_records() -> None:
    def damage(message: Any, i: int) -> None:
        if i in (5, 12):
            message.header.stamp.sec += {5: -50, 12: 4000}[i]

    sequence = read(Drive(change=dropping("/scan", damage)))
    assert len(sequence.scans) == 18
    assert any("2 messages of /scan left out (of 20)" in warning for warning in sequence.warnings)
    assert off_walls(sequence) < 1e-4


def test_damaged_records_are_left_out_and_counted() -> None:
    def damage(message: Any, i: int) -> None:
        _set(message, i, 3, ranges=np.zeros(0, np.float32))
        _set(message, i, 4, ranges=np.zeros(7, np.float32))
        _set(message, i, 5, angle_increment=0.0)

    sequence = read(Drive(scans=100, change=dropping("/scan", damage)))
    assert len(sequence.scans) == 97
    assert any("2 messages of /scan left out: without beams" in warning for warning in sequence.warnings)
    assert any("1 scan of /scan left out: other beams than the rest" in warning for warning in sequence.warnings)


def test_images_of_another_size_or_cut_short_are_left_out(tmp_path: Path) -> None:
    def damage(message: Any, i: int) -> None:
        _set(message, i, 1, data=message.data[: len(message.data) // 2])
        _set(message, i, 2, height=HEIGHT // 2)

    drive = Drive(images=5, change=dropping("/cam/image_raw", damage))
    sequence = open_sequence(write_bag(drive, tmp_path))
    assert sequence.images is not None and sequence.camera is not None
    np.testing.assert_array_equal(load_image(sequence.images, 1, sequence.camera), drive.picture(3))
    assert [w for w in sequence.warnings if "/cam/image_raw" in w and "no " not in w] == [
        "1 message of /cam/image_raw left out: damaged",
        "1 message of /cam/image_raw left out: of another size",
    ]


def test_ranges_mean_what_they_mean_in_ros() -> None:
    """REP 117: over the limit no return, under it invalid; a range at the limit is what drivers clip to."""
    values = np.array([31.0, np.inf, np.nan, -np.inf, -1.0, 0.0, 0.01, 30.0, 65.533], np.float32)

    def damage(message: Any, i: int) -> None:
        message.ranges[: len(values)] = values

    ranges = read(Drive(change=dropping("/scan", damage))).scans.ranges[:, : len(values)]
    expected = [np.inf, np.inf, np.nan, np.nan, np.nan, np.nan, np.nan, np.inf, np.inf]
    np.testing.assert_array_equal(ranges, np.tile(np.array(expected, np.float32), (20, 1)))


def test_headers_without_a_time_and_clocks_of_their_own() -> None:
    def no_time(message: Any, i: int) -> None:
        message.header.stamp.sec = message.header.stamp.nanosec = 0

    sequence = read(Drive(change=dropping("/scan", no_time)))
    assert sequence.scans.timestamps[0] == pytest.approx(START * 1e-9 + 0.003, abs=1e-6)  # of recording
    assert "20 headers of /scan without a time: that of recording is used" in sequence.warnings

    def since_start(message: Any, i: int) -> None:
        message.header.stamp.sec -= START // 10**9 - 77

    sequence = read(Drive(change=dropping("/odom", since_start)))
    assert any("/odom is stamped by another clock" in warning for warning in sequence.warnings)
    assert off_walls(sequence) < 1e-4


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


# what cannot be used


def two_scanners(topic: str, message: Any) -> None:
    if topic == "/scan" and int(message.header.stamp.nanosec) % (2 * SCAN_PERIOD):
        message.header.frame_id = "rear_laser"


def no_scans(topic: str, _message: Any) -> bool:
    return topic != "/scan"


def empty_scans(topic: str, message: Any) -> None:
    if topic == "/scan":
        message.ranges = np.zeros(0, np.float32)


def backwards(topic: str, message: Any) -> None:
    if topic == "/scan":
        message.header.stamp.sec = 2 * (START // 10**9) - message.header.stamp.sec
        message.header.stamp.nanosec = 999_999_999 - message.header.stamp.nanosec


def test_bad_bags_end_in_one_line(tmp_path: Path, run_recon: Any) -> None:
    vertical: Mounting = ((0, 0, 0), (float(np.sin(np.pi / 4)), 0, 0, float(np.cos(np.pi / 4))))
    cases: dict[str, tuple[Drive, list[str]]] = {
        "two scanners": (Drive(change=two_scanners), ["/scan", "laser (10)", "rear_laser (10)", "one scanner a topic"]),
        "no scans": (Drive(change=no_scans), ["no laser scans", "/odom (Odometry, 20)", "/tf_static (TFMessage, 1)"]),
        "zero length": (Drive(change=empty_scans), ["/scan", "no scan that can be used", "20 damaged"]),
        "backwards": (Drive(change=backwards), ["/scan", "jump back", "of 20"]),
        "vertical": (Drive(laser=vertical), ["/scan", "tilted by 90 deg"]),
    }
    for name, (drive, expected) in cases.items():
        (tmp_path / name).mkdir()
        path = write_bag(drive, tmp_path / name)
        result = run_recon("inspect", path)
        assert result.status == 2, name
        assert len(result.errors) == 1 and result.output == [], name
        for piece in ("recon: ", str(path), *expected):
            assert piece in result.errors[0], name


def test_bad_topics_end_in_one_line(tmp_path: Path, run_recon: Any) -> None:
    path = write_bag(Drive(images=1), tmp_path)
    for option, expected in (
        (("--scan-topic", "/front"), ["LaserScan", "/front", "/scan (LaserScan, 20)"]),
        (("--odom-topic", "wheels"), ["Odometry", "/wheels"]),
        (("--image-topic", "/scan"), ["no image topic /scan", "/cam/image_raw (Image, 1)"]),
        (("--camera-info-topic", "/x"), ["CameraInfo topic /x"]),
    ):
        result = run_recon("inspect", path, *option)
        assert result.status == 2
        for piece in expected:
            assert piece in result.errors[0]
    assert run_recon("inspect", path, "--scan-topic", "scan", "--image-topic", "none").status == 0


@pytest.mark.parametrize("name", ["a.bag", "a.mcap", "a.db3", "a.bag.active"])
@pytest.mark.parametrize("content", [b"", b"hello, this is no bag", b"\x00" * 4096, b"#ROSBAG V1.2\n" + b"x" * 99])
def test_files_that_are_no_bags(name: str, content: bytes, tmp_path: Path) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError) as error:
        open_sequence(tmp_path / name)
    assert name in str(error.value) and "\n" not in str(error.value)


def test_what_is_missing_or_unknown(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        open_sequence(tmp_path / "a.bag")
    (tmp_path / "a.txt").write_text("x")
    with pytest.raises(InputError, match="unknown kind"):
        open_sequence(tmp_path / "a.txt")
    with pytest.raises(InputError, match="no ROS bag"):
        open_sequence(tmp_path, Topics(scan="/scan"))


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


# scanners whose beams wander


@given(seed=st.integers(0, 10**6), jitter=st.sampled_from([0.0, 0.01, 0.5]), counts=st.booleans())
@settings(max_examples=40, deadline=None)
def test_a_common_grid_keeps_bearings(seed: int, jitter: float, counts: bool) -> None:
    """Every beam's range is found at its bearing, to an eighth of a step."""
    rng = np.random.default_rng(seed)
    step = 2 * np.pi / 400
    sweeps = []
    for _ in range(12):
        beams = 400 - int(rng.integers(0, 8)) if counts else 400
        own = 2 * np.pi / beams if counts and jitter == 0.5 else step
        start = -np.pi + jitter * step * rng.uniform(-1, 1)
        sweeps.append(Sweep(start, own, rng.uniform(1, 9, beams).astype(np.float32)))
    grid = common_grid(sweeps)
    assert grid.kept.all()
    fine = len(grid.ranges[0]) > 500
    assert fine == (jitter == 0.5)
    for sweep, row in zip(sweeps, grid.ranges, strict=True):
        seen = np.flatnonzero(np.isfinite(row))
        assert len(seen) >= 0.97 * len(sweep.ranges)
        bearings = grid.start + grid.step * seen
        beam = np.rint((bearings - sweep.start) / sweep.step).astype(int)
        np.testing.assert_array_equal(row[seen], sweep.ranges[beam])
        off = bearings - (sweep.start + sweep.step * beam)
        assert np.abs(off).max() < step * (0.13 if fine else 0.25)


def test_first_echo_of_several(tmp_path: Path) -> None:
    from rosbags.rosbag2 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    echo, kind = store.types["sensor_msgs/msg/LaserEcho"], "sensor_msgs/msg/MultiEchoLaserScan"
    with Writer(tmp_path / "drive", version=9) as writer:
        connection = writer.add_connection("/echoes", kind, typestore=store)
        for i in range(3):
            stamp = store.types["builtin_interfaces/msg/Time"](sec=100, nanosec=i * SCAN_PERIOD)
            echoes = [echo(echoes=np.array(v, np.float32)) for v in ([2.0, 5.0], [], [3.0])]
            message = store.types[kind](
                store.types["std_msgs/msg/Header"](stamp, "laser"), -0.1, 0.1, 0.1, 0.0, 0.1, 0.05, 30.0, echoes, []
            )
            writer.write(connection, 10**11 + i, store.serialize_cdr(message, kind))
    ranges = open_sequence(tmp_path / "drive").scans.ranges
    np.testing.assert_array_equal(ranges, np.tile(np.array([2, np.inf, 3], np.float32), (3, 1)))


@given(st.lists(st.one_of(st.integers(0, 30).map(float), st.just(np.nan)), max_size=14))
def test_as_many_records_as_can_be_are_kept(times: list[float]) -> None:
    """Against trying every choice."""
    keep = increasing(times)
    kept = [t for t, ok in zip(times, keep, strict=True) if ok]
    assert all(a < b for a, b in pairwise(kept))
    longest: list[int] = []
    for i, t in enumerate(times):
        before = [longest[j] for j in range(i) if times[j] < t]
        longest.append(0 if np.isnan(t) else 1 + max(before, default=0))
    assert len(kept) == max(longest, default=0)


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
