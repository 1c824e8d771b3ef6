"""A simulated sequence folder (FORMAT.md), written whole or not at all."""

from __future__ import annotations

import json
import shutil
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.errors import OutputError
from recon.geometry import Pose3, inverse2
from recon.layout_json import layout_to_json
from recon.model import Layout
from recon.progress import SILENT, Progress
from recon.sequence.extrinsics import write_extrinsics
from recon.sequence.tum import write_planar, write_tum
from recon.sequence.write import write_camera, write_scans
from recon.simulate.plan import Plan
from recon.simulate.render import Exposure, Renderer
from recon.simulate.simulation import Simulation, image_poses, run_simulation
from recon.simulate.truth import true_camera, true_extrinsics

MARK = Path("groundtruth") / "plan.json"
"""What tells a simulated folder, which may be replaced, from any other."""
JPEG_QUALITY = 93


def simulate(plan: Plan, folder: Path, seed: int = 0, progress: Progress = SILENT) -> None:
    """Make the sequence folder of a plan: images, scans, odometry, ground truth.

    A folder that an earlier simulation made is replaced. Raises InputError where the plan cannot be built or driven and
    OutputError where the folder exists, is not empty and is no simulation, or cannot be written.
    """
    simulation = run_simulation(plan, seed)
    with _whole_folder(Path(folder)) as temporary:
        (temporary / "groundtruth").mkdir(parents=True)
        write_scans(temporary / "scans.npz", simulation.scans)
        if plan.write_odometry:
            write_planar(temporary / "odometry.txt", simulation.odometry, "platform odometry")
        if plan.write_extrinsics:
            write_extrinsics(temporary / "extrinsics.yaml", true_extrinsics(plan))
        _write_truth(temporary / "groundtruth", simulation, seed)
        if len(simulation.image_times):
            _write_images(temporary, simulation, seed, progress)


def simulate_file(plan_path: Path, output: Path, seed: int = 0, progress: Progress = SILENT) -> None:
    """`simulate` for a plan.json; raises InputError and OutputError, one line each."""
    simulate(Plan.from_json(plan_path), output, seed, progress)


def _write_truth(folder: Path, simulation: Simulation, seed: int) -> None:
    plan = simulation.building.plan
    write_planar(folder / "trajectory.txt", simulation.truth, "platform frame in the map frame")
    write_extrinsics(folder / "extrinsics.yaml", true_extrinsics(plan))
    with (folder / "extrinsics.yaml").open("a", encoding="utf-8") as file:
        file.write(f"lidar_height: {plan.lidar.height:g}\n")
    (folder / "layout.json").write_text(json.dumps(_truth_json(simulation.layout), indent=1) + "\n", encoding="utf-8")
    text = json.dumps({"seed": seed, "plan": plan.to_dict()}, indent=1)
    (folder / MARK.name).write_text(text + "\n", encoding="utf-8")


def _truth_json(layout: Layout) -> dict[str, Any]:
    """layout.json without what only an estimate has."""
    data = layout_to_json(layout)
    data = {k: v for k, v in data.items() if k not in ("sigma_ceiling", "default_ceiling_height")}
    data["walls"] = [{k: wall[k] for k in ("id", "start", "end")} for wall in data["walls"]]
    return data


def _write_images(folder: Path, simulation: Simulation, seed: int, progress: Progress) -> None:
    plan, extrinsics = simulation.building.plan, true_extrinsics(simulation.building.plan)
    camera, poses = true_camera(plan.camera), image_poses(simulation, extrinsics)
    plan_from_map = Pose3.from_planar(inverse2(simulation.map_from_plan))
    write_camera(folder / "camera.yaml", camera)
    for name in ("images", "groundtruth/labels"):
        (folder / name).mkdir()
    renderer = Renderer(simulation.building, camera, seed)
    gains = _gains(plan, len(poses), seed)
    with progress.stage("images", len(poses), "images") as stage:
        for i, pose in enumerate(poses):
            exposure = Exposure(float(gains[i]), plan.camera.noise, (seed, 17, i))
            image, labels = renderer.render(plan_from_map @ pose, exposure)
            _write_picture(folder / "images" / f"{i:04d}.jpg", image)
            _write_picture(folder / "groundtruth" / "labels" / f"{i:04d}.png", labels)
            stage.advance()
    stamps = simulation.image_times
    lines = [f"{t:.6f} images/{i:04d}.jpg" for i, t in enumerate(stamps)]
    (folder / "images.txt").write_text("\n".join(["# timestamp path", *lines]) + "\n", encoding="utf-8")
    positions, quaternions = [p.translation for p in poses], [p.quaternion_xyzw() for p in poses]
    path = folder / "groundtruth" / "camera_trajectory.txt"
    write_tum(path, stamps, positions, quaternions, "camera optical frame in the map frame")


def _gains(plan: Plan, count: int, seed: int) -> NDArray[np.float64]:
    """(N,) exposures that wander slowly round 1 with standard deviation `exposure_sigma` (of their logarithm)."""
    rng = np.random.default_rng([seed, 5])
    steps, state, out = rng.standard_normal(count), rng.standard_normal(), np.empty(count)
    for i in range(count):
        state = 0.9 * state + np.sqrt(1 - 0.9**2) * steps[i]
        out[i] = np.exp(plan.camera.exposure_sigma * state)
    return out


def _write_picture(path: Path, picture: NDArray[Any]) -> None:
    options = [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY] if path.suffix == ".jpg" else []
    _, data = cv2.imencode(path.suffix, picture, options)
    path.write_bytes(data.tobytes())


@contextmanager
def _whole_folder(folder: Path) -> Iterator[Path]:
    """A temporary folder beside `folder` that becomes it at the end, or is removed on any error."""
    ours = (folder / MARK).is_file()
    try:
        if folder.exists() and not ours and (not folder.is_dir() or any(folder.iterdir())):
            raise OutputError(f"{folder}: exists and is not a simulated sequence; an empty or new folder is expected")
        folder.parent.mkdir(parents=True, exist_ok=True)
        temporary = folder.with_name(f".{folder.name}.{uuid.uuid4().hex[:8]}")
        temporary.mkdir()
    except OSError as error:
        raise OutputError(f"{folder}: cannot be written: {error.strerror}") from error
    try:
        yield temporary
        _replace(folder, temporary, ours)
    except OSError as error:
        raise OutputError(f"{folder}: cannot be written: {error.strerror}") from error
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def _replace(folder: Path, temporary: Path, ours: bool) -> None:
    """Put `temporary` in the place of `folder`; an older simulation there is moved away first, then removed."""
    if ours:
        old = temporary.with_name(temporary.name + ".old")
        folder.replace(old)
        temporary.replace(folder)
        shutil.rmtree(old, ignore_errors=True)
    else:
        temporary.replace(folder)
