"""A simulated corridor along which the scanner is blind, built with images and without: table and picture.

python benchmarks/blind_corridor.py [FOLDER] [PICTURE.png]
"""

from __future__ import annotations

import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from blind_corridor import corridor_plan, drive_corridor

from recon.config import Config, TextureConfig
from recon.pipeline import Build, build
from recon.sequence.trajectory import Trajectory

LENGTH, REACH = 60.0, 8.0


def main() -> None:
    """Both builds, their errors along the corridor, and a picture of the maps."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(tempfile.mkdtemp()) / "drive"
    sequence, truth = drive_corridor(corridor_plan(LENGTH, REACH, (640, 480)), folder, seed=1)
    config = Config(texture=TextureConfig(metres_per_texel=0.02, max_texture_size=1024))
    drives = {"scans alone": replace(sequence, images=None, camera=None), "scans and images": sequence}
    builds = {}
    for name, drive in drives.items():
        start = time.process_time()
        builds[name] = build(drive, config)
        print(f"| {name} | {row(builds[name], truth)} | {time.process_time() - start:.1f} |")
        print(builds[name].seconds, builds[name].warnings)
    if len(sys.argv) > 2:
        draw(builds, truth, Path(sys.argv[2]))


def row(result: Build, truth: Trajectory) -> str:
    """Error along at the end and its root mean square (m), sigma at the end (m), NEES along."""
    error = (result.estimate.trajectory.poses - truth.poses)[:, 0]
    sigma = result.estimate.pose_sigmas[:, 0]
    nees = float(np.mean((error[5:] / sigma[5:]) ** 2))
    return f"{error[-1]:+.2f} | {np.sqrt(np.mean(error**2)):.2f} | {sigma[-1]:.2f} | {nees:.2f}"


def draw(builds: dict[str, Build], truth: Trajectory, path: Path) -> None:
    """Maps above one another, and the error along over time with two sigma."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(3, 1, figsize=(10, 6), height_ratios=(1, 1, 2), constrained_layout=True)
    for axis, (name, result) in zip(axes, builds.items(), strict=False):
        axis.plot(*truth.poses[:, :2].T, color="0.6", lw=5, label="true path")
        for wall in result.estimate.walls:
            for low, high in wall.intervals:
                ends = wall.pose[:2] + np.array([low, high])[:, None] * wall.direction
                axis.plot(*ends.T, color="k", lw=1.5)
        axis.plot(*result.estimate.trajectory.poses[:, :2].T, color="tab:red", lw=1.5, label="path found")
        axis.set_title(f"{name}: walls and path", fontsize=9)
        axis.set_xlim(-4, LENGTH + 2)
        axis.set_ylim(-3.2, 3.2)
        axis.legend(fontsize=7, loc="upper right")
    time_s = truth.timestamps - truth.timestamps[0]
    for (name, result), colour in zip(builds.items(), ("tab:blue", "tab:red"), strict=True):
        error = (result.estimate.trajectory.poses - truth.poses)[:, 0]
        sigma = result.estimate.pose_sigmas[:, 0]
        axes[2].plot(time_s, np.abs(error) + 1e-4, color=colour, label=f"{name}: error along, m")
        axes[2].plot(time_s, 2 * sigma + 1e-4, color=colour, ls=":", label=f"{name}: two sigma claimed")
    axes[2].set_yscale("log")
    axes[2].set_ylim(1e-3, 1e2)
    axes[2].set_xlabel("s")
    axes[2].legend(fontsize=7)
    figure.savefig(path, dpi=100)


if __name__ == "__main__":
    main()
