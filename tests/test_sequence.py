"""Readers: what is written comes back, by hypothesis and on the data sets."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from recon.geometry import Pose3
from recon.sequence import images as images_module
from recon.sequence.extrinsics import read_extrinsics, write_extrinsics
from recon.sequence.folder import read_sequence
from recon.sequence.groundtruth import read_groundtruth
from recon.sequence.images import iterate_images, load_image
from recon.sequence.inspection import describe
from recon.sequence.intrinsics import read_camera
from recon.sequence.scans import read_scans_npz
from recon.sequence.scans_csv import read_scans_csv
from recon.sequence.sequence import Scans
from recon.sequence.trajectory import Trajectory
from recon.sequence.tum import read_planar, read_tum, write_planar, write_tum

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("files")


def random_scans(seed: int, scans: int, beams: int, full_turn: bool) -> Scans:
    rng = np.random.default_rng(seed)
    step = 2 * np.pi / beams if full_turn else float(rng.uniform(0.2, 1.0)) * np.pi / beams
    ranges = rng.uniform(0.2, 20, (scans, beams)).astype(np.float32)
    ranges[rng.random((scans, beams)) < 0.1] = np.inf
    ranges[:, [0, -1]] = 3.0  # the ends are seen, so that a file of returns only shows the whole sweep
    ranges[:, 1:4] = 4.0
    start = float(rng.uniform(-np.pi, 0))
    return Scans(1e9 + np.cumsum(rng.uniform(0.05, 0.5, scans)), ranges, start, step, 0.1, 30.0)


def write_csv(path: Path, scans: Scans, digits: int, jitter: float = 0.0) -> None:
    rng, lines = np.random.default_rng(0), ["timestamp,angle,range"]
    for i in range(len(scans)):
        for beam in np.flatnonzero(scans.valid(i)):
            angle = scans.bearings[beam] + jitter * scans.angle_increment * rng.uniform(-1, 1)
            lines.append(f"{scans.timestamps[i]:.6f},{angle:.{digits}f},{scans.ranges[i, beam]:.4f}")
    path.write_text("\n".join(lines) + "\n")


@given(
    seed=st.integers(0, 10**6),
    scans=st.integers(1, 6),
    beams=st.integers(16, 400),
    full_turn=st.booleans(),
    clockwise=st.booleans(),
)
def test_npz_round_trip(folder: Path, seed: int, scans: int, beams: int, full_turn: bool, clockwise: bool) -> None:
    """Also from a scanner upside down: its beams come out counter-clockwise, the points are the same."""
    truth = random_scans(seed, scans, beams, full_turn)
    written = truth
    if clockwise:
        written = replace(
            truth, ranges=truth.ranges[:, ::-1], angle_min=truth.bearings[-1], angle_increment=-truth.angle_increment
        )
    names = ("timestamps", "ranges", "angle_min", "angle_increment", "range_min", "range_max")
    np.savez_compressed(folder / "scans.npz", **{name: getattr(written, name) for name in names})
    back = read_scans_npz(folder / "scans.npz")
    np.testing.assert_array_equal(back.timestamps, truth.timestamps)
    np.testing.assert_array_equal(back.ranges, truth.ranges)
    np.testing.assert_allclose(back.bearings, truth.bearings, atol=1e-9)
    assert (back.range_min, back.range_max, back.time_increment) == (0.1, 30.0, 0.0)


def test_clockwise_scanner_keeps_the_time_of_every_beam(tmp_path: Path) -> None:
    scans = replace(random_scans(3, 4, 30, False), angle_increment=-0.05, time_increment=0.001)
    names = ("timestamps", "ranges", "angle_min", "angle_increment", "range_min", "range_max", "time_increment")
    np.savez(tmp_path / "scans.npz", **{name: getattr(scans, name) for name in names})
    back = read_scans_npz(tmp_path / "scans.npz")
    beam = np.arange(30)
    written = dict(zip(np.round(scans.bearings, 9), scans.timestamps[1] + beam * 0.001, strict=True))
    times = back.timestamps[1] + beam * back.time_increment
    np.testing.assert_allclose(times, [written[a] for a in np.round(back.bearings, 9)], atol=1e-6)
    assert back.angle_increment > 0


@given(
    seed=st.integers(0, 10**6),
    scans=st.integers(1, 6),
    beams=st.integers(16, 400),
    full_turn=st.booleans(),
    digits=st.integers(4, 9),
)
def test_csv_has_the_points_that_were_written(
    folder: Path, seed: int, scans: int, beams: int, full_turn: bool, digits: int
) -> None:
    truth = random_scans(seed, scans, beams, full_turn)
    write_csv(folder / "scans.csv", truth, digits)
    back = read_scans_csv(folder / "scans.csv")
    assert len(back) == len(truth)
    for i in range(scans):
        tolerance = 20 * 10.0**-digits + 1e-4
        np.testing.assert_allclose(back.points(i), truth.points(i), atol=tolerance)


def test_csv_grid_says_where_nothing_returned(tmp_path: Path) -> None:
    truth = random_scans(5, 4, 360, True)
    write_csv(tmp_path / "scans.csv", truth, 6)
    back = read_scans_csv(tmp_path / "scans.csv")
    assert back.ranges.shape == truth.ranges.shape
    np.testing.assert_array_equal(np.isinf(back.ranges), np.isinf(truth.ranges))
    assert back.angle_increment == pytest.approx(truth.angle_increment, rel=1e-5)


def test_csv_of_a_wandering_scanner_keeps_its_bearings(tmp_path: Path) -> None:
    """Bearings off the grid by up to half a step: none moves by over a sixteenth, and gaps are no empty space."""
    truth = random_scans(5, 8, 360, True)
    write_csv(tmp_path / "scans.csv", truth, 6, jitter=0.4)
    rows = np.loadtxt(tmp_path / "scans.csv", delimiter=",", skiprows=1)
    back = read_scans_csv(tmp_path / "scans.csv")
    assert not np.isinf(back.ranges).any()
    for i in range(8):
        row = rows[np.abs(rows[:, 0] - truth.timestamps[i]) < 1e-5]
        expected = row[:, 2:] * np.stack([np.cos(row[:, 1]), np.sin(row[:, 1])], axis=1)
        assert len(back.points(i)) == len(expected)
        off = np.linalg.norm(np.sort(back.points(i), axis=0) - np.sort(expected, axis=0), axis=1)
        assert off.max() < 20 * truth.angle_increment / 8


@given(seed=st.integers(0, 10**6), count=st.integers(1, 30))
def test_tum_round_trip(folder: Path, seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    timestamps = 1.7e9 + np.cumsum(rng.uniform(0.001, 2, count))
    positions, quaternions = rng.normal(0, 50, (count, 3)), rng.normal(0, 1, (count, 4))
    quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
    write_tum(folder / "t.txt", timestamps, positions, quaternions, "some poses")
    back = read_tum(folder / "t.txt")
    for read, written, tolerance in zip(back, (timestamps, positions, quaternions), (1e-6, 1e-6, 1e-8), strict=True):
        np.testing.assert_allclose(read, written, atol=tolerance, rtol=0)


@given(seed=st.integers(0, 10**6), count=st.integers(1, 30))
def test_planar_round_trip(folder: Path, seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    poses = np.column_stack([rng.normal(0, 50, (count, 2)), rng.uniform(-np.pi, np.pi, count)])
    write_planar(folder / "t.txt", Trajectory(np.arange(count, dtype=np.float64), poses))
    back = read_planar(folder / "t.txt").poses
    np.testing.assert_allclose(back[:, :2], poses[:, :2], atol=1e-6)
    np.testing.assert_allclose(np.exp(1j * back[:, 2]), np.exp(1j * poses[:, 2]), atol=1e-7)


@given(seed=st.integers(0, 10**6))
def test_extrinsics_round_trip(folder: Path, seed: int) -> None:
    rng = np.random.default_rng(seed)
    pose = Pose3(Rotation.random(rng=rng).as_matrix(), rng.normal(0, 1, 3))
    write_extrinsics(folder / "extrinsics.yaml", pose, "estimated")
    back = read_extrinsics(folder / "extrinsics.yaml")
    np.testing.assert_allclose(back.matrix(), pose.matrix(), atol=2e-6)


def test_extrinsics_from_the_lidar_are_moved_to_the_floor(tmp_path: Path) -> None:
    path = tmp_path / "extrinsics.yaml"
    path.write_text(
        "lidar_from_camera: {translation: [0.1, 0.2, 0.3], quaternion_xyzw: [0, 0, 0, 1]}\nlidar_height: 1.25\n"
    )
    np.testing.assert_allclose(read_extrinsics(path).translation, [0.1, 0.2, 1.55])


@pytest.mark.parametrize(
    ("model", "coefficients"),
    [
        ("plumb_bob", [-0.2, 0.05, 0.001, -0.002, 0.01]),
        ("plumb_bob", [-0.2, 0.05, 0.001, -0.002]),
        ("rational_polynomial", [-0.3, 0.1, 0.001, -0.001, 0.02, 0.01, 0.02, 0.01]),
        ("equidistant", [-0.02, 0.01, 0.002, -0.001]),
    ],
)
def test_distortion_models_as_opencv_projects(model: str, coefficients: list[float], tmp_path: Path) -> None:
    path = tmp_path / "camera.yaml"
    matrix = [300.0, 0.0, 320.0, 0.0, 310.0, 240.0, 0.0, 0.0, 1.0]
    path.write_text(
        f"image_width: 640\nimage_height: 480\ncamera_name: c\ncamera_matrix: {{rows: 3, cols: 3, data: {matrix}}}\n"
        f"distortion_model: {model}\ndistortion_coefficients: {{data: {coefficients}}}\n"
    )
    camera = read_camera(path)
    points = np.random.default_rng(0).uniform([-0.5, -0.4, 1], [0.5, 0.4, 1], (50, 3))
    k, d, zero = np.reshape(matrix, (3, 3)), np.array(coefficients), np.zeros(3)
    if model == "equidistant":
        expected = cv2.fisheye.projectPoints(points[:, None], zero, zero, k, d)[0]
    else:
        expected = cv2.projectPoints(points, zero, zero, k, d)[0]
    np.testing.assert_allclose(camera.project(points), np.reshape(expected, (-1, 2)), atol=1e-9)
    np.testing.assert_allclose(camera.undistort(camera.project(points)), points[:, :2], atol=1e-7)


@pytest.mark.parametrize("suffix", ["jpg", "png"])
@pytest.mark.parametrize("kind", ["colour", "grey", "16 bit"])
def test_images_decode_as_opencv_decodes(suffix: str, kind: str, tiny_sequence: Path) -> None:
    if kind == "16 bit" and suffix == "jpg":
        pytest.skip("JPEG has 8 bits")
    shape = (24, 32, 3) if kind == "colour" else (24, 32)
    pixels = cv2.GaussianBlur(np.random.default_rng(0).integers(0, 256, shape).astype(np.uint8), (9, 9), 0)
    path = tiny_sequence / "images" / f"1.{suffix}"
    cv2.imwrite(str(path), pixels.astype(np.uint16) * 257 if kind == "16 bit" else pixels)
    listed = (tiny_sequence / "images.txt").read_text().replace("images/1.jpg", f"images/1.{suffix}")
    (tiny_sequence / "images.txt").write_text(listed)
    sequence = read_sequence(tiny_sequence)
    assert sequence.images is not None
    assert sequence.camera is not None
    expected = cv2.imread(str(path), cv2.IMREAD_COLOR)
    read = load_image(sequence.images, 1, sequence.camera)
    assert read is not None
    np.testing.assert_array_equal(read, expected)
    grey = load_image(sequence.images, 1, sequence.camera, grey=True)
    assert grey is not None
    assert grey.shape == (24, 32)
    assert np.abs(grey - cv2.cvtColor(expected, cv2.COLOR_BGR2GRAY).astype(float)).max() <= 2


def test_images_are_read_once_each_in_order_and_not_far_ahead(
    tiny_sequence: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sequence = read_sequence(tiny_sequence)
    assert sequence.images is not None
    assert sequence.camera is not None
    read: list[int] = []

    def spy(images: Any, index: int, *rest: Any) -> Any:
        read.append(index)
        return load_image(images, index, *rest)

    monkeypatch.setattr(images_module, "load_image", spy)
    threads = threading.active_count()
    for index, image in iterate_images(sequence.images, sequence.camera, ahead=2):
        assert image is not None
        assert len(read) <= index + 3
    assert read == [0, 1, 2, 3, 4]
    iterator = iterate_images(sequence.images, sequence.camera, indices=[3, 1])
    assert next(iterator)[0] == 3
    iterator.close()  # type: ignore[attr-defined]
    assert threading.active_count() == threads


def test_images_may_lie_in_a_linked_folder(tiny_sequence: Path, tmp_path: Path) -> None:
    (tiny_sequence / "images").rename(tmp_path / "elsewhere")
    (tiny_sequence / "images").symlink_to(tmp_path / "elsewhere")
    images = read_sequence(tiny_sequence).images
    assert images is not None
    assert len(images) == 5


def test_lidar_alone_is_a_sequence(tiny_sequence: Path) -> None:
    for name in ("camera.yaml", "images.txt", "odometry.txt"):
        (tiny_sequence / name).unlink()
    for path in (tiny_sequence / "images").iterdir():
        path.unlink()
    (tiny_sequence / "images").rmdir()
    sequence = read_sequence(tiny_sequence)
    assert (sequence.images, sequence.camera, sequence.odometry) == (None, None, None)
    assert len(sequence.scans) == 6


def test_what_is_odd_is_said(tiny_sequence: Path) -> None:
    (tiny_sequence / "scans.csv").write_text("unused")
    (tiny_sequence / "odometry.txt").write_text("10 0 0 0 0 0 0 1\n10.2 1 0 2 0 0 0 1\n")
    listed = (tiny_sequence / "images.txt").read_text().replace("10.43", "19.43")
    (tiny_sequence / "images.txt").write_text(listed)
    warnings = read_sequence(tiny_sequence).warnings
    assert len(warnings) == 3
    for fragment in ("scans.csv", "not planar", "1 of 5 images"):
        assert any(fragment in warning for warning in warnings)


def test_sample_is_read_whole() -> None:
    sequence, truth = read_sequence(ROOT / "samples/corridor"), read_groundtruth(ROOT / "samples/corridor")
    assert (len(sequence.scans), sequence.warnings) == (96, ())
    assert sequence.images is not None
    assert truth.trajectory is not None
    assert truth.layout is not None
    assert truth.camera_trajectory is not None
    assert truth.platform_from_camera is not None
    assert all(truth.label_path(name) is not None for name in sequence.images.names)
    assert len(truth.layout.walls) == 6
    # the camera's own trajectory is the platform's with the extrinsics: an independent check of all three readers
    at_images = truth.trajectory.at(sequence.images.timestamps)
    for pose, camera in zip(at_images, truth.camera_trajectory.poses, strict=True):
        expected = Pose3.from_planar(pose) @ truth.platform_from_camera
        assert np.linalg.norm(expected.translation - camera.translation) < 0.02


@pytest.mark.parametrize("name", ["corridor", "lobby", "intel", "killian", "mines"])
def test_data_sets_are_read_without_warnings(name: str, shared_data: Callable[[str], Path]) -> None:
    sequence = read_sequence(shared_data(name))
    assert sequence.warnings == ()
    assert sequence.odometry is not None
    assert (sequence.images is None) == (name in ("intel", "killian", "mines"))


def test_lobby_heights_are_above_the_floor(shared_data: Callable[[str], Path]) -> None:
    truth = read_groundtruth(shared_data("lobby"))
    assert truth.platform_from_camera is not None
    assert truth.camera_trajectory is not None
    assert truth.platform_from_camera.translation[2] == pytest.approx(1.633, abs=0.001)
    heights = [pose.translation[2] for pose in truth.camera_trajectory.poses]
    assert 1.60 < min(heights) <= max(heights) < 1.67


def test_relations_are_read(shared_data: Callable[[str], Path]) -> None:
    relations = read_groundtruth(shared_data("intel")).relations
    assert relations is not None
    assert relations.first_from_second.shape == (2984, 3)
    assert np.linalg.norm(relations.first_from_second[0]) == pytest.approx(1.688, abs=0.01)


def test_description_of_the_sample() -> None:
    text = "\n".join(describe(read_sequence(ROOT / "samples/corridor")))
    for fragment in (
        "96 in 11.9 s, 8.0 Hz",
        "1080 beams over 360 deg",
        "40 deg never return",
        "43 in 10.5 s",
        "640 x 480",
        "65 deg wide",
        "path 16.7 m",
        "0.1 to 16 m",
    ):
        assert fragment in text, fragment


def test_picture_shows_scans_and_images(tmp_path: Path, run_recon: Any) -> None:
    path = tmp_path / "corridor.png"
    result = run_recon("inspect", ROOT / "samples/corridor", "-o", path)
    assert (result.status, result.errors) == (0, [])
    picture = cv2.imread(str(path))
    assert picture is not None
    assert picture.shape == (900, 900 + 2 * 400, 3)
    plan = picture[60:840, :900].astype(int)
    dark = (plan.max(axis=2) < 100).sum()
    red = ((plan[..., 2] > 150) & (plan[..., 0] < 100)).sum()
    assert 3000 < dark < 60000
    assert 500 < red < 5000
    first = cv2.resize(
        cv2.imread(str(ROOT / "samples/corridor/images/0000.jpg")), (400, 300), interpolation=cv2.INTER_AREA
    )
    assert np.abs(picture[30:300, 900:1300].astype(int) - first[30:]).max() <= 1
