"""Camera to platform: against synthetic views of known walls."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recon.calibration.calibrate import calibrate, check_given
from recon.calibration.refine import foot_distances, refine
from recon.calibration.search import Found, PoseSearch, with_rivals
from recon.calibration.similarity import Similarity, fit_similarity, similarity_from_pairs
from recon.calibration.support import CalibrationFrames, match, support
from recon.calibration.topdown import ground_from_camera, ground_map, topdown_homography
from recon.calibration.voting import YAW_BINS, yaw_candidates
from recon.config import CalibrationConfig
from recon.geometry import Array, Pose3, apply2, inverse2, rotation2, wrap_angle
from recon.sequence.camera import Camera

CAMERA = Camera(640, 480, np.array([[520.0, 0, 322.6], [0, 519.3, 236.8], [0, 0, 1]]))
VERTICAL_SIGMA = 0.001

angles = st.floats(-np.pi, np.pi)
small = st.floats(-0.3, 0.3)
heights = st.floats(0.3, 2.5)


def camera_pose(yaw: float, tilt: float, roll: float, position: Array) -> Pose3:
    """Looks along x when yaw is 0; tilt is downward, roll about the viewing axis."""
    forward = np.array([np.cos(yaw) * np.cos(tilt), np.sin(yaw) * np.cos(tilt), -np.sin(tilt)])
    right = np.array([np.sin(yaw), -np.cos(yaw), 0.0])
    down = np.cross(forward, right)
    c, s = np.cos(roll), np.sin(roll)
    return Pose3(np.stack([c * right + s * down, -s * right + c * down, forward], axis=1), position)


@given(angles, st.floats(-0.2, 0.7), small, heights, st.floats(-3, 3), st.floats(1, 8))
def test_the_similarity_of_the_top_down_view_is_the_camera_pose(
    yaw: float, tilt: float, roll: float, height: float, x: float, y: float
) -> None:
    """The decoupling of paper 2.3: floor points seen by a camera come back through H and the similarity."""
    pose = camera_pose(yaw, tilt, roll, np.array([0.3, -0.2, height]))
    floor = np.array([[x, y, 0.0]])
    local = pose.inverse().apply(floor)
    if local[0, 2] < 0.1:
        return
    vertical = -pose.rotation[2]
    ground = ground_map(CAMERA.project(local), CAMERA, vertical)
    turn = pose.rotation @ ground_from_camera(vertical).T
    similarity = Similarity(height, float(np.arctan2(turn[1, 0], turn[0, 0])), pose.translation[:2])
    assert similarity.apply(ground) == pytest.approx(floor[:, :2], abs=1e-6)
    recovered = similarity.platform_from_camera(ground_from_camera(vertical))
    assert recovered.matrix() == pytest.approx(pose.matrix(), abs=1e-9)


@given(st.floats(0.1, 0.6), small, st.floats(-5, 5), st.floats(2, 9))
def test_the_homography_keeps_floor_points_in_proportion(tilt: float, roll: float, x: float, y: float) -> None:
    """H = K R K^-1 is a camera that looks straight down: distances on the floor keep their ratios."""
    pose = camera_pose(np.pi / 2, tilt, roll, np.array([0.0, 0.0, 1.2]))
    floor = np.array([[0.0, 4.0, 0.0], [0.5, 4.0, 0.0], [x, y, 0.0]])
    local = pose.inverse().apply(floor)
    if local[:, 2].min() < 0.1:
        return
    pixels = np.column_stack([CAMERA.project(local), np.ones(3)])
    seen = pixels @ topdown_homography(CAMERA, -pose.rotation[2]).T
    seen = (seen[:, :2] / seen[:, 2:] - CAMERA.matrix[:2, 2]) / [CAMERA.matrix[0, 0], CAMERA.matrix[1, 1]]
    unit = np.linalg.norm(seen[1] - seen[0]) / 0.5
    assert np.linalg.norm(seen[2] - seen[0]) == pytest.approx(unit * np.linalg.norm(floor[2] - floor[0]), rel=1e-6)


@given(st.floats(0.1, 3), angles, st.floats(-2, 2), st.floats(-2, 2), st.integers(0, 1000))
def test_closed_form_and_least_squares_similarity(scale: float, yaw: float, tx: float, ty: float, seed: int) -> None:
    ground = np.random.default_rng(seed).uniform(-4, 4, (6, 2))
    lidar = scale * ground @ rotation2(yaw).T + [tx, ty]
    two = similarity_from_pairs(ground[None, :2], lidar[None, :2])[0]
    assert two[[0, 2, 3]] == pytest.approx([scale, tx, ty], abs=1e-6)
    assert np.cos(two[1] - yaw) == pytest.approx(1, abs=1e-9)
    fitted = fit_similarity(ground, lidar)
    assert fitted.apply(ground) == pytest.approx(lidar, abs=1e-8)


def test_coinciding_corners_give_no_finite_similarity() -> None:
    same = np.zeros((1, 2, 2))
    assert not np.isfinite(similarity_from_pairs(same, np.array([[[0.0, 0.0], [1.0, 0.0]]]))).all()


def corridor_walls() -> Array:
    """An L-shaped corridor (12, 2, 2), m, with the free space on the left of each wall, and its dark floor border."""
    outline = np.array([[-2, -1.1], [10, -1.1], [10, 7], [7.8, 7], [7.8, 1.1], [-2, 1.1]], float)
    return np.stack([outline, np.roll(outline, -1, axis=0)], axis=1)


def views(
    pose: Pose3,
    walls: Array,
    rng: np.random.Generator,
    drive: Array,
    clutter: int,
    noise: float,
    shown: tuple[float, float, float] = (0.9, 0.7, 0.7),
    edge: float = 0.08,
) -> CalibrationFrames:
    """Image lines of the feet, of a border 20 cm in front of them, a baseboard's edge `edge` m up, and clutter.

    shown: shares of these three that give a line.
    """
    lines, groups, segments, segment_groups, line_counts, segment_counts = [], [], [], [], [0], [0]
    for platform in drive:
        local = apply2(inverse2(platform), walls.reshape(-1, 2)).reshape(-1, 2, 2)
        local = np.array([w for w in local if w[0, 0] * w[1, 1] > w[0, 1] * w[1, 0]])
        along = (local[:, 1] - local[:, 0]) / np.linalg.norm(local[:, 1] - local[:, 0], axis=1, keepdims=True)
        normal = np.stack([-along[:, 1], along[:, 0]], axis=1)[:, None]
        found = []
        for k, (shift, up) in enumerate(((0.0, 0.0), (0.2, 0.0), (0.0, edge))):
            for i, wall in enumerate(local + shift * normal):
                piece = visible(pose, wall, up)
                if piece is not None and rng.random() < shown[k]:
                    found.append((piece + rng.normal(0, noise, (2, 2)), int(abs(along[i] @ along[0]) < 0.5)))
        for _ in range(clutter):
            start = rng.uniform([0, 250], [640, 480])
            found.append((start + np.array([[0, 0], rng.uniform(-120, 120, 2)]), int(rng.integers(2))))
        lines += [f[0] for f in found]
        groups += [f[1] for f in found]
        segments += list(local + rng.normal(0, 0.003, local.shape))
        segment_groups += [int(abs(a @ along[0]) < 0.5) for a in along]
        line_counts.append(len(lines))
        segment_counts.append(len(segments))
    return CalibrationFrames(
        np.array(lines), np.array(groups), np.array(line_counts), np.array(segments), np.array(segment_groups),
        np.array(segment_counts), np.arange(len(drive)),
    )  # fmt: skip


def visible(pose: Pose3, wall: Array, up: float) -> Array | None:
    """The part of a wall's foot in the image, from points along it; None when short."""
    points = np.column_stack([np.linspace(wall[0], wall[1], 400), np.full(400, up)])
    pixels = CAMERA.project(pose.inverse().apply(points))
    with np.errstate(invalid="ignore"):
        inside = ((pixels >= 0) & (pixels <= [639, 479])).all(axis=1)
    seen = pixels[inside]
    return seen[[0, -1]] if len(seen) > 1 and np.linalg.norm(seen[-1] - seen[0]) > 25 else None


def drive() -> Array:
    straight = np.stack([np.linspace(0, 7.5, 14), 0.2 * np.sin(np.arange(14)), 0.1 * np.cos(np.arange(14))], axis=1)
    turn = np.array([[8.2, 0.1, 0.4], [8.6, 0.5, 0.9], [8.8, 1.2, 1.4], [8.9, 2.0, 1.6], [8.9, 3.0, 1.55]])
    return np.concatenate([straight, turn])


@pytest.mark.parametrize(
    ("yaw", "tilt", "height", "x", "y"),
    [(0.03, 0.25, 0.95, 0.1, 0.03), (-0.4, 0.45, 1.6, -0.1, 0.2), (0.0, 0.1, 0.4, 0.2, -0.1)],
)
def test_calibration_finds_the_camera_among_parallel_lines(
    yaw: float, tilt: float, height: float, x: float, y: float
) -> None:
    truth = camera_pose(yaw, tilt, 0.02, np.array([x, y, height]))
    frames = views(truth, corridor_walls(), np.random.default_rng(3), drive(), clutter=12, noise=0.5)
    result = calibrate(frames, CAMERA, (-truth.rotation[2], VERTICAL_SIGMA), CalibrationConfig())
    assert result is not None and result.source == "estimated"
    sigma = np.sqrt(np.diag(result.covariance))
    error = result.platform_from_camera.translation - truth.translation
    assert np.abs(error).max() < 0.02
    assert np.all(np.abs(error) < 5 * sigma[3:] + 0.002)
    assert np.all(sigma > 1e-5) and np.all(sigma[3:] < 0.02)
    cosine = (np.trace(result.platform_from_camera.rotation @ truth.rotation.T) - 1) / 2
    assert np.degrees(np.arccos(min(cosine, 1.0))) < 0.4


@pytest.mark.parametrize(("edge", "foot"), [(0.12, 0.45), (0.25, 0.3), (0.06, 0.45)])
def test_a_foot_that_few_images_show_is_found_below_the_baseboard(edge: float, foot: float) -> None:
    truth = camera_pose(0.03, 0.25, 0.02, np.array([0.1, 0.03, 0.95]))
    vertical = (-truth.rotation[2], VERTICAL_SIGMA)
    frames = views(truth, corridor_walls(), np.random.default_rng(14), drive(), 12, 0.5, (foot, 0.0, 0.95), edge)
    result = calibrate(frames, CAMERA, vertical, CalibrationConfig())
    assert result is not None
    error = result.platform_from_camera.translation - truth.translation
    assert np.abs(error).max() < 0.02 and abs(error[2]) < 4 * np.sqrt(result.covariance[5, 5])
    assert result.warnings == () or ("baseboards" in result.warnings[0] and len(result.warnings) == 1)
    if result.warnings:  # the baseboard's edge may be the floor, too
        assert edge / 3 < np.sqrt(result.covariance[5, 5]) < edge


@pytest.mark.parametrize("seed", range(3))
def test_no_floor_is_found_below_the_floor(seed: int) -> None:
    """The foot and a border on the floor alone, among much clutter: nothing below passes for a floor."""
    truth = camera_pose(0.03, 0.25, 0.02, np.array([0.1, 0.03, 0.95]))
    vertical = (-truth.rotation[2], VERTICAL_SIGMA)
    frames = views(truth, corridor_walls(), np.random.default_rng(seed), drive(), 40, 0.5, (0.95, 0.5, 0.0))
    result = calibrate(frames, CAMERA, vertical, CalibrationConfig())
    assert result is not None and result.warnings == ()
    assert result.platform_from_camera.translation == pytest.approx(truth.translation, abs=0.02)


def test_the_blind_search_tries_every_quadrant() -> None:
    """Two directions of walls that are not at right angles: lines along and across both, looked at from any side."""
    bins = np.arange(YAW_BINS) * np.pi / YAW_BINS
    density = np.zeros(YAW_BINS)
    for angle, height in ((0.4, 1.0), (0.4 + np.pi / 2, 0.3), (1.0, 0.9), (1.0 + np.pi / 2, 0.8), (1.3, 0.5)):
        density += height * np.exp(-0.5 * (wrap_angle(2 * (bins - angle)) / 0.02) ** 2)
    found = yaw_candidates(density)
    for angle in (0.4, 1.0, 1.3):
        for quarter in range(4):
            assert np.abs(wrap_angle(found - angle - quarter * np.pi / 2)).min() < 0.01


def test_calibration_is_the_same_every_time_and_whatever_the_seed() -> None:
    truth = camera_pose(0.03, 0.25, 0.02, np.array([0.1, 0.03, 0.95]))
    frames = views(truth, corridor_walls(), np.random.default_rng(5), drive(), clutter=20, noise=0.7)
    vertical = (-truth.rotation[2], VERTICAL_SIGMA)
    results = [calibrate(frames, CAMERA, vertical, CalibrationConfig(), seed) for seed in (0, 0, 1, 2)]
    poses = [r.platform_from_camera for r in results if r is not None]
    assert len(poses) == 4
    assert np.array_equal(poses[0].matrix(), poses[1].matrix())
    for pose in poses:
        assert pose.translation == pytest.approx(truth.translation, abs=0.025)


def settled_search(images: int, walls: Array) -> tuple[PoseSearch, Pose3, Found]:
    """A search over few images that show half of the feet, the truth, and a place that votes crowd at beside it."""
    truth = camera_pose(0.03, 0.25, 0.02, np.array([0.1, 0.03, 0.95]))
    frames = views(truth, walls, np.random.default_rng(8), drive()[:images], 6, 0.5, (0.6, 0.0, 0.0))
    search = PoseSearch(frames, CAMERA, (-truth.rotation[2], VERTICAL_SIGMA), 0.0077 * CAMERA.matrix[0, 0])
    found = search.refine(truth)
    assert found is not None
    return search, truth, found


def test_a_place_beside_the_right_one_is_left() -> None:
    search, truth, found = settled_search(10, corridor_walls())
    beside = Pose3(truth.rotation, truth.translation + np.array([0.1, -0.24, 0.03]))
    wrong = Found(0.5 * found.evidence, replace(found.refined, platform_from_camera=beside))
    assert search.share(wrong.refined) < 0.5
    result = search.settled(wrong).refined
    assert result.platform_from_camera.translation == pytest.approx(truth.translation, abs=0.02)
    assert np.all(np.sqrt(np.diag(result.covariance)[3:]) < 0.05)


def test_places_that_explain_as_much_are_in_the_sigmas() -> None:
    """What was found, and a place 20 cm aside that has nearly as much evidence."""
    _, _, found = settled_search(10, corridor_walls())
    pose = found.refined.platform_from_camera
    aside = Pose3(pose.rotation, pose.translation + np.array([0.0, 0.2, 0.0]))
    rival = Found(0.98 * found.evidence, replace(found.refined, platform_from_camera=aside))
    covariance = with_rivals([found, rival, rival]).refined.covariance
    assert 0.08 < np.sqrt(covariance[4, 4]) < 0.2
    for axis in (0, 3, 5):
        assert covariance[axis, axis] == pytest.approx(found.refined.covariance[axis, axis])
    assert with_rivals([found, replace(rival, evidence=0.8 * found.evidence)]).refined.covariance == pytest.approx(
        found.refined.covariance
    )


def test_lines_that_have_nothing_to_do_with_the_scans_give_nothing() -> None:
    rng = np.random.default_rng(11)
    truth = camera_pose(0.0, 0.25, 0.0, np.array([0.0, 0.0, 1.0]))
    frames = views(truth, corridor_walls(), rng, drive(), clutter=30, noise=0.5)
    shuffled = rng.uniform([0, 200], [640, 480], (len(frames.lines), 2))
    noise = np.stack([shuffled, shuffled + rng.uniform(-80, 80, shuffled.shape)], axis=1)
    frames = CalibrationFrames(
        noise, frames.line_groups, frames.line_offsets, frames.segments, frames.segment_groups, frames.segment_offsets,
        frames.images,
    )  # fmt: skip
    assert calibrate(frames, CAMERA, (-truth.rotation[2], VERTICAL_SIGMA), CalibrationConfig()) is None


def test_a_camera_that_sees_no_foot_is_not_placed() -> None:
    """It looks at the floor behind; lines there run along the walls."""
    truth = camera_pose(np.pi, 0.9, 0.02, np.array([0.0, 0.0, 0.4]))
    rng = np.random.default_rng(17)
    frames = views(truth, corridor_walls(), rng, drive(), 30, 0.5, (0.0, 0.0, 0.0))
    assert calibrate(frames, CAMERA, (-truth.rotation[2], VERTICAL_SIGMA), CalibrationConfig()) is None


def test_given_extrinsics_are_kept_and_checked() -> None:
    truth = camera_pose(0.03, 0.25, 0.02, np.array([0.1, 0.03, 0.95]))
    frames = views(truth, corridor_walls(), np.random.default_rng(7), drive(), clutter=10, noise=0.5)
    vertical = (-truth.rotation[2], VERTICAL_SIGMA)
    right = check_given(frames, CAMERA, vertical, truth)
    assert right.warnings == () and right.source == "given" and right.inlier_fraction > 0.5
    assert np.array_equal(right.platform_from_camera.matrix(), truth.matrix())
    tilted = camera_pose(0.03, 0.32, 0.02, truth.translation)
    assert any("vertical" in w and "4.0 deg" in w for w in check_given(frames, CAMERA, vertical, tilted).warnings)


@settings(max_examples=30)
@given(st.floats(-0.02, 0.02), st.floats(-0.02, 0.02), st.floats(-0.02, 0.02), st.floats(-0.004, 0.004))
def test_refinement_comes_back_from_small_disturbances(dx: float, dy: float, dz: float, turn: float) -> None:
    truth = camera_pose(0.03, 0.25, 0.02, np.array([0.1, 0.03, 0.95]))
    frames = views(truth, corridor_walls(), np.random.default_rng(9), drive(), clutter=0, noise=0.3)
    start = camera_pose(0.03 + turn, 0.25, 0.02, truth.translation + np.array([dx, dy, dz]))
    refined = refine(frames, CAMERA, start, (-truth.rotation[2], VERTICAL_SIGMA), (8.0, 4.0, 3.0, 2.0, 2.0))
    assert refined is not None
    assert refined.platform_from_camera.translation == pytest.approx(truth.translation, abs=0.02)


def test_support_counts_what_matches_cover() -> None:
    """With exact lines nearly all of the projected feet are explained, and matches lie on the feet."""
    truth = camera_pose(0.0, 0.3, 0.0, np.array([0.1, 0.0, 1.0]))
    frames = views(truth, corridor_walls(), np.random.default_rng(1), drive()[:3], clutter=0, noise=0.0)
    counts = support(frames, CAMERA, truth, 4.0)
    assert np.all(counts[:, 0] <= counts[:, 1] * 1.001)
    assert counts[:, 0].sum() > 0.6 * counts[:, 1].sum()
    matches = match(frames, CAMERA, truth, 1.5)
    assert len(matches) >= 4
    distances = foot_distances(CAMERA, truth, frames.segments[matches.segment], matches.pixels)
    assert np.abs(distances).max() < 6.0
    aside = Pose3(truth.rotation, truth.translation + np.array([0.0, 0.4, 0.0]))
    assert support(frames, CAMERA, aside, 4.0)[:, 0].sum() < 0.5 * counts[:, 0].sum()
