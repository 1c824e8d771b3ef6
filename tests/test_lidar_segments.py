from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recon.config import LidarConfig
from recon.geometry import Array, apply2, wrap_angle
from recon.lidar.directions import manhattan_groups, principal_directions
from recon.lidar.noise import estimate_range_sigma, with_noise
from recon.lidar.segment import Segments
from recon.lidar.split_and_merge import extract_segments
from recon.sequence.sequence import Scans

# walls of a convex room: outward normal angle (rad) and distance from the room's origin (m); no right angles
ROOM = np.array([(0.1, 3.0), (1.5, 2.0), (3.3, 2.5), (4.9, 1.8)])


def room_ranges(pose: Array, bearings: Array, walls: Array = ROOM) -> Array:
    """True ranges (B,) of a scanner at `pose` (room frame): the nearest wall plane in front of each beam."""
    normals = np.stack([np.cos(walls[:, 0]), np.sin(walls[:, 0])], axis=1)
    beams = np.stack([np.cos(bearings + pose[2]), np.sin(bearings + pose[2])], axis=1)
    with np.errstate(divide="ignore"):
        ranges = (walls[:, 1] - normals @ pose[:2]) / (beams @ normals.T)
    return np.asarray(np.where(ranges > 0, ranges, np.inf).min(axis=1))


def scanner(count: int = 720, field: float = 2 * np.pi) -> Array:
    return np.asarray(-field / 2 + field / count * np.arange(count, dtype=np.float64))


def scans_of(ranges: Array, bearings: Array) -> Scans:
    rows = np.atleast_2d(ranges).astype(np.float32)
    return Scans(0.1 * np.arange(len(rows), dtype=np.float64), rows, bearings[0], bearings[1] - bearings[0], 0.05, 20.0)


def line_errors(segments: Segments, pose: Array, walls: Array = ROOM) -> Array:
    """(M, 2) offset (m) at the middle and angle (rad) of each segment minus those of the nearest true wall."""
    out = []
    for middle, angle in zip(segments.midpoints, segments.angles, strict=True):
        x, y = apply2(pose, middle[None])[0]
        # walking along the wall with the scanner on the left, the outward normal is to the right
        turn = wrap_angle(angle + pose[2] - np.pi / 2 - walls[:, 0])
        wall = int(np.argmin(np.abs(turn)))
        normal = np.array([np.cos(walls[wall, 0]), np.sin(walls[wall, 0])])
        out.append((walls[wall, 1] - normal @ [x, y], turn[wall]))
    return np.array(out)


@pytest.mark.parametrize(("beams", "sigma"), [(720, 0.01), (1080, 0.03), (360, 0.02)])
def test_lines_are_as_accurate_as_their_covariance_says(beams: int, sigma: float) -> None:
    rng, bearings, config = np.random.default_rng(1), scanner(beams), LidarConfig(range_sigma=sigma)
    squares = []
    for _ in range(150):
        pose = np.array([*rng.uniform(-1, 1, 2), rng.uniform(-np.pi, np.pi)])
        ranges = room_ranges(pose, bearings) + rng.normal(0, sigma, beams)
        segments = extract_segments(scans_of(ranges, bearings), 0, config)
        errors = line_errors(segments, pose)
        long = segments.lengths > 1.0
        squares += list(np.einsum("mi,mij,mj->m", errors, np.linalg.inv(segments.covariance), errors)[long])
    assert 500 < len(squares) < 700  # four walls a scan, hardly ever more or fewer
    assert 0.7 < np.mean(squares) / 2 < 1.3


@given(
    x=st.floats(-1, 1), y=st.floats(-1, 1), yaw=st.floats(-np.pi, np.pi), beams=st.integers(250, 1440)
)  # fmt: skip
@settings(max_examples=60, deadline=None)
def test_a_convex_room_without_noise_gives_its_walls_and_nothing_else(
    x: float, y: float, yaw: float, beams: int
) -> None:
    pose, bearings = np.array([x, y, yaw]), scanner(beams)
    segments = extract_segments(scans_of(room_ranges(pose, bearings), bearings), 0, LidarConfig(range_sigma=0.01))
    assert len(segments) == 4
    assert np.abs(line_errors(segments, pose)).max() < 0.01
    for (start, end), count in zip(segments.endpoints, segments.counts, strict=True):
        assert start[0] * end[1] - start[1] * end[0] > 0  # the scanner is on the left
        assert count >= 8


def test_scans_that_run_clockwise_give_the_same_lines() -> None:
    bearings = scanner(500)
    ranges = room_ranges(np.array([0.3, -0.2, 0.4]), bearings)
    one = extract_segments(scans_of(ranges, bearings), 0, LidarConfig(range_sigma=0.01))
    other = extract_segments(scans_of(ranges[::-1], bearings[::-1]), 0, LidarConfig(range_sigma=0.01))
    np.testing.assert_allclose(one.endpoints, other.endpoints, atol=1e-9)
    np.testing.assert_array_equal(one.beams, 499 - other.beams)


def test_segment_across_the_seam_of_a_full_circle_is_one() -> None:
    bearings = scanner(720)
    for yaw in np.linspace(0, 2 * np.pi, 25):
        scan = scans_of(room_ranges(np.array([0.0, 0.0, yaw]), bearings), bearings)
        segments = extract_segments(scan, 0, LidarConfig(range_sigma=0.01))
        assert len(segments) == 4
        first, last = segments.beams.T
        np.testing.assert_array_equal((last - first) % 720 + 1 >= segments.counts, True)


def test_invalid_beams_outliers_and_mixed_pixels_do_not_cut_walls() -> None:
    rng, bearings = np.random.default_rng(3), scanner(720)
    pose = np.array([0.2, 0.1, 0.0])
    clean = room_ranges(pose, bearings)
    ranges = clean + rng.normal(0, 0.01, 720)
    ranges[rng.random(720) < 0.05] = np.inf
    ranges[rng.random(720) < 0.03] = np.nan
    lone = rng.choice(720, 12, replace=False)
    ranges[lone] = rng.uniform(0.3, 1.0, 12) * clean[lone]
    segments = extract_segments(scans_of(ranges, bearings), 0, LidarConfig(range_sigma=0.01))
    assert len(segments) == 4
    assert np.abs(line_errors(segments, pose)).max() < 0.01


def test_recessed_door_is_its_own_segment() -> None:
    rng, bearings = np.random.default_rng(4), scanner(1080, np.pi)
    y = 1.1 * np.ones(1080)
    wall = y / np.sin(np.clip(bearings + np.pi / 2, 0.2, np.pi - 0.2))
    along = wall * np.cos(bearings + np.pi / 2)
    recess = (along > 0.2) & (along < 1.1)
    wall[recess] *= (1.1 + 0.08) / 1.1
    wall += rng.normal(0, 0.01, 1080)
    wall[np.abs(bearings) > 1.2] = np.inf
    segments = extract_segments(scans_of(wall, bearings), 0, LidarConfig(range_sigma=0.01))
    assert len(segments) == 3
    offsets = np.hypot(*segments.midpoints.T) * np.cos(
        np.arctan2(segments.midpoints[:, 1], segments.midpoints[:, 0]) - segments.angles + np.pi / 2
    )
    np.testing.assert_allclose(offsets, [1.1, 1.18, 1.1], atol=0.006)
    assert segments.lengths[1] == pytest.approx(0.9 * 1.18 / 1.1, abs=0.03)


def test_nothing_to_see_gives_no_segments() -> None:
    bearings = scanner(360)
    for ranges in (np.full(360, np.inf), np.full(360, np.nan), np.full(360, -1.0)):
        assert len(extract_segments(scans_of(ranges, bearings), 0, LidarConfig())) == 0
    ranges = np.full(360, np.inf)
    ranges[5:8] = 2.0
    assert len(extract_segments(scans_of(ranges, bearings), 0, LidarConfig(range_sigma=0.01))) == 0


def test_motion_distortion_is_taken_out() -> None:
    velocity, bearings = np.array([0.6, -0.1, 1.2]), scanner(720)
    step = 0.1 / 720
    ranges = np.empty(720)
    for b in range(720):
        # fine Euler steps: independent of the closed form in the library
        pose = np.zeros(3)
        for _ in range(20):
            pose += np.array([*apply2([0, 0, pose[2]], velocity[None, :2])[0], velocity[2]]) * (b * step / 20)
        ranges[b] = room_ranges(pose, bearings[b : b + 1])[0]
    scans = Scans(
        np.zeros(1), ranges[None].astype(np.float32), bearings[0], bearings[1] - bearings[0], 0.05, 20.0, step
    )
    still, true = np.zeros(3), extract_segments(scans, 0, LidarConfig(range_sigma=0.01), velocity)
    assert len(true) in (4, 5)  # the wall at the seam is seen twice
    assert np.abs(line_errors(true, still)).max() < 1e-3
    distorted = extract_segments(scans, 0, LidarConfig(range_sigma=0.01))
    assert np.abs(line_errors(distorted, still)).max() > 0.02


@pytest.mark.parametrize("sigma", [0.004, 0.01, 0.03])
def test_range_noise_is_found_from_the_scans(sigma: float) -> None:
    rng, bearings = np.random.default_rng(5), scanner(720)
    poses = np.column_stack([rng.uniform(-1, 1, (20, 2)), rng.uniform(-3, 3, 20)])
    ranges = np.array([room_ranges(p, bearings) for p in poses]) + rng.normal(0, sigma, (20, 720))
    scans = scans_of(ranges, bearings)
    assert estimate_range_sigma(scans) == pytest.approx(sigma, rel=0.12)
    assert with_noise(scans, LidarConfig()).range_sigma == estimate_range_sigma(scans)
    assert with_noise(scans, LidarConfig(range_sigma=0.02)).range_sigma == 0.02
    by_default = extract_segments(scans, 0, LidarConfig())
    resolved = extract_segments(scans, 0, with_noise(scans, LidarConfig()))
    np.testing.assert_array_equal(by_default.covariance, resolved.covariance)


def test_range_noise_without_surfaces_is_a_cautious_default() -> None:
    bearings = scanner(90)
    assert 0.005 <= estimate_range_sigma(scans_of(np.full(90, np.inf), bearings)) <= 0.02


@given(frame=st.floats(0, np.pi / 2), skew=st.floats(0.3, 1.2), seed=st.integers(0, 1000))
@settings(max_examples=50, deadline=None)
def test_directions_of_a_building_with_a_skew_wing(frame: float, skew: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    groups = [(frame, 60), (frame + np.pi / 2, 40), (frame + np.pi, 20), (frame + skew, 25)]
    angles = np.concatenate([a + rng.normal(0, 0.01, n) for a, n in groups] + [rng.uniform(0, np.pi, 15)])
    found = principal_directions(wrap_angle(angles), np.ones(len(angles)))
    true = np.array([frame, frame + np.pi / 2, frame + skew])
    assert len(found) == 3
    miss = (found.angles - true + np.pi / 2) % np.pi - np.pi / 2
    assert np.abs(miss).max() < 0.01
    labels = found.assign(angles)
    expected = np.repeat([0, 1, 0, 2], [n for _, n in groups])
    np.testing.assert_array_equal(labels[: len(expected)], expected)


def test_directions_of_nothing() -> None:
    assert len(principal_directions([], [])) == 0
    assert len(manhattan_groups(np.zeros((0, 2, 2)))) == 0


def test_manhattan_groups_of_one_scan() -> None:
    square = np.array([(0.0, 2.0), (np.pi / 2, 1.5), (np.pi, 1.0), (3 * np.pi / 2, 1.2), (0.8, 2.1)])
    pose, bearings = np.array([0.1, 0.2, 0.7]), scanner(720)
    segments = extract_segments(
        scans_of(room_ranges(pose, bearings, square), bearings), 0, LidarConfig(range_sigma=0.01)
    )
    groups = manhattan_groups(segments.endpoints)
    outward = np.round((segments.angles + pose[2] - np.pi / 2) % np.pi, 1)
    for angle, group in zip(outward, groups, strict=True):
        assert (group == -1) == (angle == 0.8)
    assert {int(g) for g in groups} == {-1, 0, 1}
