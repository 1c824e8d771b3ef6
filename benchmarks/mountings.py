"""Cameras of low resolution on odd mountings as a markdown table: `python benchmarks/mountings.py --drives 24`.

Random simulated buildings; the camera's height, tilt, roll, yaw and place, its noise, the floor, its gloss and the
height of the baseboards are drawn from the seed. Only the calibration is made, from images and scans alone.
"""

from __future__ import annotations

import argparse
import dataclasses
import tempfile
from pathlib import Path

import numpy as np

from recon.calibration.calibrate import calibrate
from recon.calibration.frames import collect_frames
from recon.calibration.result import Calibration
from recon.config import Config
from recon.errors import InputError
from recon.evaluate.extrinsics import extrinsics_errors
from recon.lidar.noise import with_noise
from recon.lidar.split_and_merge import extract_segments
from recon.lidar.sweep import match_in_order
from recon.sequence.extrinsics import read_extrinsics
from recon.sequence.folder import read_sequence
from recon.sequence.images import iterate_images
from recon.sequence.sequence import Sequence
from recon.simulate import Plan, random_plan, simulate
from recon.simulate.plan import FloorStyle
from recon.vision.frame_lines import detect_lines, relabel
from recon.vision.vertical import vertical_direction

SIZES = ((320, 240), (320, 240), (424, 240), (640, 360))
FLOORS: tuple[FloorStyle | None, ...] = (None, "carpet", "tiles", "planks", "checker")
HEAD = (
    "| seed | image | floor, gloss, baseboard | height, tilt, yaw "
    "| error x, y, height, cm (sigma) | rotation, deg | images |\n"
    "| --- | --- | --- | --- | --- | --- | --- |"
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--drives", type=int, default=24)
    parser.add_argument("--first", type=int, default=800, help="the first seed")
    arguments = parser.parse_args()
    print(HEAD)
    for seed in range(arguments.first, arguments.first + arguments.drives):
        with tempfile.TemporaryDirectory() as scratch:
            folder = Path(scratch) / "drive"
            plan = mounted(seed)
            try:
                simulate(plan, folder, seed)
            except InputError:  # the camera would stick out so far that the platform does not fit through
                plan = dataclasses.replace(plan, camera=dataclasses.replace(plan.camera, x=0.05, y=0.0))
                simulate(plan, folder, seed)
            print(row(seed, plan, folder), flush=True)


def mounted(seed: int) -> Plan:
    """A random building with a camera of low resolution somewhere on the platform."""
    rng = np.random.default_rng([seed, 77])
    plan = random_plan(seed, 1 + seed % 3, "any" if seed % 2 else "manhattan", float(rng.choice([0.0, 0.5, 1.0])))
    width, height = SIZES[rng.integers(len(SIZES))]
    odd = rng.random() < 0.5
    scale = width / plan.camera.image_width
    camera = dataclasses.replace(
        plan.camera,
        image_width=width,
        image_height=height,
        fx=round(plan.camera.fx * scale, 2),
        fy=round(plan.camera.fy * scale, 2),
        cx=None,
        cy=None,
        height=round(float(rng.uniform(0.35, 1.8)), 3),
        tilt_deg=round(float(rng.uniform(0, 28)), 2),
        roll_deg=round(float(rng.normal(0, 4)), 2),
        yaw_deg=round(float(rng.choice([0, 0, 25, -90, 180]) if odd else rng.normal(0, 3)), 2),
        x=round(float(rng.uniform(-0.3, 0.4)), 3),
        y=round(float(rng.uniform(-0.25, 0.25)), 3),
        noise=float(rng.uniform(1, 6)),
    )
    look = dataclasses.replace(
        plan.look,
        floor=FLOORS[rng.integers(len(FLOORS))],
        gloss=float(rng.choice([0, 0.35, 0.9])),
        baseboard=float(rng.choice([0.06, 0.09, 0.15, 0.25])),
    )
    return dataclasses.replace(plan, camera=camera, look=look)


def row(seed: int, plan: Plan, folder: Path) -> str:
    """Calibrate, compare, and one line of the table."""
    camera, look = plan.camera, plan.look
    sequence = dataclasses.replace(read_sequence(folder), platform_from_camera=None, odometry=None)
    result = calibrated(sequence)
    cells = [
        str(seed),
        f"{camera.image_width}x{camera.image_height}",
        f"{look.floor or 'mixed'}, {look.gloss:g}, {look.baseboard * 100:.0f} cm",
        f"{camera.height:.2f} m, {camera.tilt_deg:.0f}, {camera.yaw_deg:.0f} deg",
    ]
    if result is None:
        return f"| {' | '.join(cells)} | refused | - | - |"
    e = extrinsics_errors(result.platform_from_camera, read_extrinsics(folder / "groundtruth" / "extrinsics.yaml"))
    x, y, z = np.sqrt(np.diag(result.covariance))[3:] * 100
    cells += [
        f"{e.x * 100:+.1f} ({x:.1f}), {e.y * 100:+.1f} ({y:.1f}), {e.height * 100:+.1f} ({z:.1f})",
        f"{e.rotation:.2f}",
        str(len(result.inlier_frames)) + (", warned" if result.warnings else ""),
    ]
    return f"| {' | '.join(cells)} |"


def calibrated(sequence: Sequence) -> Calibration | None:
    """The camera's pose from images and scans."""
    config = Config()
    assert sequence.camera is not None and sequence.images is not None
    scans, matching = match_in_order(sequence.scans, None, with_noise(sequence.scans, config.lidar), [])
    lidar = with_noise(scans, config.lidar)
    segments = [extract_segments(scans, i, lidar, matching.velocities[i]) for i in range(len(scans))]
    images = iterate_images(sequence.images, sequence.camera, grey=True, warnings=[])
    lines = [None if i is None else detect_lines(i, sequence.camera, config.vision, config.seed) for _, i in images]
    down, sigma, _ = vertical_direction([f for f in lines if f is not None], sequence.camera)
    lines = [None if f is None else relabel(f, sequence.camera, down) for f in lines]
    frames = collect_frames(lines, sequence.images.timestamps, matching.trajectory, segments)
    return calibrate(frames, sequence.camera, (down, sigma), config.calibration, config.seed)


if __name__ == "__main__":
    main()
