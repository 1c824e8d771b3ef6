"""metrics.json: what a build cost and found, in numbers."""

from __future__ import annotations

import hashlib
import platform
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any

import numpy as np

import recon

if TYPE_CHECKING:
    from recon.pipeline import Build
    from recon.sequence.sequence import Sequence

LIBRARIES = ("gtsam", "numpy", "numba", "open3d", "opencv-python-headless", "scipy", "shapely", "usd-core")


def metrics(build: Build) -> dict[str, Any]:
    """Seconds and counts of every stage, residuals, calibration, versions and the input's fingerprint."""
    return {
        "version": 1,
        "seconds": build.seconds,
        "counts": build.counts,
        "residuals": build.estimate.residuals,
        "odometry_scale": build.estimate.odometry_scale,
        "odometry_clock": _clock(build),
        "calibration": _calibration(build),
        "tape": _tape(build),
        "control": _control(build),
        "faces": {f.name: {"seen_fraction": round(f.seen_fraction, 4)} for f in build.model.faces},
        "warnings": list(build.warnings),
        "versions": {"recon": recon.__version__, "python": platform.python_version(), **_versions()},
        "fingerprint": fingerprint(build.sequence),
    }


def _clock(build: Build) -> dict[str, float | None] | None:
    """By how much the odometry runs behind the scans, s; `used` is 0 where that is not significant."""
    if (clock := build.estimate.odometry_clock) is None:
        return None
    sigma = round(clock.sigma, 4) if np.isfinite(clock.sigma) else None
    return {"lag": round(clock.lag, 4), "sigma": sigma, "used": round(clock.believed, 4)}


def _calibration(build: Build) -> dict[str, Any] | None:
    if build.calibration is None:
        return None
    sigma, sigma_time = np.sqrt(np.diag(build.calibration.covariance)), build.calibration.sigma_time_offset
    return {
        "source": build.calibration.source,
        "sigma_rotation": [round(float(s), 6) for s in sigma[:3]],
        "sigma_translation": [round(float(s), 5) for s in sigma[3:]],
        "images": len(build.calibration.inlier_frames),
        "explained": round(build.calibration.inlier_fraction, 4),
        "time_offset": round(build.calibration.time_offset, 4),
        "measured_time_offset": round(build.calibration.measured_offset, 4),
        "sigma_time_offset": round(sigma_time, 4) if np.isfinite(sigma_time) else None,
    }


def _tape(build: Build) -> list[dict[str, Any]]:
    """Distances measured by hand, what they are in the model, and the difference in standard deviations."""
    if (tape := build.measured.tape) is None:
        return []
    rows = zip(tape.first, tape.second, tape.distance, tape.sigma, build.estimate.tape, strict=True)
    return [
        {
            "walls": [int(a), int(b)],
            "measured": float(distance),
            "sigma": float(sigma),
            "solved": round(float(solved), 5),
            "residual": round(float((solved - distance) / sigma), 3),
        }
        for a, b, distance, sigma, solved in rows
    ]


def _control(build: Build) -> dict[str, Any] | None:
    """The map in the survey's frame, and every control point: where the model has it, and the difference."""
    points, survey = build.measured.control, build.estimate.survey
    if points is None or survey is None:
        return None
    rows = zip(points.names, points.position, points.sigma, survey.solved, survey.kept, strict=True)
    return {
        "survey_from_map": [float(v) for v in survey.survey_from_map],
        "sigma": [float(f"{v:.4g}") for v in survey.sigma],
        "points": [
            {
                "name": name,
                "surveyed": place.tolist(),
                "sigma": float(sigma),
                "solved": solved.round(5).tolist(),
                "residual": ((solved - place) / sigma).round(3).tolist(),
                "used": bool(used),
            }
            for name, place, sigma, solved, used in rows
        ],
    }


def _versions() -> dict[str, str]:
    found = {}
    for name in LIBRARIES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found


def fingerprint(sequence: Sequence) -> str:
    """SHA-256 over scans, odometry, intrinsics, extrinsics, image times, names and sizes in bytes."""
    digest = hashlib.sha256()
    scans = sequence.scans
    digest.update(np.ascontiguousarray(scans.timestamps).tobytes())
    digest.update(np.ascontiguousarray(scans.ranges).tobytes())
    digest.update(repr((scans.angle_min, scans.angle_increment, scans.range_min, scans.range_max)).encode())
    if sequence.odometry is not None:
        digest.update(np.ascontiguousarray(sequence.odometry.poses).tobytes())
    if sequence.camera is not None:
        digest.update(sequence.camera.matrix.tobytes() + sequence.camera.distortion.tobytes())
    if sequence.platform_from_camera is not None:
        digest.update(sequence.platform_from_camera.matrix().tobytes())
    if sequence.images is not None:
        digest.update(sequence.images.timestamps.tobytes())
        for i, name in enumerate(sequence.images.names):
            digest.update(f"{name} {sequence.images.size(i)}".encode())
    return digest.hexdigest()
