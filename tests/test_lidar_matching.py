from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scan_drive
from scan_drive import box, polygon
from scipy.interpolate import CubicSpline

from recon.config import LidarConfig
from recon.geometry import Array, apply2, between2, compose2, wrap_angle
from recon.lidar.matching import ScanMatching, match_scans
from recon.sequence.sequence import Scans
from recon.sequence.trajectory import Trajectory

Path2 = Callable[[Array], Array]
"""Times (N,) s to true poses (N, 3)."""


OFFICE = np.concatenate([scan_drive.OFFICE, box(0.3, 2.5, 0.6, 1.5)])
CORRIDOR = polygon((-30, -1.1), (60, -1.1), (60, 1.1), (-30, 1.1))


def office_walk(times: Array) -> Array:
    """A walk around the office at 0.8 m/s in the mean, with turns of up to 90 degrees a second."""
    knots = [(1.5, 1.2), (3, 2), (5, 2.3), (7.5, 1.5), (8.2, 2.5), (7, 4.6), (5.5, 4), (4, 5), (4, 7), (2.5, 7.2)]
    spline = CubicSpline(2.0 * np.arange(len(knots)), knots)
    velocity = spline(times, 1)
    return np.column_stack([spline(times), np.unwrap(np.arctan2(velocity[:, 1], velocity[:, 0]))])


def corridor_drive(times: Array) -> Array:
    return np.column_stack([times + 0.15 * np.sin(times), 0.2 * np.sin(0.5 * times), 0.1 * np.sin(0.8 * times)])


def cast(walls: Array, poses: Array, bearings: Array) -> Array:
    """Ranges (B,) of one beam from each pose (B, 3) at its bearing."""
    angles = poses[:, 2] + bearings
    beam = np.stack([np.cos(angles), np.sin(angles)], axis=1)[:, None]
    to, along = walls[None, :, 0] - poses[:, None, :2], (walls[:, 1] - walls[:, 0])[None]
    with np.errstate(divide="ignore", invalid="ignore"):
        across = beam[..., 0] * along[..., 1] - beam[..., 1] * along[..., 0]
        distance = (to[..., 0] * along[..., 1] - to[..., 1] * along[..., 0]) / across
        part = (to[..., 0] * beam[..., 1] - to[..., 1] * beam[..., 0]) / across
        hit = (distance > 1e-6) & (part >= 0) & (part <= 1)
    return np.asarray(np.where(hit, distance, np.inf).min(axis=1))


def simulate(
    walls: Array, path: Path2, times: Array, beams: int, field: float, *, sigma: float = 0.01, reach: float = 12.0,
    lost: float = 0.0, sweep: float = 0.0, people: Callable[[float], Array] | None = None,
) -> Scans:  # fmt: skip
    """Scans along a path. sweep: s a scan takes; lost: share of beams without return; people: their places (P, 3)."""
    rng, bearings = np.random.default_rng(7), -field / 2 + field / beams * np.arange(beams, dtype=np.float64)
    ranges = np.empty((len(times), beams))
    for k, t in enumerate(times):
        bodies = [] if people is None else [box(x, y, 0.4, 0.3, a) for x, y, a in people(float(t))]
        scene = np.concatenate([walls, *bodies])
        ranges[k] = cast(scene, path(t + sweep / beams * np.arange(beams)), bearings)
    ranges += rng.normal(0, sigma, ranges.shape)
    ranges[(ranges > reach) | (rng.random(ranges.shape) < lost)] = np.inf
    return Scans(times, ranges.astype(np.float32), bearings[0], field / beams, 0.05, reach, sweep / beams)


def odometry_of(path: Path2, end: float, scale: float, drift: float, lag: float) -> Trajectory:
    """Odometry at 20 Hz: distances times `scale`, `drift` rad a metre, stamped `lag` s late, with a little noise."""
    rng, times = np.random.default_rng(8), np.arange(-0.5, end + 0.5, 0.05)
    steps = between2(path(times[:-1]), path(times[1:]))
    way = np.hypot(steps[:, 0], steps[:, 1])
    steps[:, :2] *= scale
    steps[:, 2] += drift * way
    steps += rng.normal(0, [0.001, 0.001, 0.001], steps.shape)
    poses = [np.array([5.0, -3.0, 1.0])]
    for step in steps:
        poses.append(compose2(poses[-1], step))
    return Trajectory(times + lag, np.array(poses))


def errors(found: Array, true: Array) -> tuple[float, float]:
    """Absolute trajectory error (m, root mean square) after rigid alignment, and largest heading error (deg)."""
    a, b = found[:, :2] - found[:, :2].mean(axis=0), true[:, :2] - true[:, :2].mean(axis=0)
    turn = np.arctan2(np.sum(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]), np.sum(a * b))
    miss = apply2([0, 0, turn], a) - b
    heading = np.abs(wrap_angle(found[:, 2] + turn - true[:, 2])).max()
    return float(np.sqrt((miss**2).sum(axis=1).mean())), float(np.degrees(heading))


def normalised(matching: ScanMatching, true: Array) -> Array:
    """(N-1,) squared errors of the relative motions, normalised by their covariance; 3 is expected."""
    poses = matching.trajectory.poses
    miss = between2(poses[:-1], poses[1:]) - between2(true[:-1], true[1:])
    miss[:, 2] = wrap_angle(miss[:, 2])
    return np.asarray(np.einsum("ni,nij,nj->n", miss, np.linalg.inv(matching.covariances), miss))


FULL, HALF = 2 * np.pi, np.pi
# beams, field of view, sigma, reach, share lost; then the largest trajectory (m) and heading error (deg) allowed
SCANNERS = {
    "full circle": (720, FULL, 0.01, 12.0, 0.0, 0.003, 0.1),
    "fine": (1440, FULL, 0.004, 12.0, 0.0, 0.002, 0.1),
    "half circle, one degree": (180, HALF, 0.01, 12.0, 0.0, 0.008, 0.3),
    "cheap": (360, FULL, 0.03, 6.0, 0.0, 0.012, 0.4),
    "40 % without return": (540, 1.5 * np.pi, 0.01, 12.0, 0.4, 0.006, 0.2),
}


@pytest.mark.parametrize("with_odometry", [True, False])
@pytest.mark.parametrize("name", SCANNERS)
def test_a_walk_with_scanners_of_all_kinds(name: str, with_odometry: bool) -> None:
    beams, field, sigma, reach, lost, most, most_heading = SCANNERS[name]
    times = np.arange(0.1, 17.8, 0.15)
    scans = simulate(OFFICE, office_walk, times, beams, field, sigma=sigma, reach=reach, lost=lost)
    odometry = odometry_of(office_walk, 18, 1.04, 0.03, 0.0) if with_odometry else None
    matching = match_scans(scans, odometry, LidarConfig())
    np.testing.assert_array_equal(matching.trajectory.poses[0], 0)
    assert not matching.failed.any()
    error, heading = errors(matching.trajectory.poses, office_walk(times))
    assert error < most
    assert heading < most_heading
    # walls of real buildings are not as flat as these: the covariances leave room for that
    assert 0.01 < normalised(matching, office_walk(times)).mean() / 3 < 1.2


def test_people_walking_by_do_not_matter() -> None:
    def people(t: float) -> Array:
        away = office_walk(np.array([t + 1.5]))[0]
        walker = np.array([4 + 2 * np.sin(0.7 * t), 3.5 + 1.2 * np.cos(0.9 * t), t])
        close = np.hypot(*(walker - office_walk(np.array([t]))[0])[:2]) < 0.5  # people step aside
        return np.array([away] if close else [away, walker])

    times = np.arange(0.1, 16.3, 0.15)
    matching = match_scans(simulate(OFFICE, office_walk, times, 720, FULL, people=people), None, LidarConfig())
    error, heading = errors(matching.trajectory.poses, office_walk(times))
    assert error < 0.004
    assert heading < 0.15


def test_large_turns_between_rare_scans_without_odometry() -> None:
    times = np.arange(0.1, 17.8, 0.7)
    assert np.degrees(np.abs(np.diff(office_walk(times)[:, 2])).max()) > 40
    matching = match_scans(simulate(OFFICE, office_walk, times, 720, FULL), None, LidarConfig())
    error, heading = errors(matching.trajectory.poses, office_walk(times))
    assert error < 0.004
    assert heading < 0.15


@pytest.mark.parametrize("with_odometry", [True, False])
def test_motion_distortion_is_taken_out(with_odometry: bool) -> None:
    times = np.arange(0.1, 17.8, 0.1)
    scans = simulate(OFFICE, office_walk, times, 360, FULL, sweep=0.1)
    odometry = odometry_of(office_walk, 18, 1.02, 0.01, 0.0) if with_odometry else None
    matching = match_scans(scans, odometry, LidarConfig())
    error, heading = errors(matching.trajectory.poses, office_walk(times))
    assert error < 0.008
    assert heading < 1.0
    assert normalised(matching, office_walk(times)).mean() / 3 < 2
    unaware = match_scans(replace(scans, time_increment=0.0), odometry, LidarConfig())
    assert errors(unaware.trajectory.poses, office_walk(times))[0] > 2 * error


@pytest.mark.parametrize("lag", [-0.2, 0.0, 0.15])
def test_lag_of_the_odometry_is_found(lag: float) -> None:
    times = np.arange(0.1, 12, 0.15)
    scans = simulate(OFFICE, office_walk, times, 360, FULL)
    odometry = odometry_of(office_walk, 13, 1.0, 0.0, lag)
    matching = match_scans(scans, odometry, LidarConfig())
    assert matching.odometry is not None
    found = odometry.timestamps - matching.odometry.timestamps
    np.testing.assert_allclose(found, lag, atol=0.02)


def test_odometry_fills_in_the_way_along_a_bare_corridor() -> None:
    times = np.arange(0.1, 15, 0.15)
    scans = simulate(CORRIDOR, corridor_drive, times, 720, FULL, reach=8.0)
    matching = match_scans(scans, odometry_of(corridor_drive, 16, 1.02, 0.01, 0.0), LidarConfig())
    true = corridor_drive(times)
    miss = wrap_angle(between2(true[0], true[-1])[2] - matching.trajectory.poses[-1, 2])
    assert np.degrees(np.abs(miss)) < 0.1  # walls hold the heading whatever the odometry says
    driven, found = between2(true[0], true[-1])[0], matching.trajectory.poses[-1, 0]
    assert found == pytest.approx(1.02 * driven, rel=0.01)  # nothing but odometry measures the way
    along, across = matching.covariances[:, 0, 0], matching.covariances[:, 1, 1]
    assert np.median(along) > 25 * np.median(across)
    assert np.sqrt(np.median(along)) > 0.004
    assert np.sqrt(np.median(matching.scan_covariances[:, 0, 0])) > 1.0  # the scans alone say nothing


def test_without_odometry_a_bare_corridor_is_admitted_to_say_nothing_along_itself() -> None:
    times = np.arange(0.1, 8, 0.15)
    scans = simulate(CORRIDOR, corridor_drive, times, 720, FULL, reach=8.0)
    matching = match_scans(scans, None, LidarConfig())
    assert np.sqrt(np.median(matching.covariances[:, 0, 0])) > 0.05
    assert np.sqrt(np.median(matching.covariances[:, 1, 1])) < 0.02
    assert normalised(matching, corridor_drive(times)).mean() / 3 < 2


@pytest.mark.parametrize("hole", [slice(0, 3), slice(30, 50)])
def test_scans_that_see_nothing_are_said_and_survived(hole: slice) -> None:
    times = np.arange(0.1, 9, 0.1)
    scans = simulate(OFFICE, office_walk, times, 360, FULL)
    scans.ranges[hole] = np.inf
    matching = match_scans(scans, odometry_of(office_walk, 10, 1.0, 0.0, 0.0), LidarConfig())
    blind = np.zeros(len(times), np.bool_)
    blind[hole] = True
    blind[0] = False  # the first scan is where it is
    assert matching.failed[blind].all()
    assert matching.failed.sum() <= blind.sum() + 2
    assert errors(matching.trajectory.poses, office_walk(times))[0] < 0.02
    assert normalised(matching, office_walk(times)).mean() / 3 < 2


def test_same_input_same_bytes() -> None:
    times = np.arange(0.1, 5, 0.15)
    scans = simulate(OFFICE, office_walk, times, 360, FULL)
    one, other = (match_scans(scans, None, LidarConfig()) for _ in range(2))
    assert one.trajectory.poses.tobytes() == other.trajectory.poses.tobytes()
    assert one.covariances.tobytes() == other.covariances.tobytes()


@pytest.mark.parametrize("count", [0, 1, 2])
def test_very_short_sequences(count: int) -> None:
    scans = simulate(OFFICE, office_walk, np.arange(0.1, 9, 0.1)[:count], 360, FULL)
    for odometry in (None, odometry_of(office_walk, 2, 1.0, 0.0, 0.0)):
        matching = match_scans(scans, odometry, LidarConfig())
        assert matching.trajectory.poses.shape == (count, 3)
        assert matching.covariances.shape == (max(count - 1, 0), 3, 3)
        assert matching.velocities.shape == (count, 3)


def load(folder: Path) -> tuple[Scans, Trajectory, Trajectory]:
    data = np.load(folder / "scans.npz")

    def trajectory(path: Path) -> Trajectory:
        rows = np.loadtxt(path)
        return Trajectory(rows[:, 0], np.column_stack([rows[:, 1:3], 2 * np.arctan2(rows[:, 6], rows[:, 7])]))

    first, step, near, far = (float(data[k]) for k in ("angle_min", "angle_increment", "range_min", "range_max"))
    scans = Scans(data["timestamps"], data["ranges"], first, step, near, far)
    return scans, trajectory(folder / "odometry.txt"), trajectory(folder / "groundtruth" / "trajectory.txt")


@pytest.mark.parametrize("with_odometry", [True, False])
@pytest.mark.parametrize(("name", "most", "most_heading"), [("corridor", 0.005, 0.1), ("lobby", 0.01, 0.3)])
def test_recorded_drives(
    name: str, most: float, most_heading: float, with_odometry: bool, shared_data: Callable[[str], Path]
) -> None:
    scans, odometry, truth = load(shared_data(name))
    matching = match_scans(scans, odometry if with_odometry else None, LidarConfig())
    true = truth.at(scans.timestamps)
    error, heading = errors(matching.trajectory.poses, true)
    assert error < most
    assert heading < most_heading
    assert not matching.failed.any()
    assert 0.1 < normalised(matching, true).mean() / 3 < 1.5
