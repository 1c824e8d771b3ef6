"""`recon bench paper`: scans made from labels and layouts, image sets, and the table."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from box_room import FISHEYE, SIZE, WIDE, box_layout

from recon.config import Config, TextureConfig
from recon.errors import InputError
from recon.evaluate.contour import ALL_ROUND, bearings, contour_ranges, layout_ranges
from recon.evaluate.image_set import ImageSet, find_image_sets, mounting_pose, read_image_set, read_mounting
from recon.evaluate.labels import LabelScores
from recon.evaluate.paper import SetScores, as_sequence, run_set, table
from recon.faces import extrude
from recon.geometry import Array, Pose3
from recon.labels import OBJECT, LabelRenderer
from recon.sequence.camera import Camera
from recon.sequence.groundtruth import read_groundtruth
from recon.sequence.images import read_image_list
from recon.sequence.intrinsics import read_camera
from recon.sequence.write import write_camera
from recon.simulate import Plan, simulate

POSE = (1.2, 1.0, 0.4)
COARSE = Config(texture=TextureConfig(metres_per_texel=0.03))
"""No picture is looked at."""


def box_ranges(pose: tuple[float, float, float], angles: Array) -> Array:
    """By plain arithmetic: from a planar pose to the sides of the box, which begins at the origin."""
    direction = np.stack([np.cos(angles + pose[2]), np.sin(angles + pose[2])], axis=1)
    with np.errstate(divide="ignore"):
        return np.asarray((np.where(direction > 0, SIZE[:2] - pose[:2], pose[:2]) / np.abs(direction)).min(axis=1))


def test_scan_of_a_layout() -> None:
    for pose in (POSE, (4.0, 0.5, -2.0)):
        np.testing.assert_allclose(layout_ranges(box_layout().walls, np.array(pose)), box_ranges(pose, ALL_ROUND))
    alone = layout_ranges(box_layout().walls[:1], np.array(POSE))
    assert np.isinf(alone).sum() > 180, "one wall does not surround the platform"


@pytest.mark.parametrize("camera", [WIDE, FISHEYE], ids=["plumb_bob", "equidistant"])
@pytest.mark.parametrize(("tilt", "roll"), [(0.0, 0.0), (12.0, 2.0)])
def test_scan_of_a_label_image(camera: Camera, tilt: float, roll: float) -> None:
    """The box's true labels give its walls back within a centimetre or three, wherever their feet are in the image."""
    mounting = mounting_pose(1.1, tilt, roll)
    labels = LabelRenderer(extrude(box_layout()), camera).render(Pose3.from_planar(POSE) @ mounting)
    found, angles = contour_ranges(labels, camera, mounting), bearings(camera, mounting)
    shown = np.isfinite(found)
    assert shown.sum() > 40
    assert np.abs(found - box_ranges(POSE, angles))[shown].max() < 0.03
    np.testing.assert_allclose(np.degrees(angles), np.round(np.degrees(angles)), atol=1e-9)


def test_what_hides_a_wall_hides_it_from_the_scan() -> None:
    mounting = mounting_pose(1.1, 12.0, 0.0)
    labels = LabelRenderer(extrude(box_layout()), WIDE).render(Pose3.from_planar(POSE) @ mounting)
    free = np.isfinite(contour_ranges(labels, WIDE, mounting))
    middle = WIDE.width // 2
    labels[:, middle:] = OBJECT
    half = contour_ranges(labels, WIDE, mounting)
    assert np.isinf(half[bearings(WIDE, mounting) < np.radians(-2)]).all(), "to the right everything stands behind it"
    assert np.isfinite(half).sum() == pytest.approx(free[bearings(WIDE, mounting) > 0].sum(), abs=2)


def test_mounting(tmp_path: Path) -> None:
    path = tmp_path / "mounting.yaml"
    path.write_text("camera_height: 0.9\n")
    level = read_mounting(path)
    np.testing.assert_allclose(
        level.apply([[0, 0, 1], [1, 0, 0], [0, 1, 0]]), [[1, 0, 0.9], [0, -1, 0.9], [0, 0, -0.1]]
    )
    path.write_text("camera_height: 1.0\ntilt_deg: 45\n")
    ahead, _, _ = read_mounting(path).apply([[0, 0, 1], [1, 0, 0], [0, 0, 0]])
    np.testing.assert_allclose(ahead, [np.sqrt(0.5), 0, 1 - np.sqrt(0.5)], atol=1e-12)
    path.write_text("camera_height: 1.0\nroll_deg: 30\n")
    np.testing.assert_allclose(read_mounting(path).apply([[1, 0, 0]]), [[0, -np.sqrt(0.75), 0.5]], atol=1e-12)
    for text, fragment in (("tilt_deg: 3\n", "camera_height is missing"), ("camera_height: 0\n", "height above 0 m"),
                           ("camera_height: high\n", "camera_height holds high")):  # fmt: skip
        path.write_text(text)
        with pytest.raises(InputError, match=fragment):
            read_mounting(path)


CEILING = np.full((WIDE.height, WIDE.width), 2, np.uint16)


def write_box_set(folder: Path, stems: list[str], unlabelled: tuple[str, ...] = ()) -> None:
    """Images and labels of the box, the camera going ahead by 15 cm an image."""
    for part in ("images", "labels"):
        (folder / part).mkdir(parents=True)
    write_camera(folder / "camera.yaml", WIDE)
    (folder / "mounting.yaml").write_text("camera_height: 1.1\ntilt_deg: 12\n")
    renderer = LabelRenderer(extrude(box_layout()), WIDE)
    for k, stem in enumerate(stems):
        pose = Pose3.from_planar((1.0 + 0.15 * k, 1.0, 0.4)) @ mounting_pose(1.1, 12.0, 0.0)
        labels = renderer.render(pose)
        assert cv2.imwrite(str(folder / "images" / f"{stem}.png"), (labels * 15).astype(np.uint8))
        if stem not in unlabelled:
            assert cv2.imwrite(str(folder / "labels" / f"{stem}.png"), labels)


def test_image_set(tmp_path: Path) -> None:
    """In the order of the numbers; images without labels are left out; noise as asked for, the same again."""
    write_box_set(tmp_path / "set", ["f2", "f10", "f1", "f3"], ("f3",))
    (image_set,) = find_image_sets(tmp_path)
    assert (image_set.name, len(image_set)) == ("set", 3)
    assert image_set.images.names == ("images/f1.png", "images/f2.png", "images/f10.png")
    assert image_set.images.timestamps.tolist() == [0.0, 0.5, 1.5]
    assert [path.stem for path in image_set.labels] == ["f1", "f2", "f10"]
    clean, noisy = (as_sequence(image_set, noise, 4).scans.ranges for noise in (0.0, 0.05))
    shown = np.isfinite(clean)
    assert shown.sum() > 100 and (shown == np.isfinite(noisy)).all()
    error = (noisy - clean)[shown]
    assert 0.04 < error.std() < 0.06 and abs(error.mean()) < 0.012
    assert np.array_equal(as_sequence(image_set, 0.05, 4).scans.ranges, noisy)
    assert as_sequence(image_set, 0.0, 4).platform_from_camera is None, "the camera's pose is estimated"


def scores(name: str, images: int, accuracy: float) -> SetScores:
    return SetScores(name, False, LabelScores(images, accuracy, accuracy, ()))


def test_table_has_the_papers_rows_and_ours() -> None:
    lines = table([scores("Dataset_L", 30, 0.98), scores("plus", 10, 0.9), scores("mine", 40, 1.0)]).splitlines()
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    assert cells[0] == ["", "Dataset L", "Dataset +", "Dataset T1", "mine", "Overall"]
    assert cells[2] == ["proposed method (the paper)", "95.64%", "97.24%", "98.09%", "-", "96.59%"]
    assert cells[3] == ["Tsai and Kuipers 2012", "91.00%", "94.23%", "92.71%", "-", "92.12%"]
    assert cells[4] == ["images", "90", "30", "41", "-", "167"]
    assert cells[5] == ["recon", "98.00%", "90.00%", "-", "100.00%", "98.00%"]
    assert cells[6] == ["its images", "30", "10", "-", "40", "80"]
    assert len({len(line) for line in lines}) == 1, "aligned"


@pytest.fixture(scope="module")
def small_set(tmp_path_factory: pytest.TempPathFactory) -> ImageSet:
    """A level camera through a 6 m x 4 m L of a room, 320 x 240 pixels, with the true layout and poses."""
    scratch = tmp_path_factory.mktemp("paper")
    level = dict.fromkeys(("x", "y", "tilt_deg", "roll_deg", "yaw_deg"), 0.0)
    camera = level | {"image_width": 320, "image_height": 240, "fx": 260, "fy": 260, "height": 1.0, "rate": 2.0}
    outline = [[0, 0], [6, 0], [6, 4], [3.5, 4], [3.5, 2.2], [0, 2.2]]
    plan = {"rooms": [{"polygon": outline}], "path": [[0.7, 1.1], [4.6, 1.2], [4.8, 2.6]], "camera": camera,
            "drive": {"speed": 0.5, "turn_rate": 0.5}}  # fmt: skip
    simulate(Plan.from_dict(plan), scratch / "drive", 0)
    folder = scratch / "L"
    folder.mkdir()
    truth = scratch / "drive" / "groundtruth"
    (scratch / "drive" / "images").rename(folder / "images")
    (truth / "labels").rename(folder / "labels")
    for path in (scratch / "drive" / "camera.yaml", scratch / "drive" / "images.txt", truth / "layout.json",
                 truth / "camera_trajectory.txt"):  # fmt: skip
        path.rename(folder / path.name)
    (folder / "mounting.yaml").write_text("camera_height: 1.0\n")
    return read_image_set(folder)


def test_bench_on_a_small_set(small_set: ImageSet, tmp_path: Path) -> None:
    assert small_set.layout is not None and small_set.poses is not None
    assert as_sequence(small_set, 0.02, 0).scans.ranges.shape == (len(small_set), 360)
    found = run_set(small_set, COARSE, 0.02, tmp_path / "L.recon")
    assert found.all_round and found.labels.images == len(small_set) > 10
    assert 0.95 < found.labels.accuracy <= 1.0
    assert (tmp_path / "L.recon" / "layout.json").is_file()


def test_labels_and_layout_make_the_same_scan(small_set: ImageSet) -> None:
    """Two ways to the contour: from label images in the field of view, and from the layout at the true poses."""
    from_layout = as_sequence(small_set, 0.0, 0).scans
    from_labels = as_sequence(replace(small_set, layout=None), 0.0, 0).scans
    column = round((from_labels.angle_min - from_layout.angle_min) / from_layout.angle_increment)
    same = from_layout.ranges[:, column : column + from_labels.ranges.shape[1]]
    shown = np.isfinite(from_labels.ranges)
    assert shown.mean() > 0.5
    error = np.abs(from_labels.ranges - same)[shown]
    assert np.quantile(error, 0.9) < 0.05 and np.median(error) < 0.015


def test_corridor_as_an_image_set(shared_data: Callable[[str], Path], tmp_path: Path) -> None:
    """The label images of the path-traced corridor lead back to its walls, but where doors are recessed."""
    folder = shared_data("corridor")
    truth = read_groundtruth(folder)
    assert truth.layout is not None and truth.camera_trajectory is not None and truth.labels is not None
    mounting = mounting_pose(0.95, 14.0, 1.5)
    errors = []
    camera = read_camera(folder / "camera.yaml")
    names = read_image_list(folder / "images.txt").names
    for name, pose in list(zip(names, truth.camera_trajectory.poses, strict=True))[::6]:
        labels = np.asarray(cv2.imread(str(truth.label_path(name)), cv2.IMREAD_UNCHANGED), dtype=np.uint16)
        axis = pose.rotation[:2, 2]
        here = np.array([*pose.translation[:2], np.arctan2(axis[1], axis[0])])
        angles = np.round(np.degrees(bearings(camera, mounting))).astype(int)
        errors.append(contour_ranges(labels, camera, mounting) - layout_ranges(truth.layout.walls, here)[angles + 180])
    size = np.abs(np.concatenate(errors))
    assert np.median(size[np.isfinite(size)]) < 0.035 and np.quantile(size[np.isfinite(size)], 0.9) < 0.15


@pytest.mark.parametrize(
    ("spoil", "fragment"),
    [
        (lambda f: (f / "set" / "camera.yaml").unlink(), "holds no camera.yaml"),
        (lambda f: (f / "set" / "mounting.yaml").unlink(), "mounting.yaml: no such file"),
        (lambda f: (f / "set" / "labels").rename(f / "set" / "label"), "labels: no such folder"),
        (lambda f: (f / "set" / "labels" / "b.png").unlink(), "1 of 2 images have a label image"),
        (lambda f: (f / "set" / "labels" / "b.png").write_bytes(b"none"), "b.png: is no PNG with one channel"),
        (lambda f: (f / "set" / "odometry.txt").write_text("0 0 0 0 0 0 0 1\n"), "odometry.txt: needs images.txt"),
        (lambda f: cv2.imwrite(str(f / "set" / "labels" / "b.png"), np.zeros((9, 9), np.uint16)), "is 9 x 9 pixels"),
        (lambda f: [cv2.imwrite(str(f / "set" / "labels" / f"{s}.png"), CEILING) for s in "ab"], "shows a wall (10"),
    ],
)  # fmt: skip
def test_wrong_folders_are_one_line(
    spoil: Callable[[Path], Any], fragment: str, tmp_path: Path, run_recon: Callable[..., Any]
) -> None:
    write_box_set(tmp_path / "set", ["a", "b"])
    spoil(tmp_path)
    done = run_recon("bench", "paper", tmp_path)
    assert done.status == 2
    assert len(done.errors) == 1 and fragment in done.errors[0], done.errors


def test_no_folder_is_one_line(tmp_path: Path, run_recon: Callable[..., Any]) -> None:
    done = run_recon("bench", "paper", tmp_path / "none")
    assert (done.status, len(done.errors)) == (2, 1)
    assert "no such folder, expected image sets" in done.errors[0]
