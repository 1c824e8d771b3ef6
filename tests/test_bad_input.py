"""Whatever is wrong with the input ends in one line, exit status 2, and nothing written."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from recon.errors import InputError
from recon.sequence.folder import read_sequence
from recon.sequence.images import iterate_images, load_image

Damage = Callable[[Path], object]


def arrays(folder: Path) -> dict[str, Any]:
    with np.load(folder / "scans.npz") as archive:
        return dict(archive)


def scans(**changes: Any) -> Damage:
    """Damage that replaces arrays of scans.npz; None removes one."""

    def damage(folder: Path) -> None:
        content = {**arrays(folder), **changes}
        np.savez(folder / "scans.npz", **{name: value for name, value in content.items() if value is not None})

    return damage


def scans_cell(value: float, index: tuple[int, int] = (2, 7)) -> Damage:
    def damage(folder: Path) -> None:
        ranges = arrays(folder)["ranges"]
        ranges[index] = value
        scans(ranges=ranges)(folder)

    return damage


def scan_time(value: float, index: int = 3) -> Damage:
    def damage(folder: Path) -> None:
        timestamps = arrays(folder)["timestamps"]
        timestamps[index] = value
        scans(timestamps=timestamps)(folder)

    return damage


def text(name: str, old: str, new: str) -> Damage:
    """Damage that replaces a piece of a text file."""

    def damage(folder: Path) -> None:
        content = (folder / name).read_text()
        assert old in content
        (folder / name).write_text(content.replace(old, new, 1))

    return damage


def content(name: str, data: str | bytes) -> Damage:
    return lambda folder: (folder / name).write_bytes(data.encode() if isinstance(data, str) else data)


def without(*names: str) -> Damage:
    def damage(folder: Path) -> None:
        for name in names:
            path = folder / name
            shutil.rmtree(path) if path.is_dir() else path.unlink()

    return damage


def cut(name: str, share: float) -> Damage:
    def damage(folder: Path) -> None:
        data = (folder / name).read_bytes()
        (folder / name).write_bytes(data[: int(len(data) * share)])

    return damage


def csv(*rows: str, header: str = "timestamp,angle,range") -> Damage:
    def damage(folder: Path) -> None:
        (folder / "scans.npz").unlink()
        (folder / "scans.csv").write_text("\n".join([header, *rows]) + "\n")

    return damage


def extrinsics(translation: str = "[0.1, 0, 1]", quaternion: str = "[0.5, -0.5, 0.5, -0.5]") -> Damage:
    body = f"platform_from_camera: {{translation: {translation}, quaternion_xyzw: {quaternion}}}\n"
    return content("extrinsics.yaml", body)


def folder_for_scans(folder: Path) -> None:
    (folder / "scans.npz").unlink()
    (folder / "scans.npz").mkdir()


def larger_image(folder: Path) -> None:
    cv2.imwrite(str(folder / "images" / "3.jpg"), np.zeros((48, 64, 3), np.uint8))


def all_images_damaged(folder: Path) -> None:
    for path in (folder / "images").iterdir():
        path.write_bytes(b"\xff\xd8 no picture")


def clock_of_its_own(name: str) -> Damage:
    def damage(folder: Path) -> None:
        (folder / name).write_text(re.sub(r"(?m)^10\.", "99910.", (folder / name).read_text()))

    return damage


CASES: dict[str, tuple[Damage, list[str]]] = {
    # missing files
    "folder missing": (lambda f: shutil.rmtree(f), ["drive", "no such folder"]),
    "scans missing": (without("scans.npz"), ["scans.npz", "scans.csv"]),
    "camera missing": (without("camera.yaml"), ["camera.yaml", "missing", "images.txt is there"]),
    "list missing": (without("images.txt"), ["images.txt", "missing", "camera.yaml is there"]),
    "images without list": (without("images.txt", "camera.yaml"), ["images/", "missing"]),
    "image missing": (without("images/2.jpg"), ["images.txt:4", "images/2.jpg", "missing"]),
    # scans.npz
    "scans truncated": (cut("scans.npz", 0.5), ["scans.npz", "truncated"]),
    "scans cut at the end": (cut("scans.npz", 0.98), ["scans.npz", "truncated"]),
    "scans empty file": (content("scans.npz", b""), ["scans.npz"]),
    "scans are text": (content("scans.npz", "1 2 3\n"), ["scans.npz", "npz"]),
    "scans a folder": (folder_for_scans, ["scans.npz", "directory"]),
    "pickled": (scans(ranges=np.array([[1.0, "x"], [None, {}]], dtype=object)), ["scans.npz", "ranges", "pickled"]),
    "strings": (scans(ranges=np.full((6, 90), "a")), ["scans.npz", "ranges", "numbers"]),
    "complex": (scans(ranges=np.full((6, 90), 1j)), ["scans.npz", "ranges", "numbers"]),
    "array missing": (scans(angle_increment=None), ["scans.npz", "angle_increment", "missing"]),
    "no scans": (scans(timestamps=np.zeros(0), ranges=np.zeros((0, 90), np.float32)), ["empty sequence", "0 scans"]),
    "no beams": (scans(ranges=np.zeros((6, 0), np.float32)), ["empty sequence", "0 beams"]),
    "counts differ": (scans(timestamps=np.arange(4.0)), ["timestamps", "(4,)", "(6, 90)"]),
    "ranges flat": (scans(ranges=np.ones(6, np.float32)), ["ranges", "(6,)"]),
    "intensities differ": (scans(intensities=np.ones((6, 3))), ["intensities", "(6, 3)", "(6, 90)"]),
    "vector for a scalar": (scans(range_max=np.ones(3)), ["range_max", "(3,)", "scalar"]),
    "scalar not finite": (scans(angle_min=np.nan), ["angle_min", "nan"]),
    "no increment": (scans(angle_increment=0.0), ["angle_increment", "0"]),
    "increment in degrees": (scans(angle_increment=4.0), ["angle_increment", "radians"]),
    "start in degrees": (scans(angle_min=-180.0), ["angle_min", "radians"]),
    "limits swapped": (scans(range_min=5.0, range_max=1.0), ["range_min", "range_max", "5.0"]),
    "negative range": (scans_cell(-1.5), ["scans.npz", "scan 2", "beam 7", "-1.5"]),
    "minus infinity": (scans_cell(-np.inf), ["scans.npz", "scan 2", "beam 7", "-inf"]),
    "all nan": (scans(ranges=np.full((6, 90), np.nan, np.float32)), ["scans.npz", "no beam"]),
    "all no return": (scans(ranges=np.full((6, 90), np.inf, np.float32)), ["scans.npz", "no beam"]),
    "scan time repeated": (scan_time(10.2), ["not increasing", "scan 3", "10.200000"]),
    "scan time back": (scan_time(3.0), ["not increasing", "scan 3", "3.000000"]),
    "scan times in ns": (scans(timestamps=1e18 + 1e8 * np.arange(6)), ["scans.npz", "1e+08 s apart", "seconds"]),
    "scan time nan": (scan_time(np.nan), ["scan 3", "nan"]),
    "scan time infinite": (scan_time(np.inf, 5), ["scan 5", "inf"]),
    # scans.csv
    "csv empty": (csv(), ["scans.csv", "empty sequence"]),
    "csv header": (csv("1,0,1", header="time,angle,range"), ["scans.csv", "header", "timestamp,angle,range"]),
    "csv columns": (csv("1,0,1", "1,0.1"), ["scans.csv:3", "2 columns", "3"]),
    "csv words": (csv("1,0,one"), ["scans.csv:2", "numbers"]),
    "csv negative": (csv("1,0,1", "1,0.1,-2", "1,0.2,1"), ["scans.csv", "-2"]),
    "csv angle nan": (csv("1,0,1", "1,nan,2", "1,0.2,1"), ["scans.csv", "row 1"]),
    "csv time back": (csv("1,0,1", "1,0.1,2", "0,0,1", "0,0.1,1"), ["scans.csv", "not increasing"]),
    "csv in degrees": (csv(*(f"1,{a},2" for a in range(0, 360, 2))), ["scans.csv", "radians"]),
    "csv one angle": (csv("1,0,1", "2,0,1"), ["scans.csv", "angles"]),
    # camera.yaml
    "camera empty": (content("camera.yaml", ""), ["camera.yaml", "mapping"]),
    "camera not yaml": (content("camera.yaml", "a: [1, 2\nb: }"), ["camera.yaml", "not YAML"]),
    "camera binary": (content("camera.yaml", bytes(range(256))), ["camera.yaml", "text"]),
    "camera tag": (content("camera.yaml", "a: !!python/object/apply:os.getcwd []"), ["camera.yaml", "YAML"]),
    "width missing": (text("camera.yaml", "image_width: 32\n", ""), ["camera.yaml", "image_width", "missing"]),
    "width zero": (text("camera.yaml", "image_width: 32", "image_width: 0"), ["image_width", "0"]),
    "width huge": (text("camera.yaml", "image_width: 32", "image_width: 99999999"), ["image_width", "99999999"]),
    "width a word": (text("camera.yaml", "image_width: 32", "image_width: wide"), ["image_width", "wide"]),
    "matrix short": (text("camera.yaml", ", 0, 0, 1]}", "]}"), ["camera_matrix", "6", "9"]),
    "focal length zero": (text("camera.yaml", "data: [30", "data: [0"), ["camera_matrix", "fx"]),
    "focal length nan": (text("camera.yaml", "data: [30", "data: [.nan"), ["camera_matrix", "nan"]),
    "model unknown": (text("camera.yaml", "plumb_bob", "fisheye"), ["distortion_model", "fisheye", "equidistant"]),
    "coefficients": (text("camera.yaml", "-0.1, 0.02, ", ""), ["distortion_coefficients", "3", "5"]),
    # images.txt
    "list empty": (content("images.txt", "# nothing\n"), ["images.txt", "no image"]),
    "list without paths": (content("images.txt", "10.1\n"), ["images.txt:1", "path"]),
    "list without times": (content("images.txt", "images/0.jpg 10.1\n"), ["images.txt:1", "time stamp"]),
    "image outside": (
        text("images.txt", "images/1.jpg", "../secret.jpg"),
        ["images.txt:3", "../secret.jpg", "outside"],
    ),
    "image outside, hidden": (text("images.txt", "images/1.jpg", "images/../../s.jpg"), ["images.txt:3", "outside"]),
    "image absolute": (text("images.txt", "images/1.jpg", "/etc/hostname"), ["images.txt:3", "outside"]),
    "image time back": (text("images.txt", "10.230000", "10.030000"), ["images.txt", "not increasing", "image 2"]),
    "image time nan": (text("images.txt", "10.230000", "nan"), ["images.txt", "image 2", "nan"]),
    "image of another size": (larger_image, ["3.jpg", "64 x 48", "32 x 24"]),
    "no image readable": (all_images_damaged, ["images", "5 images"]),
    "images on another clock": (clock_of_its_own("images.txt"), ["images.txt", "overlap", "clock"]),
    # odometry.txt
    "odometry empty": (content("odometry.txt", "#\n"), ["odometry.txt", "no pose"]),
    "odometry columns": (text("odometry.txt", " 0 0 0 0 0 0 1", " 0 0 0"), ["odometry.txt:1", "4 columns", "8"]),
    "odometry words": (text("odometry.txt", " 0 0 0 0 0 0 1", " a b c d e f g"), ["odometry.txt:1", "numbers"]),
    "odometry nan": (text("odometry.txt", " 0 0 0 0 0 0 1", " nan 0 0 0 0 0 1"), ["odometry.txt", "pose 0", "nan"]),
    "odometry quaternion": (text("odometry.txt", "0 0 0 1", "0 0 0 0"), ["odometry.txt", "pose 0", "norm 0"]),
    "odometry time": (text("odometry.txt", "10.200000", "10.100000"), ["odometry.txt", "not increasing", "pose 2"]),
    "odometry binary": (content("odometry.txt", bytes(range(256))), ["odometry.txt", "text"]),
    "odometry on another clock": (clock_of_its_own("odometry.txt"), ["odometry.txt", "overlap", "clock"]),
    # extrinsics.yaml
    "extrinsics date": (content("extrinsics.yaml", "a: 2001-99-99"), ["extrinsics.yaml"]),
    "extrinsics deep": (content("extrinsics.yaml", "[" * 5000), ["extrinsics.yaml"]),
    "extrinsics digits": (extrinsics(translation=f"[0, 0, {'1' * 5000}]"), ["extrinsics.yaml"]),
    "extrinsics huge": (extrinsics(translation=f"[0, 0, {'1' * 500}]"), ["extrinsics.yaml", "translation"]),
    "extrinsics empty": (content("extrinsics.yaml", ""), ["extrinsics.yaml", "mapping"]),
    "extrinsics key": (content("extrinsics.yaml", "a: 1"), ["extrinsics.yaml", "platform_from_camera", "missing"]),
    "extrinsics short": (extrinsics(translation="[1, 2]"), ["translation", "2", "3"]),
    "extrinsics nan": (extrinsics(translation="[0, 0, .nan]"), ["translation", "nan"]),
    "extrinsics quaternion": (extrinsics(quaternion="[0, 0, 0, 0]"), ["quaternion_xyzw", "norm 0"]),
    "extrinsics quaternion long": (extrinsics(quaternion="[1, 1, 1, 1]"), ["quaternion_xyzw", "norm 2"]),
    "extrinsics under the floor": (extrinsics(translation="[0.1, 0, -0.2]"), ["height", "-0.2"]),
}


@pytest.mark.parametrize("name", CASES)
def test_damaged_sequence_is_one_line(name: str, tiny_sequence: Path, tmp_path: Path, run_recon: Any) -> None:
    damage, fragments = CASES[name]
    damage(tiny_sequence)
    (tmp_path / "out").mkdir()
    result = run_recon("build", tiny_sequence, "-o", tmp_path / "out" / "model.usd")
    assert result.status == 2
    assert len(result.errors) == 1, result.errors
    assert result.errors[0].startswith("recon: ")
    for fragment in fragments:
        assert fragment in result.errors[0]
    assert result.output == []
    assert list((tmp_path / "out").iterdir()) == []


def test_undamaged_sequence_is_accepted(tiny_sequence: Path, run_recon: Any) -> None:
    """Without this, every case above could fail for a reason of the fixture's."""
    result = run_recon("inspect", tiny_sequence)
    assert (result.status, result.errors) == (0, [])


@pytest.mark.parametrize(
    ("outputs", "fragments"),
    [
        (["model.foo"], ["model.foo", ".usd", ".glb", ".dxf"]),
        (["model"], ["model", "suffix"]),
        (["good.glb", "model.foo"], ["model.foo"]),
        (["missing/model.usd"], ["missing", "does not exist"]),
        (["model.glb", "model.glb"], ["model.glb", "twice"]),
        (["/proc/model.usd"], ["/proc"]),
    ],
)
def test_bad_output_is_one_line_before_any_work(
    outputs: list[str], fragments: list[str], tiny_sequence: Path, tmp_path: Path, run_recon: Any
) -> None:
    shutil.rmtree(tiny_sequence)  # outputs are looked at first: a missing sequence is not what is complained about
    arguments = [part for name in outputs for part in ("-o", tmp_path / name)]
    result = run_recon("build", tiny_sequence, *arguments)
    assert result.status == 2
    assert len(result.errors) == 1, result.errors
    for fragment in fragments:
        assert fragment in result.errors[0]
    assert list(tmp_path.iterdir()) == []


def test_work_folder_of_something_else_is_left_alone(tiny_sequence: Path, tmp_path: Path, run_recon: Any) -> None:
    (tmp_path / "model.recon").mkdir()
    (tmp_path / "model.recon" / "thesis.tex").write_text("years of work")
    result = run_recon("build", tiny_sequence, "-o", tmp_path / "model.usd")
    assert result.status == 2
    assert "model.recon" in result.errors[0]
    assert (tmp_path / "model.recon" / "thesis.tex").read_text() == "years of work"


@pytest.mark.parametrize("command", ["export", "eval"])
def test_missing_result_folder_is_one_line(command: str, tiny_sequence: Path, tmp_path: Path, run_recon: Any) -> None:
    arguments = {"export": ["-o", tmp_path / "m.glb"], "eval": []}[command]
    folders = [tmp_path / "none.recon"] if command == "export" else [tiny_sequence, tmp_path / "none.recon"]
    result = run_recon(command, *folders, *arguments)
    assert result.status == 2
    assert len(result.errors) == 1, result.errors
    assert "Traceback" not in result.errors[0]


@pytest.mark.parametrize("damage", ["half", "two bytes", "zeros", "noise", "nothing", "text"])
def test_corrupt_image_is_skipped_with_a_warning(
    damage: str, tiny_sequence: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = tiny_sequence / "images" / "2.jpg"
    data = bytearray(path.read_bytes())
    middle = len(data) * 2 // 3
    damaged: dict[str, bytes | bytearray] = {
        "half": data[:middle],
        "two bytes": data[:-2],
        "zeros": data[:middle] + bytes(len(data) - middle),
        "noise": np.random.default_rng(1).integers(0, 256, 900, dtype=np.uint8).tobytes(),
        "nothing": b"",
        "text": b"not a picture at all",
    }
    path.write_bytes(damaged[damage])
    sequence = read_sequence(tiny_sequence)
    assert sequence.images is not None
    assert sequence.camera is not None
    warnings: list[str] = []
    for _ in range(2):
        images = dict(iterate_images(sequence.images, sequence.camera, warnings=warnings))
    assert [image is None for image in images.values()] == [False, False, True, False, False]
    assert len(warnings) == 1
    assert "images/2.jpg" in warnings[0]
    assert capfd.readouterr().err == ""


def test_padding_bytes_of_cheap_cameras_do_not_cost_the_image(tiny_sequence: Path) -> None:
    path = tiny_sequence / "images" / "2.jpg"
    data = path.read_bytes()
    sequence = read_sequence(tiny_sequence)
    assert sequence.images is not None
    assert sequence.camera is not None
    whole = load_image(sequence.images, 2, sequence.camera)
    path.write_bytes(data[:-2] + b"\x11\x22\x33" + data[-2:])
    padded = load_image(sequence.images, 2, sequence.camera)
    assert whole is not None
    np.testing.assert_array_equal(padded, whole)


def test_image_that_changes_size_after_reading_the_folder(tiny_sequence: Path) -> None:
    sequence = read_sequence(tiny_sequence)
    assert sequence.images is not None
    assert sequence.camera is not None
    larger_image(tiny_sequence)
    with pytest.raises(InputError, match="64 x 48"):
        list(iterate_images(sequence.images, sequence.camera))


def test_nan_and_no_return_are_legal(tiny_sequence: Path) -> None:
    scans_cell(np.nan)(tiny_sequence)
    scans_cell(np.inf, (1, 4))(tiny_sequence)
    scans_cell(0.0, (1, 5))(tiny_sequence)
    sequence = read_sequence(tiny_sequence)
    assert [len(sequence.scans.points(i)) for i in range(6)] == [90, 88, 89, 90, 90, 90]


@pytest.mark.parametrize("seed", range(40))
def test_random_damage_never_ends_in_a_traceback(seed: int, tiny_sequence: Path) -> None:
    """Bytes of one file overwritten or cut: it is read, or refused with an InputError, and nothing else."""
    extrinsics()(tiny_sequence)
    rng = np.random.default_rng(seed)
    names = ["scans.npz", "camera.yaml", "images.txt", "odometry.txt", "extrinsics.yaml"]
    path = tiny_sequence / names[seed % len(names)]
    data = bytearray(path.read_bytes())
    for place in rng.integers(0, len(data), 1 + seed // 8):
        data[place] = rng.integers(0, 256)
    path.write_bytes(data[: rng.integers(1, len(data))] if seed % 3 == 0 else data)
    try:
        sequence = read_sequence(tiny_sequence)
    except InputError as error:
        assert "\n" not in str(error)
        assert str(tiny_sequence) in str(error)
    else:
        assert json.dumps(sequence.warnings)
        assert len(sequence.scans) > 0
