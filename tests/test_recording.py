"""`recon view -o run.rrd`, read back by Rerun's own program."""

from __future__ import annotations

import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from small_build import Small

from recon.errors import InputError
from recon.sequence.folder import read_sequence


def rows(path: Path) -> dict[str, int]:
    """Rows of every entity of a recording."""
    pytest.importorskip("rerun", reason="rerun-sdk is not installed")
    program = [sys.executable, "-m", "rerun_cli", "rrd"]
    assert subprocess.run([*program, "verify", str(path)], capture_output=True, timeout=120).returncode == 0
    text = subprocess.run(
        [*program, "print", str(path)], capture_output=True, text=True, timeout=120, check=True
    ).stdout
    out: dict[str, int] = {}
    for count, entity in re.findall(r"^Chunk\(\w+\) with (\d+) rows? \([^)]*\) - (\S+) - ", text, re.MULTILINE):
        out[entity] = out.get(entity, 0) + int(count)
    return out


def test_a_recording_holds_what_result_and_sequence_hold(small: Small, tmp_path: Path, run_recon: Any) -> None:
    pytest.importorskip("rerun", reason="rerun-sdk is not installed")
    done = run_recon("view", small.folder, small.sequence, "-o", tmp_path / "run.rrd")
    assert done.status == 0, done.errors
    found = rows(tmp_path / "run.rrd")
    drive, model = read_sequence(small.sequence), small.build.model
    assert drive.images is not None
    assert found["/world/platform"] == found["/world/platform/scan"] == len(drive.scans)
    assert found["/world/camera/image"] == len(drive.images) + 1  # and the lens
    assert found["/world/camera"] == len(drive.images)
    for face in model.faces:
        assert (f"/world/model/{face.name}" in found) == (face.kind != "ceiling")
    assert found["/world/walls/lidar"] == found["/world/trajectory"] == 1


def test_the_viewer_is_told_what_to_show_first(small: Small) -> None:
    """One view in 3D with the building before its eye, and beside it image, sigmas and residuals."""
    pytest.importorskip("rerun", reason="rerun-sdk is not installed")
    from recon.recording import _blueprint, _read

    result = _read(small.folder)
    shown = _blueprint(result, read_sequence(small.sequence)).root_container
    view, beside = shown.contents
    assert [part.origin for part in beside.contents] == ["world/camera/image", "sigma", "residuals"]
    eye = view.properties["EyeControls3D"]
    position, target = (np.array(batch.as_arrow_array().to_pylist()[0]) for batch in (eye.position, eye.look_target))
    points = np.concatenate([face.vertices for face in small.build.model.faces])
    assert target == pytest.approx((points.min(axis=0) + points.max(axis=0)) / 2, abs=1e-3)
    away = (points - position) @ (target - position) / np.linalg.norm(target - position)
    off = np.linalg.norm(
        points - position - np.outer(away, (target - position) / np.linalg.norm(target - position)), axis=1
    )
    assert (np.degrees(np.arctan2(off, away)) < 35).all()  # in view
    bare = _blueprint(result, None).root_container
    assert [part.origin for part in bare.contents[1].contents] == ["sigma", "residuals"]


def test_without_the_sequence_there_are_no_scans(small: Small, tmp_path: Path, run_recon: Any) -> None:
    pytest.importorskip("rerun", reason="rerun-sdk is not installed")
    assert run_recon("view", small.folder, "-o", tmp_path / "run.rrd").status == 0
    found = rows(tmp_path / "run.rrd")
    assert "/world/platform" in found and "/world/platform/scan" not in found and "/world/camera" not in found


def test_another_sequence_is_refused_and_no_file_is_left(small: Small, tmp_path: Path) -> None:
    pytest.importorskip("rerun", reason="rerun-sdk is not installed")
    from recon.recording import save_recording

    drive = read_sequence(small.sequence)
    scans = replace(drive.scans, timestamps=drive.scans.timestamps[:-1], ranges=drive.scans.ranges[:-1])
    with pytest.raises(InputError, match=r"expected the one that the result was built from"):
        save_recording(small.folder, replace(drive, scans=scans), tmp_path / "run.rrd")
    assert list(tmp_path.iterdir()) == []


def test_images_lose_their_distortion(small: Small) -> None:
    """A point drawn where the lens puts it comes out where a pinhole would."""
    from recon.recording import _undistorted
    from recon.sequence.camera import Camera

    camera = Camera(
        320, 240, np.array([[200.0, 0, 160], [0, 200, 120], [0, 0, 1]]), distortion=np.array([-0.3, 0.1, 0, 0, 0])
    )
    drive = replace(small.build.sequence, camera=camera)
    for spot in ([0.4, 0.3, 1.0], [-0.5, 0.1, 1.0], [0.05, -0.4, 1.0]):
        raw = np.zeros((240, 320, 3), np.uint8)
        x, y = camera.project([spot])[0].round().astype(int)
        raw[y - 2 : y + 3, x - 2 : x + 3] = 255
        bright = np.argwhere(_undistorted(raw, drive)[..., 0] > 100).mean(axis=0)[::-1]
        assert bright == pytest.approx(camera.rectified().project([spot])[0], abs=1.2)


def test_a_full_disk_is_said_and_no_part_is_left(small: Small, tmp_path: Path, run_recon: Any) -> None:
    """A limit on the size of files stands in for the disk."""
    pytest.importorskip("rerun", reason="rerun-sdk is not installed")
    resource = pytest.importorskip("resource", reason="no limits on this system")
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, hard))
    try:
        done = run_recon("view", small.folder, "-o", tmp_path / "run.rrd")
        page = run_recon("report", small.folder, "-o", tmp_path / "report.html")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert done.status == page.status == 2
    assert "run.rrd: cannot be written" in done.errors[-1] and "report.html: cannot be written" in page.errors[-1]
    assert list(tmp_path.iterdir()) == []


def test_other_suffixes_are_refused(small: Small, tmp_path: Path, run_recon: Any) -> None:
    done = run_recon("view", small.folder, "-o", tmp_path / "run.mp4")
    assert done.status == 2 and "expected .rrd" in done.errors[-1]
