"""Lines and verticals of the drives beside the checkout, against their ground truth."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import yaml
from numpy.typing import NDArray
from vision_scene import angle_deg

from recon.config import VisionConfig
from recon.geometry import Array, Pose3
from recon.sequence.camera import Camera
from recon.sequence.images import read_image_list
from recon.sequence.intrinsics import read_camera
from recon.vision.frame import FrameLines
from recon.vision.frame_lines import detect_lines, relabel
from recon.vision.rectify import rectifier
from recon.vision.vertical import average_vertical, vertical_direction

Drive = tuple[Path, Camera, list[str], list[FrameLines]]


def load(folder: Path, step: int, config: VisionConfig) -> Drive:
    """Every `step`-th image of a drive and its lines."""
    camera = read_camera(folder / "camera.yaml")
    names = read_image_list(folder / "images.txt").names[::step]
    frames = []
    for name in names:
        image = cv2.imread(str(folder / name), cv2.IMREAD_GRAYSCALE)
        frames.append(detect_lines(np.asarray(image, np.uint8), camera, config, 0))
    return folder, camera, [Path(name).stem for name in names], frames


def true_down(folder: Path, key: str) -> Array:
    pose = yaml.safe_load((folder / "groundtruth" / "extrinsics.yaml").read_text())[key]
    return np.asarray(-Pose3.from_quaternion(pose["translation"], pose["quaternion_xyzw"]).rotation[2])


@pytest.fixture(scope="module")
def corridor(shared_data: Callable[[str], Path]) -> Drive:
    return load(shared_data("corridor"), 2, VisionConfig())


def test_corridor_vertical(corridor: Drive) -> None:
    folder, camera, _, frames = corridor
    down = true_down(folder, "platform_from_camera")
    found, sigma, count = vertical_direction(frames, camera)
    assert angle_deg(found, down) < 0.04
    assert 0.005 < np.rad2deg(sigma) < 0.06
    assert count > 20 * len(frames)
    single = [angle_deg(f.directions[0], down) for f in frames]
    assert np.median(single) < 0.08
    assert max(single) < 0.3
    assert angle_deg(average_vertical(frames), down) < 0.05


def test_corridor_horizontals_are_the_walls(corridor: Drive) -> None:
    folder, camera, _, frames = corridor
    down = true_down(folder, "platform_from_camera")
    layout = json.loads((folder / "groundtruth" / "layout.json").read_text())
    poses = camera_poses(folder)
    wall = layout["walls"][0]
    along = np.append(np.subtract(wall["end"], wall["start"]), 0.0)
    along /= np.linalg.norm(along)
    assert len(frames) < len(poses)
    for frame, pose in zip(frames, poses[::2], strict=True):
        again = relabel(frame, camera, down)
        axis = pose.rotation.T @ along
        turned = np.rad2deg(np.arcsin(np.clip(again.directions[1:] @ axis, -1, 1)))
        off = np.minimum(np.abs(turned), 90 - np.abs(turned))
        assert np.nanmax(off) < 1.0  # the arms meet at 90.3 degrees in this building


def camera_poses(folder: Path) -> list[Pose3]:
    rows = np.loadtxt(folder / "groundtruth" / "camera_trajectory.txt")
    return [Pose3.from_quaternion(r[1:4], r[4:8]) for r in rows]


def visible_foot(wall: dict[str, Any], openings: list[dict[str, Any]], pose: Pose3, camera: Camera,
                 labels: NDArray[np.uint16]) -> Array:  # fmt: skip
    """(n, 2) raw pixels every centimetre of a wall's foot where the label image shows floor beside that wall."""
    start, end = np.array(wall["start"]), np.array(wall["end"])
    unit = (end - start) / np.linalg.norm(end - start)
    s = np.arange(0.02, np.linalg.norm(end - start), 0.01)
    for door in (o for o in openings if o["wall"] == wall["id"]):
        a, b = sorted((np.array(door[k]) - start) @ unit for k in ("start", "end"))
        s = s[(s < a - 0.08) | (s > b + 0.08)]  # the door's frame stands before the wall
    foot = start + s[:, None] * unit + 0.01 * np.array([-unit[1], unit[0]])  # the baseboard is 1 cm thick
    points = pose.inverse().apply(np.concatenate([foot, np.zeros((len(foot), 1))], axis=1))
    pixels = camera.project(points[points[:, 2] > 0.2])
    inside = (pixels > 4).all(axis=1) & (pixels < [camera.width - 5, camera.height - 5]).all(axis=1)
    seen = []
    for x, y in np.round(pixels[inside]).astype(int):
        patch = labels[y - 3 : y + 4, x - 3 : x + 4]
        seen.append((patch == 1).any() and (patch == 10 + wall["id"]).any())
    return np.asarray(pixels[inside][np.array(seen, dtype=bool)])


def distances_to(points: Array, segments: Array) -> Array:
    """(n,) px from points (n, 2) to the nearest of segments (S, 2, 2), ending 2 px later; inf where there is none."""
    step = segments[:, 1] - segments[:, 0]
    length = np.linalg.norm(step, axis=1)
    unit = step / length[:, None]
    offset = points[:, None] - segments[:, 0]
    along = (offset * unit).sum(axis=2)
    across = np.abs(offset[..., 0] * unit[:, 1] - offset[..., 1] * unit[:, 0])
    return np.asarray(np.where((along > -2) & (along < length + 2), across, np.inf).min(axis=1))


def test_corridor_wall_feet_are_boundary_candidates(corridor: Drive) -> None:
    """Of the wall feet that an image shows, by length in pixels, nearly all lie within 2 px of a candidate."""
    folder, camera, names, frames = corridor
    layout = json.loads((folder / "groundtruth" / "layout.json").read_text())
    down = true_down(folder, "platform_from_camera")
    total, off = 0.0, []
    for name, frame, pose in zip(names, frames, camera_poses(folder)[::2], strict=True):
        labels = cv2.imread(str(folder / "groundtruth" / "labels" / f"{name}.png"), cv2.IMREAD_UNCHANGED)
        again = relabel(frame, camera, down)
        for wall in layout["walls"]:
            pixels = visible_foot(wall, layout["openings"], pose, camera, np.asarray(labels, np.uint16))
            if len(pixels) < 2:
                continue
            weight = np.linalg.norm(np.gradient(pixels, axis=0), axis=1)
            distance = distances_to(rectifier(camera)(pixels)[0], again.endpoints[again.boundary])
            off.append(np.stack([distance, weight], axis=1))
            total += weight.sum()
    distance, weight = np.concatenate(off).T
    near = distance < 2
    assert total > 5000
    assert weight[near].sum() / total > 0.93
    assert 0.02 < np.median(distance[near]) < 0.3


@pytest.mark.parametrize("config", [VisionConfig(detector="canny"), VisionConfig(detector="lsd")])
def test_lobby_vertical(shared_data: Callable[[str], Path], config: VisionConfig) -> None:
    """Real photographs of furniture for the most part; the head that carried the camera swayed."""
    folder, camera, _, frames = load(shared_data("lobby"), 2, config)
    found, sigma, count = vertical_direction(frames, camera)
    assert angle_deg(found, true_down(folder, "lidar_from_camera")) < 0.5
    assert 0.05 < np.rad2deg(sigma) < 0.5
    assert count > 500
