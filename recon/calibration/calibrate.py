"""Extrinsics from images and scans, or the check of given ones."""

from __future__ import annotations

import numpy as np

from recon.calibration.refine import Refinement
from recon.calibration.result import Calibration
from recon.calibration.rransac import RecursiveRansac
from recon.calibration.search import MIN_FOOT, MIN_FRACTION, PoseSearch, distinct
from recon.calibration.support import CalibrationFrames, support
from recon.config import CalibrationConfig
from recon.geometry import Array, Pose3
from recon.sequence.camera import Camera

TOLERANCE = 0.0077  # rad, of a line from a projected foot: 4 pixels at f = 520
MAX_FRAMES = 80  # images in recursive RANSAC; the refinement uses all
MIN_EVIDENCE = 30.0  # standard deviations above chance
MIN_CONSENSUS = 3  # images
MIN_SHARE = 0.6  # of the images with a foot in view, below which the search starts anew
MIN_CONFIRMED = 0.42  # of them, below which a pose is chance: right ones explain 0.54 to 1, wrong ones 0.2 to 0.38
GIVEN_SIGMA = (0.002, 0.005)  # rad, m


def calibrate(
    frames: CalibrationFrames,
    camera: Camera,
    vertical: tuple[Array, float],
    config: CalibrationConfig,
    seed: int = 0,
) -> Calibration | None:
    """platform_from_camera by recursive RANSAC and joint refinement (paper 2.3, 2.4); None where nothing convinces.

    vertical: unit vector (3,) in the camera frame, pointing down, and its standard deviation (rad).
    """
    if len(frames) == 0:
        return None
    tolerance = TOLERANCE * camera.matrix[0, 0]
    search = PoseSearch(frames, camera, vertical, tolerance)
    ransac = RecursiveRansac(frames.thinned(MAX_FRAMES), camera, vertical, tolerance, config.iterations, seed)
    best = None
    for start in distinct([h.platform_from_camera for h in ransac.run()]):
        best = search.around(start, best)
    if best is None or search.share(best.refined) < MIN_SHARE:
        best = search.blind(best)
    if best is None:
        return None
    best = search.settled(best)
    found = search.lowest_plane(best)
    pose = found.refined.platform_from_camera
    images, fraction = _consensus(frames, search.counts((best if found.faint else found).refined))
    chance = best.evidence < MIN_EVIDENCE or search.share(best.refined) < MIN_CONFIRMED
    if chance or len(images) < MIN_CONSENSUS:
        return None
    warnings = (_faint(found.refined),) if found.faint else ()
    return Calibration(pose, found.refined.covariance, "estimated", images, fraction, warnings)


def _faint(refined: Refinement) -> str:
    """What to say where most images show a line above the floor only."""
    height, sigma = refined.platform_from_camera.translation[2], float(np.sqrt(refined.covariance[5, 5]))
    return (
        f"few images show where walls meet the floor, most an edge above it (baseboards); the camera is taken to be "
        f"{height:.3f} +- {sigma:.3f} m above the floor, measure it and give extrinsics.yaml if that is wrong"
    )


def check_given(frames: CalibrationFrames, camera: Camera, vertical: tuple[Array, float], given: Pose3) -> Calibration:
    """The given extrinsics, with a warning and the numbers where the images disagree."""
    tolerance = TOLERANCE * camera.matrix[0, 0]
    warnings: list[str] = []
    tilt = float(np.degrees(np.arccos(np.clip(-given.rotation[2] @ vertical[0], -1, 1))))
    if tilt > max(1.0, np.degrees(3 * vertical[1])):
        warnings.append(
            f"extrinsics.yaml: the camera's vertical is {tilt:.1f} deg off the vertical lines in the images; "
            "the given value is used, leave the file out to have it estimated"
        )
    search = PoseSearch(frames, camera, vertical, tolerance)
    found = search.around(given, None)
    if found is not None:
        warnings += _disagreement(given, search.lowest_plane(found).refined)
    covariance = np.diag([GIVEN_SIGMA[0]] * 3 + [GIVEN_SIGMA[1]] * 3) ** 2
    images, fraction = _consensus(frames, support(frames, camera, given, tolerance))
    return Calibration(given, covariance, "given", images, fraction, tuple(warnings))


def _disagreement(given: Pose3, refined: Refinement) -> list[str]:
    """One warning where the images put the camera elsewhere by more than 5 cm or 1 degree, and 4 sigma."""
    moved = refined.platform_from_camera.translation - given.translation
    cosine = (np.trace(refined.platform_from_camera.rotation @ given.rotation.T) - 1) / 2
    turned = float(np.arccos(np.clip(cosine, -1, 1)))
    sigma = np.sqrt(np.diag(refined.covariance))
    far = np.linalg.norm(moved) > max(0.05, 4 * float(np.linalg.norm(sigma[3:])))
    if not far and turned < max(np.radians(1.0), 4 * float(np.linalg.norm(sigma[:3]))):
        return []
    x, y, z = moved
    return [
        f"extrinsics.yaml: the images put the camera ({x:+.3f}, {y:+.3f}, {z:+.3f}) m and {np.degrees(turned):.2f} deg "
        "from the given pose; the given value is used, leave the file out to have it estimated"
    ]


def _consensus(frames: CalibrationFrames, counts: Array) -> tuple[tuple[int, ...], float]:
    """Images whose feet the lines explain, and the share explained in them."""
    mine = (counts[:, 1] > MIN_FOOT) & (counts[:, 0] > MIN_FRACTION * counts[:, 1])
    explained, projected = counts[mine].sum(axis=0) if mine.any() else (0.0, 1.0)
    return tuple(int(i) for i in frames.images[mine]), float(explained / projected)
