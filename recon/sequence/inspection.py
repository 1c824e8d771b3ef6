"""What a sequence holds, in lines for people."""

from __future__ import annotations

import numpy as np

from recon.geometry import Array, wrap_angle
from recon.sequence.camera import Camera
from recon.sequence.sequence import ImageList, Scans, Sequence
from recon.sequence.trajectory import Trajectory


def describe(sequence: Sequence) -> list[str]:
    """Counts, rates, gaps, fields of view, range limits, returns, path length: a few lines."""
    lines = [f"Sequence:   {sequence.name}", *_describe_scans(sequence.scans)]
    if sequence.camera is None or sequence.images is None:
        lines.append("Images:     none (walls come out untextured)")
    else:
        lines += _describe_images(sequence.images, sequence.camera)
    if sequence.odometry is None:
        lines.append("Odometry:   none (estimated from the scans)")
    else:
        lines += _describe_odometry(sequence.odometry)
    if sequence.platform_from_camera is not None:
        x, y, z = sequence.platform_from_camera.translation
        lines.append(f"Extrinsics: given, camera at x {x:.3f}, y {y:.3f}, {z:.3f} m above the floor")
    elif sequence.images is not None:
        lines.append("Extrinsics: none (estimated from the images)")
    return lines


def _describe_scans(scans: Scans) -> list[str]:
    beams = scans.ranges.shape[1]
    step, valid = np.degrees(scans.angle_increment), np.array([scans.valid(i).mean() for i in range(len(scans))])
    finite = scans.ranges[np.isfinite(scans.ranges)]
    turn = f", one turn takes {abs(scans.time_increment) * beams * 1000:.0f} ms" if scans.time_increment else ""
    no_return, invalid = np.isinf(scans.ranges).mean(), np.isnan(scans.ranges).mean()
    return [
        f"Scans:      {len(scans)}{_rate(scans.timestamps)}",
        f"            {beams} beams over {(beams - 1) * step:.0f} deg, {step:.3f} deg apart, from "
        f"{np.degrees(scans.angle_min):.0f} deg{turn}{_blind_sector(scans)}",
        f"            limits {scans.range_min:g} to {scans.range_max:g} m; {valid.mean():.0%} of beams returned, "
        f"{no_return:.0%} no return, {invalid:.0%} invalid; median range {np.median(finite):.1f} m",
    ]


def _is_full_turn(scans: Scans) -> bool:
    return bool(scans.ranges.shape[1] * scans.angle_increment > 2 * np.pi - 0.01)


def _blind_sector(scans: Scans) -> str:
    """The widest run of beams that never returned, when it is over 5 degrees."""
    seen = np.any([scans.valid(i) for i in range(len(scans))], axis=0)
    longest = run = 0
    for beam in np.concatenate([seen, seen]) if _is_full_turn(scans) else seen:  # it may go over the seam
        run = 0 if beam else run + 1
        longest = max(longest, run)
    width = np.degrees(longest * scans.angle_increment)
    return f", {width:.0f} deg never return" if width > 5 else ""


def _describe_images(images: ImageList, camera: Camera) -> list[str]:
    middle = (camera.height - 1) / 2
    ends = camera.undistort([[0, middle], [camera.width - 1, middle]])
    view = np.degrees(np.sum(np.abs(np.arctan(ends[:, 0]))))
    lens = camera.distortion_model if camera.is_distorted else "no distortion"
    return [
        f"Images:     {len(images)}{_rate(images.timestamps)}",
        f"            {camera.width} x {camera.height} pixels, {view:.0f} deg wide, {lens}",
    ]


def _describe_odometry(odometry: Trajectory) -> list[str]:
    steps = np.linalg.norm(np.diff(odometry.poses[:, :2], axis=0), axis=1)
    turns = np.degrees(np.abs(wrap_angle(np.diff(odometry.poses[:, 2]))))
    return [
        f"Odometry:   {len(odometry)} poses{_rate(odometry.timestamps)}",
        f"            path {steps.sum():.1f} m, turns {turns.sum():.0f} deg in all",
    ]


def _rate(timestamps: Array) -> str:
    """Rate, span and gaps (over three times the median interval)."""
    if len(timestamps) < 2:
        return ""
    intervals = np.diff(timestamps)
    usual = float(np.median(intervals))
    gaps = intervals[intervals > 3 * usual]
    longest = f"; {len(gaps)} gap{'s' if len(gaps) > 1 else ''}, the longest {gaps.max():.1f} s" if len(gaps) else ""
    return f" in {timestamps[-1] - timestamps[0]:.1f} s, {1 / usual:.1f} Hz{longest}"
