from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np
import pytest
from hypothesis import settings

if TYPE_CHECKING:
    from small_build import Small

# No test fails for being slow, nor by chance: every run tries the same examples, HYPOTHESIS_PROFILE=explore others.
settings.register_profile("same", deadline=None, derandomize=True)
settings.register_profile("explore", deadline=None, print_blob=True)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "same"))

ROOT = Path(__file__).resolve().parents[1]

CAMERA_YAML = """\
image_width: 32
image_height: 24
camera_name: front
camera_matrix: {rows: 3, cols: 3, data: [30, 0, 15.5, 0, 30, 11.5, 0, 0, 1]}
distortion_model: plumb_bob
distortion_coefficients: {rows: 1, cols: 5, data: [-0.1, 0.02, 0.0005, -0.0004, 0]}
"""


SHARED = {"sample": "corridor", "bare_sample": "corridor", "small": "small", "simulated": "clock", "small_set": "paper"}
"""Fixtures that are built once, and the group of tests that one worker runs so that they are (`--dist loadgroup`)."""
LONG = ("test_pipeline.py", "test_views.py", "test_blind.py", "test_sweep.py")
"""Files whose tests come first, so that no worker is left with one at the end."""


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    items.sort(key=lambda item: item.path.name not in LONG)
    for item in items:
        groups = {SHARED[name] for name in getattr(item, "fixturenames", ()) if name in SHARED}
        for group in sorted(groups)[:1]:
            item.add_marker(pytest.mark.xdist_group(group))


@pytest.fixture(scope="session")
def shared_data() -> Callable[[str], Path]:
    """Folder of a named data set beside the checkout; the test is skipped where it is not there."""

    def folder(name: str) -> Path:
        path = ROOT.parent / "shared" / "data" / name
        if not path.exists():
            pytest.skip(f"data set {name} is not beside this checkout (../shared/data)")
        return path

    return folder


@pytest.fixture
def tiny_sequence(tmp_path: Path) -> Path:
    """A small, valid sequence folder `drive`: 6 scans of 90 beams in a 4 m x 4 m room, 5 images, odometry."""
    folder = tmp_path / "drive"
    (folder / "images").mkdir(parents=True)
    bearings = -np.pi + np.arange(90) * 2 * np.pi / 90
    ranges = 2 / np.maximum(np.abs(np.cos(bearings)), np.abs(np.sin(bearings)))
    np.savez(
        folder / "scans.npz",
        timestamps=10 + 0.1 * np.arange(6),
        ranges=np.tile(ranges, (6, 1)).astype(np.float32),
        angle_min=-np.pi,
        angle_increment=2 * np.pi / 90,
        range_min=0.1,
        range_max=10.0,
    )
    (folder / "camera.yaml").write_text(CAMERA_YAML)
    rng = np.random.default_rng(0)
    lines = ["# timestamp path"]
    for i in range(5):
        cv2.imwrite(str(folder / "images" / f"{i}.jpg"), rng.integers(0, 256, (24, 32, 3), dtype=np.uint8))
        lines.append(f"{10.03 + 0.1 * i:.6f} images/{i}.jpg")
    (folder / "images.txt").write_text("\n".join(lines) + "\n")
    poses = [f"{10 + 0.1 * i:.6f} 0 0 0 0 0 0 1" for i in range(6)]
    (folder / "odometry.txt").write_text("\n".join(poses) + "\n")
    return folder


@dataclass(frozen=True)
class CommandResult:
    """What a run of the command line left: exit status and the lines on standard output and standard error."""

    status: int
    output: list[str]
    errors: list[str]


@pytest.fixture
def run_recon(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Callable[..., CommandResult]:
    """`run_recon("build", folder, "-o", path)`: the command line in this process, its descriptors captured."""
    from recon.cli.main import main

    def run(*arguments: object) -> CommandResult:
        monkeypatch.setattr(sys, "argv", ["recon", *map(str, arguments)])
        handler, status = signal.getsignal(signal.SIGTERM), 0
        capfd.readouterr()
        try:
            main()
        except SystemExit as end:
            status = int(end.code or 0)
        finally:
            signal.signal(signal.SIGTERM, handler)
        captured = capfd.readouterr()
        return CommandResult(status, captured.out.splitlines(), captured.err.splitlines())

    return run


@pytest.fixture(scope="session")
def small(tmp_path_factory: pytest.TempPathFactory) -> Small:
    """A small build with images, and its result folder."""
    from small_build import build_small

    return build_small(tmp_path_factory.mktemp("small"))
