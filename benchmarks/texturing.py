"""CPU seconds and memory of texturing against the number of images: `python benchmarks/texturing.py samples/corridor`.

Faces of the true layout, images at their true poses; for more images than there are the drive is taken again and again,
every time from a little elsewhere. One core, every number of images in a process of its own.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from recon.faces import extrude
from recon.geometry import Pose3
from recon.model import Face
from recon.raycast import RayScene
from recon.sequence.folder import read_sequence
from recon.sequence.groundtruth import read_groundtruth
from recon.sequence.images import load_image
from recon.texture import refine_poses, texture_faces
from recon.texture.survey import Rig, probe, useful_images
from recon.texture.view import Lens

STEP, TURN = 0.15, 5.0
"""m, degrees: one standard deviation of the way from a photo's place to where a copy of it is said to be from."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("sequence", type=Path)
    parser.add_argument("--images", type=int, nargs="+", default=[43, 200, 800])
    parser.add_argument("--one", action="store_true", help="measure the first number only, in this process")
    arguments = parser.parse_args()
    if arguments.one:
        measure(arguments.sequence, arguments.images[0])
        return
    print("images  pairs seen   poses s  ms a pair   texture s  ms a pair   memory before  peak  pictures, MiB")
    for count in arguments.images:
        command = [sys.executable, __file__, str(arguments.sequence), "--images", str(count), "--one"]
        subprocess.run(command, check=True)


def measure(folder: Path, count: int) -> None:
    """One row of the table."""
    sequence, truth = read_sequence(folder), read_groundtruth(folder)
    images, camera = sequence.images, sequence.camera
    layout, drive = truth.layout, truth.camera_trajectory
    assert images is not None and camera is not None and layout is not None and drive is not None
    faces, photos = extrude(layout), len(drive)
    rng = np.random.default_rng(0)
    poses = [_near(drive.poses[k % photos], k // photos, rng) for k in range(count)]

    def load(index: int) -> NDArray[np.uint8] | None:
        return load_image(images, index % photos, camera)

    texture_faces(faces[:1], camera, poses[:1], load)  # compiled and imported
    useful = useful_images(poses)
    rig = Rig(Lens.of(camera), list(poses), RayScene(faces))
    pairs = sum(int(np.count_nonzero(np.diff(probe(rig, face, useful).indptr))) for face in faces)
    before = _peak()
    start = time.process_time()
    refine_poses(faces, camera, poses, load)
    aligned = time.process_time()
    found = texture_faces(faces, camera, poses, load)
    end = time.process_time()
    print(
        f"{count:6}{pairs:12}{aligned - start:10.1f}{1000 * (aligned - start) / pairs:11.1f}"
        f"{end - aligned:12.1f}{1000 * (end - aligned) / pairs:11.1f}"
        f"{before:16.0f}{_peak():6.0f}{_pictures(found):10.0f}"
    )


def _near(pose: Pose3, copy: int, rng: np.random.Generator) -> Pose3:
    """The pose itself, for later copies moved along the floor and turned about the vertical."""
    step, angle = rng.normal(0, STEP, 2), np.deg2rad(rng.normal(0, TURN))
    if copy == 0:
        return pose
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    return Pose3(turn @ pose.rotation, pose.translation + np.array([*step, 0.0]))


def _peak() -> float:
    """MiB of this process so far."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def _pictures(faces: tuple[Face, ...]) -> float:
    """MiB of pictures and of which image each texel is from."""
    arrays = [a for f in faces for a in (f.texture, f.sources) if a is not None]
    return sum(a.nbytes for a in arrays) / 2**20


if __name__ == "__main__":
    main()
