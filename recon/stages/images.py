"""Steps that need the images: their lines, the camera on the platform, where each image was taken."""

from __future__ import annotations

import numpy as np

from recon.calibration.calibrate import TOLERANCE, calibrate, check_given
from recon.calibration.clock import heading_offset
from recon.calibration.frames import collect_frames
from recon.calibration.result import Calibration
from recon.calibration.support import CalibrationFrames
from recon.calibration.synchronise import Drive, calibrate_with_clock
from recon.faces import extrude
from recon.geometry import Array, Pose3
from recon.graph.between import Between, poses_between
from recon.graph.estimate import MapEstimate
from recon.lidar.segment import ScanSegments
from recon.model import Layout
from recon.sequence.images import iterate_images
from recon.sequence.trajectory import Trajectory
from recon.stages.observed import Views
from recon.stages.run import Run
from recon.texture.refine import camera_sigmas, refine_poses
from recon.vision.frame import FrameLines
from recon.vision.frame_lines import detect_lines, relabel
from recon.vision.vertical import vertical_direction

MAX_EXTRAPOLATION = 0.2
"""s: images farther outside the scans' time have no pose."""

Poses = tuple[Pose3 | None, ...]


def detect_image_lines(run: Run) -> Views:
    """Lines and vanishing points of every image, and the vertical that all images share (paper 2.2, 2.3.1)."""
    if run.sight is None:
        return Views([], None)
    images, camera = run.sight
    frames: list[FrameLines | None] = []
    with run.stage("image lines", len(images), "images") as stage:
        for _, image in iterate_images(images, camera, grey=True, warnings=run.warnings):
            frames.append(None if image is None else detect_lines(image, camera, run.config.vision, run.config.seed))
            stage.advance()
        found = [f for f in frames if f is not None]
        down, sigma, count = vertical_direction(found, camera)
        run.counts |= {"images": len(frames), "image lines": sum(map(len, found)), "vertical lines": count}
        if count == 0:
            run.warnings.append(
                "no image shows vertical lines of a camera that looks at most 12 degrees up, 57 down and leans by 20; "
                "the images are left out"
            )
            return Views(frames, None)
        return Views([None if f is None else relabel(f, camera, down) for f in frames], (down, sigma))


def calibrate_camera(run: Run, views: Views, trajectory: Trajectory, segments: ScanSegments) -> Calibration | None:
    """platform_from_camera, estimated or given and checked (paper 2.3, 2.4), and the camera's clock."""
    if run.sight is None or views.vertical is None:
        return None
    (images, camera), vertical, given = run.sight, views.vertical, run.sequence.platform_from_camera
    times = images.timestamps

    def collect(offset: float) -> CalibrationFrames:
        return collect_frames(views.lines, times + offset, trajectory, segments)

    def solve(frames: CalibrationFrames) -> Calibration | None:
        if given is not None:
            return check_given(frames, camera, vertical, given)
        return calibrate(frames, camera, vertical, run.config.calibration, run.config.seed)

    with run.stage("calibration"):
        drive = Drive(collect, times, trajectory, camera, vertical, TOLERANCE * camera.matrix[0, 0])
        result = calibrate_with_clock(drive, solve, heading_offset(views.lines, vertical[0], times, trajectory))
    if result is None:
        run.warnings.append(
            "the camera's pose on the platform was not found (too few wall feet agree with the scans); "
            "the model stays untextured, give extrinsics.yaml to use the images"
        )
        return None
    run.warnings.extend(result.warnings)
    run.counts["calibration images"] = len(result.inlier_frames)
    return result


def place_cameras(run: Run, calibration: Calibration | None, estimate: MapEstimate) -> Poses:
    """map_from_camera at every image; None where the image is outside the scans' time."""
    images = run.sequence.images
    if images is None:
        return ()
    if calibration is None:
        return (None,) * len(images)
    times, trajectory = calibration.on_scan_clock(images.timestamps), estimate.trajectory
    first, last = trajectory.timestamps[0] - MAX_EXTRAPOLATION, trajectory.timestamps[-1] + MAX_EXTRAPOLATION
    inside = (times >= first) & (times <= last)
    if not inside.all():
        run.warnings.append(
            f"{int((~inside).sum())} of {len(times)} images lie outside the scans' time and are left out"
        )
    return tuple(
        Pose3.from_planar(pose) @ calibration.platform_from_camera if ok else None
        for pose, ok in zip(_platform(run, estimate, times).poses, inside, strict=True)
    )


def _platform(run: Run, estimate: MapEstimate, times: Array) -> Between:
    odometry, clock = run.sequence.odometry, estimate.odometry_clock
    if odometry is not None and clock is not None:
        odometry = clock.on_scan_clock(odometry)
    return poses_between(estimate.trajectory, times, odometry)


def refine_cameras(
    run: Run, calibration: Calibration | None, estimate: MapEstimate, layout: Layout, poses: Poses
) -> Poses:
    """The cameras, moved within what is known of them so that images agree on the faces."""
    if run.sight is None or calibration is None:
        return poses
    images, camera = run.sight
    times = calibration.on_scan_clock(images.timestamps)
    at_scans = camera_sigmas(estimate.pose_sigmas[estimate.trajectory.nearest(times)])
    sigmas = np.hypot(at_scans, _platform(run, estimate, times).sigmas)
    with run.stage("image poses"):
        return refine_poses(extrude(layout), camera, poses, run.load, sigmas, run.config.workers)
