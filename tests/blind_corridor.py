"""A long bare corridor, driven at a speed that changes, for tests of what images add."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from recon.geometry import Array
from recon.sequence.open import open_sequence
from recon.sequence.sequence import Sequence
from recon.sequence.trajectory import Trajectory
from recon.sequence.tum import read_planar
from recon.simulate import Plan, simulate
from recon.simulate.plan import PlanCamera, PlanLidar, PlanLook, PlanRoom


def corridor_plan(length: float, reach: float, pixels: tuple[int, int]) -> Plan:
    """2.2 m wide, no doors, posters on the walls; a scanner that reaches `reach` m and no odometry."""
    sides = [(0.0, -1.1), (length, -1.1), (length, 1.1), (0.0, 1.1)]
    path = [(1.0, 0.0), *((length * s, y) for s, y in ((0.2, 0.25), (0.4, -0.2), (0.6, 0.2), (0.8, -0.25)))]
    focal = 500 * pixels[0] / 640
    return Plan(
        (PlanRoom(tuple(sides), "corridor"),),
        (*path, (length - 1.5, 0.0)),
        lidar=PlanLidar(range_max=reach),
        camera=PlanCamera(image_width=pixels[0], image_height=pixels[1], fx=focal, fy=focal),
        look=PlanLook(posters=0.25),
        write_odometry=False,
    )


def drive_corridor(plan: Plan, folder: Path, seed: int) -> tuple[Sequence, Trajectory]:
    """The sequence and its true trajectory. The platform is driven evenly: changing all stamps changes its speed."""
    simulate(plan, folder, seed)
    sequence, truth = open_sequence(folder), read_planar(folder / "groundtruth" / "trajectory.txt")
    start = float(sequence.scans.timestamps[0])
    assert sequence.images is not None
    scans = replace(sequence.scans, timestamps=uneven(sequence.scans.timestamps, start))
    images = replace(sequence.images, timestamps=uneven(sequence.images.timestamps, start))
    return replace(sequence, scans=scans, images=images), Trajectory(uneven(truth.timestamps, start), truth.poses)


def uneven(stamps: Array, start: float) -> Array:
    """Stamps at which the platform is now faster, now slower: from 0.6 to 2.2 times as fast."""
    t = stamps - start
    return np.asarray(
        stamps + 0.35 * 20 / (2 * np.pi) * np.sin(np.pi * t / 10) + 0.2 * 7 / (2 * np.pi) * np.sin(2 * np.pi * t / 7)
    )
