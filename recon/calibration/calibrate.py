"""Extrinsics from images and scans, or the check of given ones."""

from __future__ import annotations

import numpy as np

from recon.calibration.refine import Refinement, refine
from recon.calibration.result import Calibration
from recon.calibration.rransac import MIN_FOOT, MIN_FRACTION, Hypothesis, RecursiveRansac, score
from recon.calibration.support import CalibrationFrames, support
from recon.calibration.voting import MAX_YAW, vote
from recon.config import CalibrationConfig
from recon.geometry import Array, Pose3
from recon.sequence.camera import Camera

TOLERANCE = 0.0077  # rad, of a line from a projected foot: 4 pixels at f = 520
MAX_FRAMES = 80  # images in recursive RANSAC; the refinement uses all
REFINEMENT = (1.0, 1.0, 0.7, 0.5, 0.5, 0.5)  # of the tolerance
MAX_HYPOTHESES = 3
MIN_EVIDENCE = 30.0  # standard deviations above chance
MIN_CONSENSUS = 3  # images
LOWER_PLANE_RANGE = (0.02, 0.15)  # m, of a baseboard's upper edge above the floor
LOWER_PLANE_SUPPORT = 0.75  # of the best plane's score


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
    tolerance = TOLERANCE * camera.matrix[0, 0]
    ransac = RecursiveRansac(_thinned(frames), camera, vertical, tolerance, config.iterations, seed)
    best: tuple[float, Refinement] | None = None
    for hypothesis in _distinct(ransac.run()):
        for pose in [hypothesis, *vote(frames, camera, hypothesis, vertical[0])]:
            refined = refine(frames, camera, pose, vertical, tuple(tolerance * f for f in REFINEMENT))
            if refined is not None and (value := _evidence(frames, camera, refined, tolerance)) > (best or (0.0,))[0]:
                best = value, refined
    if best is None:
        return None
    lower = _lowest_plane(frames, camera, best[1], tolerance)
    refined = refine(frames, camera, lower, vertical, tuple(tolerance * f for f in REFINEMENT))
    result = _result(frames, camera, refined or best[1], tolerance)
    if best[0] < MIN_EVIDENCE or len(result.inlier_frames) < MIN_CONSENSUS:
        return None
    return result


def _distinct(hypotheses: list[Hypothesis]) -> list[Pose3]:
    """The best hypotheses that differ in yaw by more than the search around one covers."""
    kept: list[Pose3] = []
    for pose in (h.platform_from_camera for h in hypotheses):
        cosines = [(np.trace(pose.rotation @ k.rotation.T) - 1) / 2 for k in kept]
        if all(c < np.cos(MAX_YAW) for c in cosines):
            kept.append(pose)
    return kept[:MAX_HYPOTHESES]


def _evidence(frames: CalibrationFrames, camera: Camera, refined: Refinement, tolerance: float) -> float:
    """Scores at the tolerance and at half of it: the tight one tells parallel lines apart."""
    pose, offset = refined.platform_from_camera, refined.foot_offset
    return sum(score(support(frames, camera, pose, t, None, offset)) for t in (tolerance, tolerance / 2))


def check_given(frames: CalibrationFrames, camera: Camera, vertical: tuple[Array, float], given: Pose3) -> Calibration:
    """The given extrinsics, with a warning and the numbers where the images disagree."""
    tolerance = TOLERANCE * camera.matrix[0, 0]
    counts = support(frames, camera, given, tolerance)
    warnings: list[str] = []
    tilt = float(np.degrees(np.arccos(np.clip(-given.rotation[2] @ vertical[0], -1, 1))))
    if tilt > max(1.0, np.degrees(3 * vertical[1])):
        warnings.append(
            f"extrinsics.yaml: the camera's vertical is {tilt:.1f} deg off the vertical lines in the images; "
            "the given value is used, leave the file out to have it estimated"
        )
    refined = refine(
        frames, camera, given, vertical, (4 * tolerance, 2 * tolerance, *(tolerance * f for f in REFINEMENT))
    )
    if refined is not None:
        warnings += _disagreement(given, refined)
    covariance = np.diag([0.002, 0.002, 0.002, 0.005, 0.005, 0.005]) ** 2
    return Calibration(given, covariance, "given", *_consensus(frames, counts), tuple(warnings))


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


def _thinned(frames: CalibrationFrames) -> CalibrationFrames:
    """At most MAX_FRAMES images, evenly spread."""
    if len(frames) <= MAX_FRAMES:
        return frames
    keep = np.unique(np.linspace(0, len(frames) - 1, MAX_FRAMES).astype(np.int64))
    line_parts = [np.arange(frames.line_offsets[i], frames.line_offsets[i + 1]) for i in keep]
    segment_parts = [np.arange(frames.segment_offsets[i], frames.segment_offsets[i + 1]) for i in keep]
    rows, segments = np.concatenate(line_parts), np.concatenate(segment_parts)
    return CalibrationFrames(
        frames.lines[rows],
        frames.line_groups[rows],
        np.cumsum([0, *(len(p) for p in line_parts)]),
        frames.segments[segments],
        frames.segment_groups[segments],
        np.cumsum([0, *(len(p) for p in segment_parts)]),
        frames.images[keep],
    )


def _lowest_plane(frames: CalibrationFrames, camera: Camera, refined: Refinement, tolerance: float) -> Pose3:
    """The pose, or the same a little higher where lines support a plane just below the one found.

    A baseboard's upper edge runs parallel to the wall's foot all around the building and explains the LiDAR as well;
    the floor is the lowest plane that lines support.
    """
    pose = refined.platform_from_camera
    lower = np.arange(0.0, LOWER_PLANE_RANGE[1] + 0.015, 0.01)
    poses = [Pose3(pose.rotation, pose.translation + np.array([0.0, 0.0, z])) for z in lower]
    values = np.array([score(support(frames, camera, p, tolerance / 2, None, refined.foot_offset)) for p in poses])
    peak = (values[1:-1] >= values[:-2]) & (values[1:-1] > values[2:]) & (lower[1:-1] > LOWER_PLANE_RANGE[0])
    found = np.flatnonzero(peak & (values[1:-1] > LOWER_PLANE_SUPPORT * values[:3].max())) + 1
    return poses[found[-1]] if len(found) else pose


def _consensus(frames: CalibrationFrames, counts: Array) -> tuple[tuple[int, ...], float]:
    """Images whose feet the lines explain, and the share explained in them."""
    mine = (counts[:, 1] > MIN_FOOT) & (counts[:, 0] > MIN_FRACTION * counts[:, 1])
    explained, projected = counts[mine].sum(axis=0) if mine.any() else (0.0, 1.0)
    return tuple(int(i) for i in frames.images[mine]), float(explained / projected)


def _result(frames: CalibrationFrames, camera: Camera, refined: Refinement, tolerance: float) -> Calibration:
    counts = support(frames, camera, refined.platform_from_camera, tolerance)
    images, fraction = _consensus(frames, counts)
    return Calibration(refined.platform_from_camera, refined.covariance, "estimated", images, fraction)
