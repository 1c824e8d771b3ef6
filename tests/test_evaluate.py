"""Published metrics: against evo, against cases whose scores are known, and against damaged files."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from evo.core import metrics
from evo.core.sync import associate_trajectories
from evo.core.trajectory import PoseTrajectory3D
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from recon.evaluate import evaluate, plot_result
from recon.evaluate.extrinsics import extrinsics_errors
from recon.evaluate.labels import label_scores
from recon.evaluate.trajectory import trajectory_errors
from recon.evaluate.walls import wall_scores
from recon.geometry import Array, Pose3, compose2, inverse2
from recon.graph.estimate import MapEstimate
from recon.layout_json import layout_to_json
from recon.model import Layout, Wall
from recon.results.accuracy import read_closures, read_scan_residuals, read_sigmas, write_accuracy
from recon.sequence.extrinsics import write_extrinsics
from recon.sequence.trajectory import Trajectory
from recon.sequence.tum import write_planar


def random_drive(seed: int, poses: int = 150) -> Trajectory:
    """A drive of smooth random turns, some 40 m long, with jittered time stamps."""
    rng = np.random.default_rng(seed)
    pose, way = np.zeros(3), []
    for turn in np.convolve(rng.normal(size=poses + 8) * 0.3, np.full(9, 1 / 9), mode="valid"):
        pose = compose2(pose, [0.25, 0.0, turn])
        way.append(pose)
    return Trajectory(100 + np.cumsum(rng.uniform(0.08, 0.12, poses)), np.array(way))


def disturbed(truth: Trajectory, seed: int, sigma: float = 0.05) -> Trajectory:
    """In another map frame, drifting and noisy, every fifth pose left out, stamps off by up to 4 ms."""
    rng = np.random.default_rng(seed)
    noise = rng.normal(size=(len(truth), 3)) * [sigma, sigma, 0.02]
    drift = np.cumsum(rng.normal(size=(len(truth), 3)) * [0.005, 0.005, 0.001], axis=0)
    poses = compose2(compose2([3.0, -8.0, 2.5], truth.poses), noise + drift)
    kept = np.arange(len(truth)) % 5 != 3
    return Trajectory((truth.timestamps + rng.uniform(-0.004, 0.004, len(truth)))[kept], poses[kept])


def as_evo(trajectory: Trajectory) -> PoseTrajectory3D:
    xyz = np.column_stack([trajectory.poses[:, :2], np.zeros(len(trajectory))])
    quaternions = Rotation.from_euler("z", trajectory.poses[:, 2:]).as_quat()[:, [3, 0, 1, 2]]
    return PoseTrajectory3D(xyz, quaternions, trajectory.timestamps)


@pytest.mark.parametrize("seed", range(4))
def test_trajectory_errors_are_evos(seed: int) -> None:
    truth = random_drive(seed)
    estimate = disturbed(truth, seed + 100)
    found = trajectory_errors(estimate, truth)
    reference, other = associate_trajectories(as_evo(truth), as_evo(estimate), max_diff=0.01)
    other.align(reference)
    statistics = {}
    for name, metric in (
        ("ate", metrics.APE(metrics.PoseRelation.translation_part)),
        ("heading", metrics.APE(metrics.PoseRelation.rotation_angle_deg)),
        ("rpe", metrics.RPE(metrics.PoseRelation.translation_part, 1, metrics.Unit.frames)),
        ("rpe_rotation", metrics.RPE(metrics.PoseRelation.rotation_angle_deg, 1, metrics.Unit.frames)),
    ):
        metric.process_data((reference, other))
        statistics[name] = metric.get_all_statistics()
    assert found.poses == reference.num_poses == len(estimate)
    for name, values in statistics.items():
        assert getattr(found, name) == pytest.approx(values["rmse"], rel=1e-6), name
    assert found.ate_max == pytest.approx(statistics["ate"]["max"], rel=1e-6)
    assert found.ate > 0.03 and found.heading > 0.5


def test_a_trajectory_has_no_error_in_any_map_frame() -> None:
    truth = random_drive(7)
    moved = Trajectory(truth.timestamps, compose2([-4.0, 2.0, -3.0], truth.poses))
    found = trajectory_errors(moved, truth)
    assert max(found.ate_max, found.heading, found.rpe, found.rpe_rotation) < 1e-9


def wall(number: int, start: tuple[float, float], end: tuple[float, float]) -> Wall:
    return Wall(number, np.array(start), np.array(end), 0.003, 0.001, "lidar", 20)


SQUARE = tuple(
    wall(i, a, b) for i, (a, b) in enumerate([((0, 0), (4, 0)), ((4, 0), (4, 4)), ((4, 4), (0, 4)), ((0, 4), (0, 0))])
)


def test_walls_right_in_place_score_one() -> None:
    scores = wall_scores(SQUARE, SQUARE)
    assert scores.accuracy == scores.completeness == scores.f1 == (1.0, 1.0, 1.0)
    assert scores.median_distance < 1e-9


def test_a_wall_off_by_three_centimetres_misses_two_only() -> None:
    """One wall of four lies 3 cm inside; nothing else changes."""
    moved = (*SQUARE[:3], wall(3, (0.03, 4), (0.03, 0)))
    scores = wall_scores(moved, SQUARE)
    np.testing.assert_allclose(scores.accuracy, [0.75, 1.0, 1.0], atol=0.01)
    np.testing.assert_allclose(scores.completeness, [0.75, 1.0, 1.0], atol=0.01)


def test_missing_and_invented_walls_cost_their_own_share() -> None:
    """Three of four walls, and a wall of the same length where none is."""
    found = (*SQUARE[:3], wall(3, (2, 1), (2, 5)))
    scores = wall_scores(found, SQUARE)
    np.testing.assert_allclose(scores.accuracy, 0.75, atol=0.03)
    np.testing.assert_allclose(scores.completeness, 0.75, atol=0.03)
    only = wall_scores(SQUARE[:1], SQUARE)
    np.testing.assert_allclose(only.accuracy, 1.0)
    np.testing.assert_allclose(only.completeness, 0.25, atol=0.03)
    np.testing.assert_allclose(only.f1, 0.4, atol=0.04)


def test_a_wall_seen_from_its_back_is_another() -> None:
    """The two faces of a thin wall are not taken for each other, though 8 cm apart."""
    faces = (wall(0, (0, 0), (4, 0)), wall(1, (4, -0.08), (0, -0.08)))
    scores = wall_scores(faces[:1], faces)
    assert scores.accuracy == (1.0, 1.0, 1.0)
    np.testing.assert_allclose(scores.completeness, 0.5)
    turned = wall_scores((wall(0, (4, 0), (0, 0)),), faces[:1])
    assert turned.accuracy == turned.completeness == turned.f1 == (0.0, 0.0, 0.0)
    assert np.isnan(turned.median_distance)


def test_no_wall_found_scores_nothing() -> None:
    scores = wall_scores((), SQUARE)
    assert scores.accuracy == scores.completeness == (0.0, 0.0, 0.0)


Labels = NDArray[np.uint16]


def write_labels(folder: Path, **images: Any) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for stem, image in images.items():
        assert cv2.imwrite(str(folder / f"{stem}.png"), np.asarray(image))


def scores_of(tmp_path: Path, mine: dict[str, Labels], theirs: dict[str, Labels]) -> Any:
    write_labels(tmp_path / "mine", **mine)
    write_labels(tmp_path / "theirs", **theirs)
    return label_scores([(tmp_path / "mine" / f"{s}.png", tmp_path / "theirs" / f"{s}.png") for s in sorted(theirs)])


def view(*columns: tuple[int, int]) -> Labels:
    """10 rows of columns (label, width); the lowest two rows are floor."""
    image = np.concatenate([np.full((10, width), label, np.uint16) for label, width in columns], axis=1)
    image[8:] = 1
    return image


def test_wall_ids_may_be_others_but_the_same_over_the_drive(tmp_path: Path) -> None:
    theirs = {"a": view((10, 6), (11, 4)), "b": view((11, 5), (12, 5))}
    renamed = {"a": view((31, 6), (10, 4)), "b": view((10, 5), (200, 5))}
    assert scores_of(tmp_path, renamed, theirs).accuracy == 1.0
    # 10 now stands for two walls: for the one in b that more pixels show, so that its 4 columns of a are wrong
    swapped_later = {"a": renamed["a"], "b": view((200, 5), (10, 5))}
    scores = scores_of(tmp_path, swapped_later, theirs)
    assert scores.accuracy == pytest.approx((48 + 40 + 40 + 2 * 20) / 200)
    assert scores.worst[0] == ("a", pytest.approx(0.68))


def test_a_split_wall_counts_once(tmp_path: Path) -> None:
    """Of a wall found as two, the larger part (6 of 10 columns) is right; floor is."""
    scores = scores_of(tmp_path, {"a": view((10, 6), (11, 4))}, {"a": view((10, 10))})
    assert scores.accuracy == pytest.approx((6 * 8 + 20) / 100)
    merged = scores_of(tmp_path, {"a": view((10, 10))}, {"a": view((10, 6), (11, 4))})
    assert merged.accuracy == pytest.approx((6 * 8 + 20) / 100)


def test_unlabelled_and_ceiling_are_not_scored(tmp_path: Path) -> None:
    truth = view((10, 10))
    truth[0], truth[1] = 2, 0
    estimate = view((10, 10))
    estimate[0], estimate[1] = 12, 3
    assert scores_of(tmp_path, {"a": estimate}, {"a": truth}).accuracy == 1.0
    estimate[2] = 3  # an object where the wall is
    assert scores_of(tmp_path, {"a": estimate}, {"a": truth}).accuracy == pytest.approx(70 / 80)


def test_label_scores_name_the_worst_and_need_a_pair(tmp_path: Path) -> None:
    theirs = {stem: view((10, 10)) for stem in "abc"}
    mine = theirs | {"b": view((3, 5), (10, 5)), "c": view((3, 1), (10, 9))}
    scores = scores_of(tmp_path, mine, theirs)
    assert [stem for stem, _ in scores.worst] == ["b", "c", "a"]
    assert scores.median_image == pytest.approx(0.92)
    assert scores.images == 3
    assert label_scores([]) is None


def test_extrinsics_errors_are_those_put_in() -> None:
    truth = Pose3(Rotation.from_euler("xyz", [-105, 1.5, -92], degrees=True).as_matrix(), np.array([0.1, -0.03, 0.95]))
    yawed = Pose3(Rotation.from_euler("z", 2, degrees=True).as_matrix() @ truth.rotation, truth.translation)
    found = extrinsics_errors(yawed, truth)
    assert found.rotation == pytest.approx(2.0)
    assert found.tilt == pytest.approx(0.0, abs=1e-5)
    tilted = Pose3(
        Rotation.from_euler("x", 0.7, degrees=True).as_matrix() @ truth.rotation,
        truth.translation + np.array([0.02, -0.01, 0.03]),
    )
    found = extrinsics_errors(tilted, truth)
    np.testing.assert_allclose([found.rotation, found.tilt], 0.7)
    np.testing.assert_allclose([found.x, found.y, found.height], [0.02, -0.01, 0.03])


@pytest.fixture
def result(tmp_path: Path) -> tuple[Path, Path]:
    """A sequence with every kind of ground truth but labels, and a result that is 2 cm and a little off."""
    sequence, folder, truth = tmp_path / "drive", tmp_path / "drive.recon", random_drive(3)
    (sequence / "groundtruth").mkdir(parents=True)
    folder.mkdir()
    truth = Trajectory(truth.timestamps, compose2(inverse2(truth.poses[0]), truth.poses))
    estimate = Trajectory(truth.timestamps, truth.poses + np.random.default_rng(0).normal(size=(150, 3)) * 0.02)
    write_planar(sequence / "groundtruth" / "trajectory.txt", truth)
    write_relations(sequence / "groundtruth" / "relations.txt", truth)
    write_planar(sequence / "odometry.txt", truth)
    (sequence / "groundtruth" / "layout.json").write_text(
        json.dumps(layout_to_json(Layout(SQUARE, (), ceiling_height=2.5)))
    )
    pose = Pose3(np.eye(3), np.array([0.1, 0.0, 1.0]))
    write_extrinsics(sequence / "groundtruth" / "extrinsics.yaml", pose)
    write_extrinsics(folder / "extrinsics.yaml", pose)
    write_planar(folder / "trajectory.txt", estimate)
    (folder / "layout.json").write_text(json.dumps(layout_to_json(Layout(SQUARE, (), ceiling_height=2.53))))
    (folder / "metrics.json").write_text(json.dumps({"residuals": {"lidar": 0.97, "odometry": 1.1}}))
    rng = np.random.default_rng(1)
    by_scan = {"lidar": rng.gamma(9, 1 / 9, 150), "odometry": np.where(np.arange(150) > 0, 1.1, np.nan)}
    pairs = np.array([[3, 120], [10, 90]])
    write_accuracy(folder, MapEstimate(estimate, np.full((150, 3), 0.02), (), closures=pairs, scan_residuals=by_scan))
    return sequence, folder


def write_relations(path: Path, truth: Trajectory) -> None:
    lines = []
    for k in range(0, 140, 7):
        x, y, yaw = compose2(inverse2(truth.poses[k]), truth.poses[k + 9])
        lines.append(f"{truth.timestamps[k]:.6f} {truth.timestamps[k + 9]:.6f} {x:.6f} {y:.6f} 0 0 0 {yaw:.6f}")
    lines.append("5.0 6.0 1 0 0 0 0 0")  # before the drive
    path.write_text("\n".join(lines) + "\n")


def test_everything_that_is_known_is_scored(result: tuple[Path, Path]) -> None:
    scores = evaluate(*result)
    assert scores.trajectory is not None and 0.02 < scores.trajectory.ate < 0.035
    assert scores.relations is not None and (scores.relations.used, scores.relations.left_out) == (20, 1)
    assert 0.015 < scores.relations.translation.mean < 0.08
    assert 0.5 < scores.relations.rotation.mean < 3.0
    assert scores.walls is not None and scores.walls.f1 == (1.0, 1.0, 1.0)
    assert scores.extrinsics is not None and scores.extrinsics.rotation < 1e-5
    assert scores.ceiling == pytest.approx(0.03)
    assert scores.labels is None
    content = json.loads(json.dumps(scores.to_json()))
    assert content["relations"]["translation"]["mean"] == scores.relations.translation.mean
    assert content["labels"] is None
    table = scores.table().splitlines()
    assert [line for line in table if line.startswith("relations used")] == [
        "relations used                20, 1 left out"
    ]


def test_relations_alone_are_enough(result: tuple[Path, Path]) -> None:
    """As the logs of the public benchmark have it: no layout, no trajectory, and here no odometry either."""
    sequence, folder = result
    for name in ("trajectory.txt", "layout.json", "extrinsics.yaml"):
        (sequence / "groundtruth" / name).unlink()
    (sequence / "odometry.txt").unlink()
    scores = evaluate(sequence, folder)
    assert scores.relations is not None and scores.relations.used == 20
    assert scores.trajectory is None and scores.walls is None and scores.ceiling is None
    assert len(scores.table().splitlines()) == 3


@pytest.mark.parametrize("suffix", ["png", "svg", "pdf"])
def test_plot_is_a_picture_and_the_same_again(suffix: str, result: tuple[Path, Path], tmp_path: Path) -> None:
    first, second = tmp_path / f"a.{suffix}", tmp_path / f"b.{suffix}"
    plot_result(*result, first)
    plot_result(*result, second)
    assert first.read_bytes() == second.read_bytes()
    assert len(first.read_bytes()) > 10_000
    if suffix == "png":
        image = cv2.imread(str(first))
        assert image is not None and image.shape[0] > 600
        for bgr in ([0x5E, 0xA3, 0xF0], [0xEB, 0x6F, 0x1F], [0x4F, 0x9E, 0x2E], [0x28, 0x28, 0xC6]):
            assert (np.abs(image.astype(int) - bgr).max(axis=2) < 24).sum() > 30  # truth, estimate, closures, worst


def test_plot_needs_no_sigmas_closures_or_residuals(result: tuple[Path, Path], tmp_path: Path) -> None:
    """Results of other programs: a trajectory and a layout."""
    for name in ("pose_sigmas.txt", "loop_closures.txt", "residuals.txt", "metrics.json"):
        (result[1] / name).unlink()
    (result[0] / "groundtruth" / "relations.txt").unlink()
    plot_result(*result, tmp_path / "plot.png")
    assert (tmp_path / "plot.png").stat().st_size > 10_000


def test_sigmas_and_closures_are_read_back(result: tuple[Path, Path]) -> None:
    stamps = random_drive(3).timestamps
    sigmas: Array = read_sigmas(result[1])
    np.testing.assert_allclose(sigmas[:, 0], stamps, atol=1e-6)
    np.testing.assert_allclose(sigmas[:, 1:], 0.02)
    np.testing.assert_allclose(read_closures(result[1]), stamps[[[3, 120], [10, 90]]], atol=1e-6)
    by_scan = read_scan_residuals(result[1])
    assert list(by_scan) == ["lidar", "odometry"]  # no image, no motion
    assert np.isnan(by_scan["odometry"][0])
    np.testing.assert_allclose(by_scan["odometry"][1:], 1.1)
    assert by_scan["lidar"].mean() == pytest.approx(1.0, abs=0.1)


def test_command_line(result: tuple[Path, Path], tmp_path: Path, run_recon: Callable[..., Any]) -> None:
    done = run_recon("eval", *result, "--json", tmp_path / "scores.json", "--plot", tmp_path / "plot.png")
    assert done.status == 0
    assert done.output == evaluate(*result).table().splitlines()
    assert json.loads((tmp_path / "scores.json").read_text())["relations"]["used"] == 20
    assert (tmp_path / "plot.png").read_bytes()[:4] == b"\x89PNG"


@pytest.mark.parametrize(
    ("name", "content", "fragments"),
    [
        ("drive/groundtruth/relations.txt", "1.0 2.0 0.1\n", ["relations.txt:1", "3 columns", "t1 t2 x y z"]),
        ("drive/groundtruth/relations.txt", "# none\n", ["relations.txt", "no relation"]),
        ("drive/groundtruth/relations.txt", "1 2 0 0 0 0 0 0\n", ["relations.txt", "none of its 1 relations"]),
        ("drive/groundtruth/trajectory.txt", "1.0 0 0 0 0 0 0 1\n2.0 0 0 0 0 0 0 1\n", ["0 of its 2 poses"]),
        ("drive/groundtruth/trajectory.txt", "1.0 0 0 nan 0 0 0 1\n", ["trajectory.txt", "not finite"]),
        ("drive/groundtruth/layout.json", "{", ["layout.json"]),
        ("drive.recon/trajectory.txt", "", ["drive.recon/trajectory.txt", "no pose"]),
        ("drive.recon/layout.json", '{"version": 9}', ["drive.recon/layout.json", "version is 9"]),
        ("drive.recon/pose_sigmas.txt", "1.0 0.1 0.1 0.1\n", ["pose_sigmas.txt", "1 poses, expected 150"]),
        ("drive.recon/pose_sigmas.txt", "1.0 0.1 -0.1 0.1\n", ["pose_sigmas.txt", "negative"]),
        ("drive.recon/residuals.txt", "1.0 2.0\n", ["residuals.txt:1", "2 columns"]),
        ("drive.recon/residuals.txt", "1.0 1 1 1 1\n", ["residuals.txt", "a row for each of 150 poses"]),
        ("drive.recon/loop_closures.txt", "1.0 a\n", ["loop_closures.txt:1", "not all numbers"]),
        ("drive.recon/metrics.json", '{"residuals": {"lidar": "good"}}', ["metrics.json", "damaged"]),
        ("drive.recon/extrinsics.yaml", "platform_from_camera: 3\n", ["drive.recon/extrinsics.yaml"]),
    ],
)
def test_damaged_files_are_one_line(
    name: str,
    content: str,
    fragments: list[str],
    result: tuple[Path, Path],
    tmp_path: Path,
    run_recon: Callable[..., Any],
) -> None:
    (tmp_path / name).write_text(content)
    done = run_recon("eval", *result, "--plot", tmp_path / "plot.png")
    assert done.status == 2
    assert len(done.errors) == 1, done.errors
    for fragment in fragments:
        assert fragment in done.errors[0]
    assert not (tmp_path / "plot.png").exists()


@pytest.mark.parametrize(("plot", "fragment"), [("plot.bmp", "'.bmp'"), ("none/plot.png", "does not exist")])
def test_plot_that_cannot_be_written(
    plot: str, fragment: str, result: tuple[Path, Path], tmp_path: Path, run_recon: Callable[..., Any]
) -> None:
    done = run_recon("eval", *result, "--plot", tmp_path / plot)
    assert done.status == 2
    assert len(done.errors) == 1 and fragment in done.errors[0]


def test_damaged_labels_are_one_line(result: tuple[Path, Path], run_recon: Callable[..., Any]) -> None:
    sequence, folder = result
    write_labels(sequence / "groundtruth" / "labels", a=view((10, 10)))
    for image, fragment in (
        (view((10, 9)), "is 9 x 10 pixels"),
        (view((10, 10)) + np.uint16(5000), "label 5010"),
        (np.zeros((10, 10, 3), np.uint8), "single-channel"),
    ):
        write_labels(folder / "labels", a=image)
        done = run_recon("eval", sequence, folder)
        assert done.status == 2
        assert len(done.errors) == 1 and fragment in done.errors[0] and "labels/a.png" in done.errors[0]


def test_nothing_to_compare_is_one_line(result: tuple[Path, Path], run_recon: Callable[..., Any]) -> None:
    sequence, folder = result
    for path in (sequence / "groundtruth").iterdir():
        path.unlink()
    done = run_recon("eval", sequence, folder)
    assert done.status == 2
    assert "nothing that can be compared" in done.errors[0]
