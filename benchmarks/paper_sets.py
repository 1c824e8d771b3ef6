"""Image sets for `recon bench paper`: `python benchmarks/paper_sets.py DIR [SEQUENCE ...]`.

DIR gets the sets "L", "+" and "T1": simulated corridors that meet as those of the paper's three data sets do, seen by a
level camera; and one more set for every sequence folder with ground truth. They hold images, label images, intrinsics
and mounting; with `--odometry` odometry as well, with `--layout` the true layout and poses, of which the scans are made
then, all round.
"""

from __future__ import annotations

import argparse
import shutil
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from recon.geometry import LOOKING_AHEAD, Pose3
from recon.sequence.groundtruth import read_groundtruth
from recon.sequence.images import read_image_list
from recon.simulate import Plan, simulate
from recon.simulate.check import check_plan
from recon.simulate.plan import Point

WIDTH = 2.2
DOOR, SPACING = 0.95, 3.2
"""m: width of a door, and from one to the next along a wall."""
OUTLINES: dict[str, list[Point]] = {
    "L": [(0, 0), (14, 0), (14, 9), (11.8, 9), (11.8, 2.2), (0, 2.2)],
    "+": [
        (0, 0), (8, 0), (8, -6), (10.2, -6), (10.2, 0), (17, 0),
        (17, 2.2), (10.2, 2.2), (10.2, 8), (8, 8), (8, 2.2), (0, 2.2),
    ],
    "T1": [(0, 0), (16, 0), (16, 2.2), (10.2, 2.2), (10.2, 9), (8, 9), (8, 2.2), (0, 2.2)],
}  # fmt: skip
PATHS: dict[str, list[Point]] = {
    "L": [(1.0, 1.0), (12.7, 1.1), (12.9, 6.5)],
    "+": [(1.0, 1.2), (14.5, 1.0)],
    "T1": [(1.0, 1.1), (9.0, 1.0), (9.1, 6.5)],
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("sequences", nargs="*", type=Path)
    parser.add_argument("--odometry", action="store_true")
    parser.add_argument("--layout", action="store_true")
    arguments = parser.parse_args()
    files = ["odometry.txt"] if arguments.odometry else []
    files += ["groundtruth/layout.json", "groundtruth/camera_trajectory.txt"] if arguments.layout else []
    arguments.folder.mkdir(parents=True, exist_ok=True)
    for seed, name in enumerate(OUTLINES):
        with tempfile.TemporaryDirectory() as scratch:
            simulate(corridor(name), Path(scratch) / name, seed)
            write_set(Path(scratch) / name, arguments.folder / name, files)
    for sequence in arguments.sequences:
        write_set(sequence, arguments.folder / sequence.resolve().name, files)


def corridor(name: str, rate: float = 2.5) -> Plan:
    """A corridor of one of the OUTLINES with closed doors along it; `rate`: images a second at 0.5 m/s."""
    outline = OUTLINES[name]
    openings = []
    for wall, (start, end) in enumerate(zip(outline, [*outline[1:], outline[0]], strict=True)):
        length = float(np.hypot(end[0] - start[0], end[1] - start[1]))
        for offset in np.arange(1.2, length - DOOR - 0.5, SPACING) if length > WIDTH + 0.1 else []:
            openings.append({"type": "door", "room": 0, "wall": wall, "offset": float(offset), "width": DOOR})
    plan = Plan.from_dict(
        {
            "name": name,
            "rooms": [{"name": "corridor", "polygon": outline}],
            "openings": openings,
            "path": PATHS[name],
            "drive": {"speed": 0.5, "turn_rate": 0.35, "corner_radius": 0.9},
            "camera": {"x": 0.0, "y": 0.0, "tilt_deg": 0.0, "roll_deg": 0.0, "yaw_deg": 0.0, "rate": rate},
        }
    )
    check_plan(plan)
    return plan


def write_set(sequence: Path, folder: Path, files: Sequence[str] = ()) -> None:
    """Images, label images, intrinsics and mounting of a sequence folder with ground truth, and more of its files.

    `folder` must not be there. With more files the times of the images come along.
    """
    truth = read_groundtruth(sequence)
    if truth.platform_from_camera is None:
        raise SystemExit(f"{sequence}: has no groundtruth/extrinsics.yaml")
    for part in ("images", "labels"):
        (folder / part).mkdir(parents=True)
    images = read_image_list(sequence / "images.txt")
    for name, path in zip(images.names, images.paths, strict=True):
        label = truth.label_path(name)
        if label is not None:
            shutil.copyfile(path, folder / "images" / path.name)
            shutil.copyfile(label, folder / "labels" / label.name)
    for file in ("camera.yaml", *(("images.txt", *files) if files else ())):
        shutil.copyfile(sequence / file, folder / Path(file).name)
    (folder / "mounting.yaml").write_text(mounting(truth.platform_from_camera), encoding="utf-8")


def mounting(platform_from_camera: Pose3) -> str:
    """mounting.yaml of a camera: height, tilt and roll, whichever way it looks on the platform."""
    down, *upright = -(platform_from_camera.rotation @ LOOKING_AHEAD.T)[2]
    tilt, roll = np.degrees([np.arcsin(down), np.arctan2(-upright[0], -upright[1])])
    height = platform_from_camera.translation[2]
    return f"camera_height: {height:.6f}\ntilt_deg: {tilt:.6f}\nroll_deg: {roll:.6f}\n"


if __name__ == "__main__":
    main()
