"""The whole build, on the sample that ships and on simulated buildings, against their ground truth."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from few_images import every_image

from recon.config import Config, TextureConfig
from recon.evaluate import Evaluation, evaluate
from recon.exporters import export
from recon.pipeline import Build, build
from recon.results import load_model, save_result
from recon.sequence.folder import read_sequence
from recon.simulate import random_plan, simulate

SAMPLE = Path(__file__).resolve().parents[1] / "samples" / "corridor"
COARSE = Config(texture=TextureConfig(metres_per_texel=0.03))
"""For tests that look at no picture."""


@dataclasses.dataclass(frozen=True)
class Result:
    """A build, its folder and how it compares."""

    build: Build
    folder: Path
    evaluation: Evaluation


def run(sequence: Path, folder: Path, config: Config = COARSE, every: int = 1, **changes: object) -> Result:
    drive = dataclasses.replace(every_image(every, read_sequence(sequence)), **changes)  # type: ignore[arg-type]
    built = build(drive, config)
    save_result(built, folder)
    return Result(built, folder, evaluate(sequence, folder))


@pytest.fixture(scope="session")
def sample(tmp_path_factory: pytest.TempPathFactory) -> Result:
    """samples/corridor as it is."""
    return run(SAMPLE, tmp_path_factory.mktemp("sample") / "corridor.recon", Config())


@pytest.fixture(scope="session")
def bare_sample(tmp_path_factory: pytest.TempPathFactory) -> Result:
    """samples/corridor without odometry, with every other image."""
    return run(SAMPLE, tmp_path_factory.mktemp("bare") / "corridor.recon", every=2, odometry=None)


def check_corridor(scores: Evaluation) -> None:
    """What the corridor's users rely on; lower bounds are what noise of 1 cm and 1 pixel allows."""
    assert scores.trajectory is not None and scores.extrinsics is not None
    assert scores.walls is not None and scores.labels is not None
    assert 1e-5 < scores.trajectory.ate < 0.01
    assert scores.trajectory.heading < 0.1
    assert abs(scores.extrinsics.x) < 0.03 and abs(scores.extrinsics.y) < 0.03
    assert abs(scores.extrinsics.height) < 0.02
    assert 1e-4 < scores.extrinsics.rotation < 0.2
    assert min(scores.walls.f1[1:]) > 0.97
    assert 1e-5 < scores.walls.median_distance < 0.005
    assert 0.965 < scores.labels.accuracy <= 1.0


def test_corridor_with_odometry(sample: Result) -> None:
    check_corridor(sample.evaluation)
    scale = sample.build.estimate.odometry_scale
    assert scale is not None and 0.97 < scale < 1.01  # its own truth file says 0.991
    layout = sample.build.model.layout
    assert len(layout.walls) == 6 and len(layout.rooms) == 1
    assert len([o for o in layout.openings if o.type == "door"]) in range(10, 13)
    assert sum(w.length for w in layout.walls) == pytest.approx(46.0, abs=0.3)


def test_corridor_without_odometry(bare_sample: Result) -> None:
    check_corridor(bare_sample.evaluation)
    assert bare_sample.build.estimate.odometry_scale is None


def test_the_result_folder_holds_what_it_should(sample: Result) -> None:
    names = {p.name for p in sample.folder.iterdir()}
    assert names >= {
        "layout.json", "trajectory.txt", "camera_trajectory.txt", "extrinsics.yaml", "labels", "textures", "overlays",
        "report.html", "metrics.json", "config.toml", "model.json",
    }  # fmt: skip
    images = read_sequence(SAMPLE).images
    assert images is not None
    stems = sorted(Path(name).stem for name in images.names)
    assert sorted(p.stem for p in (sample.folder / "labels").iterdir()) == stems
    label = cv2.imread(str(sample.folder / "labels" / f"{stems[0]}.png"), cv2.IMREAD_UNCHANGED)
    assert label is not None and label.dtype == np.uint16 and label.shape == (480, 640)
    metrics = json.loads((sample.folder / "metrics.json").read_text())
    assert metrics["counts"]["images"] == len(stems)
    assert set(metrics["seconds"]) >= {
        "scan matching",
        "image lines",
        "calibration",
        "factor graph",
        "layout",
        "texture",
    }
    assert len(metrics["fingerprint"]) == 64


def test_faces_are_textured_where_images_saw_them(sample: Result) -> None:
    faces = {f.name: f for f in sample.build.model.faces}
    assert len([n for n in faces if n.startswith("wall_")]) == 6
    textured = [f for f in faces.values() if f.kind == "wall" and f.texture is not None]
    assert len(textured) == 5  # no camera sees the wall behind the start
    assert all(0.2 < f.seen_fraction <= 1.0 and 0 < f.metres_per_texel <= 0.02 for f in textured)
    assert 0.5 < faces["floor_000"].seen_fraction < 1.0


def test_exports_from_the_result_folder_equal_those_of_the_build(sample: Result, tmp_path: Path) -> None:
    loaded = load_model(sample.folder)
    for suffix in (".glb", ".svg", ".stl"):
        export(sample.build.model, tmp_path / f"built{suffix}")
        export(loaded, tmp_path / f"loaded{suffix}")
        assert (tmp_path / f"built{suffix}").read_bytes() == (tmp_path / f"loaded{suffix}").read_bytes()


def test_the_same_input_gives_the_same_bytes_with_any_number_of_workers(bare_sample: Result, tmp_path: Path) -> None:
    assert bare_sample.build.config.workers == 2
    again = build(bare_sample.build.sequence, dataclasses.replace(COARSE, workers=1))
    save_result(again, tmp_path / "again.recon")
    files = [path for path in sorted(bare_sample.folder.rglob("*")) if path.is_file()]
    assert len([path for path in files if path.parent.name == "textures"]) > 5
    for path in files:
        name = path.relative_to(bare_sample.folder)
        if str(name) not in ("metrics.json", "report.html", "config.toml"):
            assert path.read_bytes() == (tmp_path / "again.recon" / name).read_bytes(), name


def test_lidar_alone_gives_untextured_walls(tmp_path: Path) -> None:
    result = run(SAMPLE, tmp_path / "lidar.recon", images=None, camera=None)
    assert all(face.texture is None for face in result.build.model.faces)
    assert result.evaluation.walls is not None and result.evaluation.walls.f1[1] > 0.97
    assert result.evaluation.extrinsics is None and result.evaluation.labels is None
    assert result.build.model.layout.ceiling_height is None
    assert any("ceiling" in note for note in result.build.model.notes)


def test_given_extrinsics_are_used(bare_sample: Result) -> None:
    assert bare_sample.build.calibration is not None
    pose = bare_sample.build.calibration.platform_from_camera
    moved = dataclasses.replace(pose, translation=pose.translation + np.array([0.0, 0.0, 0.12]))
    drive = dataclasses.replace(every_image(2, read_sequence(SAMPLE)), platform_from_camera=moved)
    built = build(drive, COARSE, plan_only=True)
    assert built.calibration is not None and built.calibration.source == "given"
    assert np.array_equal(built.calibration.platform_from_camera.matrix(), moved.matrix())
    assert any("extrinsics.yaml" in w and "-0.1" in w for w in built.warnings)


@pytest.mark.parametrize(("seed", "rooms", "angles"), [(21, 1, "manhattan"), (22, 2, "any"), (23, 3, "manhattan")])
def test_random_buildings(seed: int, rooms: int, angles: str, tmp_path: Path) -> None:
    plan = random_plan(seed, rooms, angles, clutter=0.3)  # type: ignore[arg-type]
    scale = 400 / plan.camera.image_width
    camera = dataclasses.replace(
        plan.camera, image_width=400, image_height=300, fx=plan.camera.fx * scale, fy=plan.camera.fy * scale,
        cx=None, cy=None, rate=1.0,
    )  # fmt: skip
    simulate(dataclasses.replace(plan, camera=camera), tmp_path / "drive", seed)
    result = run(tmp_path / "drive", tmp_path / "drive.recon", odometry=None, platform_from_camera=None)
    scores = result.evaluation
    assert scores.trajectory is not None and 1e-5 < scores.trajectory.ate < 0.03
    assert scores.extrinsics is not None and abs(scores.extrinsics.height) < 0.03
    assert scores.extrinsics.rotation < 0.5
    assert scores.walls is not None and scores.walls.f1[1] > 0.8  # furniture hides walls
    assert scores.labels is not None and scores.labels.accuracy > 0.7


def test_a_build_of_the_lobby(shared_data: Callable[[str], Path], tmp_path: Path) -> None:
    """Real photographs, every fourth of them: cluttered, few walls."""
    result = run(shared_data("lobby"), tmp_path / "lobby.recon", every=4)
    scores = result.evaluation
    assert scores.trajectory is not None and 1e-5 < scores.trajectory.ate < 0.1
    assert scores.extrinsics is not None and abs(scores.extrinsics.height) < 0.06
    assert scores.extrinsics.tilt < 1.5
    assert max(abs(scores.extrinsics.x), abs(scores.extrinsics.y)) < 0.12
