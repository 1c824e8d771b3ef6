"""The camera's clock: offsets planted in simulated and in path-traced drives come back, with their sigma."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from few_images import every_image

from recon.calibration.calibrate import TOLERANCE, calibrate
from recon.calibration.clock import heading_offset
from recon.calibration.frames import collect_frames
from recon.calibration.result import Calibration
from recon.calibration.search import is_reflection
from recon.calibration.support import CalibrationFrames
from recon.calibration.synchronise import Drive, calibrate_with_clock, platform_twists
from recon.config import CalibrationConfig, LidarConfig, VisionConfig
from recon.geometry import Array, Pose3
from recon.lidar.matching import match_scans
from recon.lidar.noise import with_noise
from recon.lidar.segment import Segments
from recon.lidar.split_and_merge import extract_segments
from recon.sequence.camera import Camera
from recon.sequence.images import iterate_images
from recon.sequence.open import open_sequence
from recon.sequence.trajectory import Trajectory
from recon.simulate import random_plan, simulate
from recon.vision.frame import FrameLines
from recon.vision.frame_lines import detect_lines, relabel
from recon.vision.vertical import vertical_direction


@dataclass(frozen=True)
class Features:
    """What calibration starts from."""

    lines: list[FrameLines | None]
    vertical: tuple[Array, float]
    times: Array
    camera: Camera
    trajectory: Trajectory
    segments: list[Segments]

    def calibrated(self, late: float) -> Calibration | None:
        """With image stamps that are `late` s too small, so that as much is to be added to them."""
        times = self.times - late

        def collect(offset: float) -> CalibrationFrames:
            return collect_frames(self.lines, times + offset, self.trajectory, self.segments)

        def solve(frames: CalibrationFrames) -> Calibration | None:
            return calibrate(frames, self.camera, self.vertical, CalibrationConfig())

        drive = Drive(collect, times, self.trajectory, self.camera, self.vertical, TOLERANCE * self.camera.matrix[0, 0])
        return calibrate_with_clock(drive, solve, heading_offset(self.lines, self.vertical[0], times, self.trajectory))


def features(folder: Path, every: int = 1) -> Features:
    """Of every so-many image."""
    sequence = every_image(every, open_sequence(folder))
    camera, images, scans = sequence.camera, sequence.images, sequence.scans
    assert camera is not None and images is not None
    config = with_noise(scans, LidarConfig())
    matching = match_scans(scans, None, config)
    segments = [extract_segments(scans, i, config, matching.velocities[i]) for i in range(len(scans))]
    found = [detect_lines(grey, camera, VisionConfig(), 0) for _, grey in iterate_images(images, camera, grey=True)
             if grey is not None]  # fmt: skip
    down, sigma, _ = vertical_direction(found, camera)
    lines: list[FrameLines | None] = [relabel(f, camera, down) for f in found]
    return Features(lines, (down, sigma), images.timestamps, camera, matching.trajectory, segments)


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> Features:
    """Two rooms, small pictures."""
    folder = tmp_path_factory.mktemp("clock") / "drive"
    plan = random_plan(seed=13, rooms=2, angles="any")
    small = replace(plan.camera, image_width=320, image_height=240, fx=250, fy=250, cx=None, cy=None, rate=2.0)
    simulate(replace(plan, camera=small, write_odometry=False), folder, seed=13)
    return features(folder)


@pytest.mark.parametrize("late", [-0.12, 0.0, 0.08])
def test_a_planted_offset_comes_back(simulated: Features, late: float) -> None:
    result = simulated.calibrated(late)
    assert result is not None
    assert result.measured_offset == pytest.approx(late, abs=min(0.01, 4 * result.sigma_time_offset))
    assert 0.001 < result.sigma_time_offset < 0.01
    assert result.time_offset == (0.0 if late == 0 else result.measured_offset)
    assert np.allclose(result.on_scan_clock(np.array([5.0])), 5.0 + result.time_offset)


def test_the_corridors_images_late_by_a_tenth_of_a_second(shared_data: Callable[[str], Path]) -> None:
    """The camera is found as well as with the right stamps, which are left alone."""
    seen = features(shared_data("corridor"), every=2)
    right, shifted = seen.calibrated(0.0), seen.calibrated(0.1)
    assert right is not None and shifted is not None
    assert right.time_offset == 0.0 and abs(right.measured_offset) < 0.008
    assert shifted.time_offset == pytest.approx(0.1, abs=0.008)
    a, b = right.platform_from_camera, shifted.platform_from_camera
    assert b.translation == pytest.approx(a.translation, abs=0.003)
    assert np.degrees(np.arccos(min(1.0, (np.trace(a.rotation @ b.rotation.T) - 1) / 2))) < 0.05


def test_a_platform_that_never_turns_tells_no_offset(simulated: Features) -> None:
    straight = simulated.trajectory.poses * np.array([1.0, 1.0, 0.0])
    trajectory = Trajectory(simulated.trajectory.timestamps, straight)
    clock = heading_offset(simulated.lines, simulated.vertical[0], simulated.times, trajectory)
    assert clock.offset == 0.0 and not clock.sigma < 1.0 and not clock.is_significant
    unknown = Calibration(Pose3.identity(), np.eye(6), "estimated")
    assert "does not tell" in unknown.clock


def test_twists_of_a_turn() -> None:
    """On a circle of 2 m at 1 m/s."""
    t = np.arange(0.0, 6.0, 0.02)
    poses = np.stack([2 * np.sin(t / 2), 2 - 2 * np.cos(t / 2), t / 2], axis=1)
    twists = platform_twists(Trajectory(t, poses), np.array([1.0, 3.3]))
    assert twists == pytest.approx(np.array([[1.0, 0.0, 0.5]] * 2), abs=2e-3)


def test_a_baseboard_mirrored_in_the_floor_is_no_floor() -> None:
    """Planes from high to low: the baseboard's edge, the floor 9 cm below, its picture as far below that."""
    support = np.zeros(40)
    support[[5, 14, 23]] = 900.0, 850.0, 600.0
    peaks = np.array([5, 14, 23])
    assert is_reflection(23, peaks, support)
    assert not is_reflection(14, peaks, support)
    support[23] = 950.0  # better seen than what it would mirror
    assert not is_reflection(23, peaks, support)
