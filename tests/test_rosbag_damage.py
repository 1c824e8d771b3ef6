"""ROS bags that are cut off, damaged or wrong: a part and a warning, or one line."""

from __future__ import annotations

import shutil
import sqlite3
import tempfile
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from bag_drive import (
    CAMERA,
    HEIGHT,
    KINDS,
    SCAN_PERIOD,
    START,
    Drive,
    Mounting,
    off_walls,
    read,
    write_bag,
)
from hypothesis import given, settings
from hypothesis import strategies as st

from recon.errors import InputError
from recon.sequence.images import load_image
from recon.sequence.open import open_sequence
from recon.sequence.rosbag_storage import open_indexed, open_salvaged
from recon.sequence.topics import Topics

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
