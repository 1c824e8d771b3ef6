"""Simulated sequences against their plans, computed here independently (shapely, analytic ranges, projections)."""

from __future__ import annotations

import dataclasses
import json
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from recon.errors import InputError, OutputError
from recon.geometry import Array, Pose3, apply2, between2, inverse2
from recon.sequence.camera import DistortionModel
from recon.sequence.folder import read_sequence
from recon.sequence.groundtruth import read_groundtruth
from recon.simulate import (
    Plan,
    Simulation,
    office_plan,
    random_plan,
    run_simulation,
    simulate,
    simulate_file,
    simulate_scans,
)
from recon.simulate.check import check_plan
from recon.simulate.drive import drive_path
from recon.simulate.lidar import Slice, cast
from recon.simulate.openings import niches
from recon.simulate.plan import PlanCamera, PlanLidar, PlanOdometry, PlanOpening, PlanRoom
from recon.simulate.render import Exposure, Renderer
from recon.simulate.simulation import image_poses
from recon.simulate.truth import true_camera, true_extrinsics

SAMPLE = Path(__file__).resolve().parents[1] / "samples" / "plan.json"
EXACT = PlanLidar(sigma=0.0, dropout=0.0, outlier=0.0, mixed=0.0, range_max=60.0, fov_deg=360.0, rate=2.0)
SMALL = PlanCamera(image_width=160, image_height=120, fx=125.0, fy=125.0, rate=0.5)
TWO_ROOMS = (
    PlanRoom(((0.0, 0.0), (5.0, 0.0), (5.0, 4.0), (0.0, 4.0)), "west"),
    PlanRoom(((5.2, 0.0), (9.0, 0.0), (9.0, 4.0), (5.2, 4.0)), "east", 3.0),
)


def two_rooms(**changes: object) -> Plan:
    plan = Plan(
        TWO_ROOMS,
        path=((1.0, 2.0), (8.0, 2.0), (8.0, 3.0), (7.0, 3.0)),
        openings=(PlanOpening("passage", 0, 1, 1.5, 1.0),),
        lidar=EXACT,
        camera=SMALL,
    )
    return dataclasses.replace(plan, **changes)  # type: ignore[arg-type]


def world_points(simulation: Simulation, index: int) -> Array:
    """Returns of one scan in the plan frame."""
    plan_from_map = inverse2(simulation.map_from_plan)
    return apply2(plan_from_map, apply2(simulation.truth.poses[index], simulation.scans.points(index)))


# plans


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"rooms": []}, "plan.rooms"),
        ({"roof": 1}, "unknown key 'roof'"),
        ({"ceiling_height": "high"}, "plan.ceiling_height: a number is expected, not 'high'"),
        ({"ceiling_height": 0.5}, "plan.ceiling_height: 0.5 is out of range, 1.8 to 12"),
        ({"ceiling_height": float("nan")}, "plan.ceiling_height: a number is expected"),
        ({"path": [[1, 2]]}, "at least two different way points"),
        ({"path": [[1, 2], [4, 3, 2]]}, r"plan.path\[1\]: 2 numbers are expected"),
        ({"path": [[1, 2], [8, 2]], "openings": []}, r"plan.path: comes closer than .* near \(4.8"),
        ({"rooms": [{"polygon": [[0, 0], [0, 4], [4, 4]]}]}, "clockwise"),
        ({"rooms": [{"polygon": [[0, 0], [4, 4], [4, 0], [0, 4]]}]}, "crosses itself"),
        ({"rooms": [{"polygon": [[0, 0], [4, 0], [4, 4]]}, {"polygon": [[4, 0], [8, 0], [8, 4]]}]}, "touches"),
        ({"openings": [{"type": "arch", "room": 0, "wall": 0}]}, r"openings\[0\].type: 'arch' is unknown"),
        ({"openings": [{"type": "passage", "room": 0, "wall": 0}]}, "leads nowhere"),
        ({"openings": [{"type": "passage", "room": 7, "wall": 0}]}, "there is no room 7"),
        ({"openings": [{"type": "door", "room": 0, "wall": 0, "offset": 4.9}]}, "ends 5.8 m along a wall of 5 m"),
        ({"openings": [{"type": "window", "room": 0, "wall": 1, "bottom": 1, "offset": 1}]}, "looks into room 1"),
        ({"openings": 2 * [{"type": "door", "room": 0, "wall": 0}]}, "overlaps openings"),
        ({"objects": [{"center": [5.1, 1], "size": [0.3, 0.3]}]}, "does not stand inside one room"),
        ({"camera": {"distortion_model": "equidistant"}}, "equidistant has 4 coefficients, not 5"),
        ({"lidar": {"beams": 10.5}}, "plan.lidar.beams: a whole number is expected"),
    ],
)
def test_a_plan_that_cannot_be_gives_one_clear_line(tmp_path: Path, change: dict[str, object], message: str) -> None:
    path = tmp_path / "plan.json"
    path.write_text(json.dumps(two_rooms().to_dict() | change))
    with pytest.raises(InputError, match=message) as caught:
        simulate_file(path, tmp_path / "out")
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "out").exists()


def test_a_missing_or_broken_plan_file_is_named(tmp_path: Path) -> None:
    (tmp_path / "broken.json").write_text('{"rooms": [')
    for name in ("missing.json", "broken.json"):
        with pytest.raises(InputError, match=name):
            Plan.from_json(tmp_path / name)


def test_json_gives_the_same_plan_back(tmp_path: Path) -> None:
    for plan in (Plan.from_json(SAMPLE), random_plan(3, 4, "any")):
        plan.to_json(tmp_path / "plan.json")
        assert Plan.from_json(tmp_path / "plan.json") == plan


def test_importing_the_package_is_light() -> None:
    code = "import recon.simulate, sys; print([m for m in ('numpy', 'cv2', 'open3d', 'shapely') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


# scanner and drive


def test_ranges_in_an_empty_room_are_exact() -> None:
    room = PlanRoom(((0.0, 0.0), (5.0, 0.0), (5.0, 4.0), (0.0, 4.0)))
    plan = two_rooms(rooms=(room,), openings=(), path=((1.0, 1.0), (4.0, 1.5), (3.0, 3.0)))
    simulation = run_simulation(plan)
    scans = simulation.scans
    poses = simulation.drive.at(scans.timestamps - plan.drive.start_time)
    angle = poses[:, 2:] + scans.bearings
    with np.errstate(divide="ignore"):
        to_x = np.where(np.cos(angle) > 0, 5.0 - poses[:, :1], -poses[:, :1]) / np.cos(angle)
        to_y = np.where(np.sin(angle) > 0, 4.0 - poses[:, 1:2], -poses[:, 1:2]) / np.sin(angle)
    np.testing.assert_allclose(scans.ranges, np.minimum(to_x, to_y), rtol=1e-6)


def test_beams_of_a_turning_scanner_start_where_the_platform_then_is() -> None:
    room = PlanRoom(((0.0, 0.0), (5.0, 0.0), (5.0, 4.0), (0.0, 4.0)))
    lidar = dataclasses.replace(EXACT, scan_time=0.4)
    path = ((1.0, 1.0), (4.0, 1.0), (4.0, 3.0))
    plan = two_rooms(rooms=(room,), openings=(), path=path, lidar=lidar)
    simulation = run_simulation(plan)
    scans, start = simulation.scans, plan.drive.start_time
    assert scans.time_increment == pytest.approx(0.4 / (lidar.beams - 1))
    beam_times = scans.timestamps[:, None] + scans.time_increment * np.arange(lidar.beams) - start
    poses = simulation.drive.at(beam_times.ravel())
    angle = poses[:, 2] + np.tile(scans.bearings, len(scans))
    ends = poses[:, :2] + scans.ranges.ravel()[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    off = shapely.distance(shapely.Polygon(room.polygon).exterior, shapely.points(ends))
    assert off.max() < 1e-5
    frozen = np.concatenate([world_points(simulation, i) for i in range(len(scans))])
    assert shapely.distance(shapely.Polygon(room.polygon).exterior, shapely.points(frozen)).max() > 0.02


@pytest.mark.parametrize("seed", [1, 2])
def test_exact_returns_lie_on_the_building(seed: int) -> None:
    plan = dataclasses.replace(random_plan(seed, 4, "any"), lidar=dataclasses.replace(EXACT, beams=360))
    simulation = run_simulation(plan, seed)
    h = plan.lidar.height
    solid = [shapely.Polygon(o.footprint).exterior for o in simulation.layout.objects]
    walls = [shapely.LineString([w.start, w.end]) for w in simulation.layout.walls]
    within = [o for o in simulation.layout.openings if o.bottom <= h < o.top]
    holes = shapely.union_all([shapely.LineString([o.start, o.end]).buffer(0.62) for o in within])
    places = shapely.union_all(walls + solid)
    scans = range(0, len(simulation.scans), 5)
    points = np.concatenate([apply2(simulation.truth.poses[i], simulation.scans.points(i)) for i in scans])
    off = shapely.distance(places, shapely.points(points))
    beside = ~shapely.contains_xy(holes, points)
    assert 0.3 < beside.mean() < 1.0
    assert off[beside].max() < 1e-4
    # only leaves and reveals of openings lie off the walls, and the rooms they lead to: never within free space
    rooms = shapely.union_all([shapely.Polygon(r.polygon) for r in simulation.layout.rooms])
    inner = rooms.buffer(-0.002).difference(shapely.union_all([shapely.Polygon(s).buffer(0.002) for s in solid]))
    assert not shapely.contains_xy(inner, points).any()


def test_scanner_noise_has_the_size_that_the_plan_says() -> None:
    noisy = dataclasses.replace(EXACT, sigma=0.02, dropout=0.05, outlier=0.01)
    exact = simulate_scans(two_rooms())[0].ranges
    ranges = simulate_scans(two_rooms(lidar=noisy))[0].ranges
    error = (ranges - exact)[np.isfinite(ranges)]
    assert np.isinf(ranges).mean() == pytest.approx(0.05, abs=0.006)
    assert (np.abs(error) > 0.15).mean() == pytest.approx(0.01, abs=0.003)
    assert error[np.abs(error) < 0.1].std() == pytest.approx(0.02, rel=0.05)


def test_glass_returns_nothing_and_passages_let_through() -> None:
    window = PlanOpening("window", 1, 1, 1.0, 2.0, bottom=0.1, top=2.0)
    plan = two_rooms(openings=(PlanOpening("passage", 0, 1, 1.5, 1.0), window))
    simulation = run_simulation(plan)
    bearing = np.abs(simulation.scans.bearings) < 0.02
    assert np.isinf(simulation.scans.ranges[0, bearing]).all()
    above = run_simulation(
        dataclasses.replace(plan, openings=(plan.openings[0], dataclasses.replace(window, bottom=0.9)))
    )
    assert above.scans.ranges[0, bearing] == pytest.approx(8.0, abs=0.05)
    closed = run_simulation(dataclasses.replace(plan, path=((1.0, 2.0), (3.0, 2.0)), openings=(
        PlanOpening("door", 0, 1, 1.5, 1.0),)))  # fmt: skip
    assert closed.scans.ranges[0, bearing] == pytest.approx(4.08, abs=0.02)
    walls = {w.id: w for w in simulation.layout.walls}
    pair = [o for o in simulation.layout.openings if o.type == "passage"]
    assert [o.wall for o in pair] == [1, 7]
    assert all(np.linalg.norm(o.end - o.start) == pytest.approx(1.0) for o in pair)
    for o in pair:
        assert walls[o.wall].direction @ (o.end - o.start) == pytest.approx(1.0)


@settings(max_examples=15, deadline=None)
@given(st.lists(st.tuples(st.floats(-9, 9), st.floats(-9, 9)), min_size=2, max_size=7), st.floats(0, 1))
def test_drives_move_forwards_no_faster_than_told(points: list[tuple[float, float]], radius: float) -> None:
    plan = two_rooms(path=tuple(points))
    if np.abs(np.diff(np.array(points), axis=0)).sum() < 0.01:
        return
    plan = dataclasses.replace(plan, drive=dataclasses.replace(plan.drive, corner_radius=radius))
    drive = drive_path(plan)
    times = np.linspace(0, drive.duration, 800)
    poses = drive.at(times)
    step = between2(poses[:-1], poses[1:])
    dt = times[1]
    assert np.hypot(step[:, 0], step[:, 1]).max() <= plan.drive.speed * dt * (1 + 1e-6) + 1e-9
    assert np.abs(step[:, 2]).max() <= plan.drive.turn_rate * dt * (1 + 1e-6) + 1e-9
    assert step[:, 0].min() > -1e-9
    assert np.abs(step[:, 1]).max() <= plan.drive.speed * dt * plan.drive.turn_rate * dt + 1e-9
    np.testing.assert_allclose(poses[[0, -1], :2], [points[0], points[-1]], atol=1e-6)


def test_odometry_is_the_truth_but_for_its_errors() -> None:
    perfect = PlanOdometry(scale=1.0, drift_deg=0.0, sigma_distance=0.0, sigma_heading_deg=0.0)
    for scale in (1.0, 1.05):
        plan = two_rooms(odometry=dataclasses.replace(perfect, scale=scale))
        simulation = run_simulation(plan)
        odometry, truth = simulation.odometry, simulation.platform_at(simulation.odometry.timestamps)
        expected = between2(truth[0], truth)
        expected[:, :2] *= scale
        np.testing.assert_allclose(odometry.poses, expected, atol=1e-9)
    noisy = run_simulation(two_rooms())
    off = between2(noisy.odometry.at(noisy.truth.timestamps), noisy.truth.poses)
    assert 0.01 < np.hypot(off[-1, 0], off[-1, 1]) < 1.0


# random buildings


@settings(max_examples=12, deadline=None)
@given(st.integers(0, 10**6), st.integers(1, 6), st.sampled_from(["manhattan", "any"]))
def test_random_plans_can_be_driven_through_every_room(seed: int, rooms: int, angles: str) -> None:
    plan = random_plan(seed, rooms, angles)  # type: ignore[arg-type]
    check_plan(plan)
    assert plan == random_plan(seed, rooms, angles)  # type: ignore[arg-type]
    assert len(plan.rooms) == rooms
    path = shapely.LineString(plan.path)
    assert all(path.intersects(shapely.Polygon(room.polygon).buffer(-0.3)) for room in plan.rooms)
    edges = np.concatenate([np.diff([*room.polygon, room.polygon[0]], axis=0) for room in plan.rooms])
    heading = np.arctan2(edges[:, 1], edges[:, 0])
    off = np.abs(np.sin(2 * (heading - heading[0]))) / 2
    if angles == "manhattan":
        assert off.max() < 1e-3


def test_random_plans_differ_and_have_other_angles_when_asked() -> None:
    plans = [random_plan(seed, 5, "any") for seed in range(4)]
    assert len({plan.rooms for plan in plans}) == 4
    for plan in plans:
        edges = np.concatenate([np.diff([*room.polygon, room.polygon[0]], axis=0) for room in plan.rooms])
        heading = np.arctan2(edges[:, 1], edges[:, 0])
        assert np.abs(np.sin(2 * (heading - heading[0]))).max() > 0.1
    with pytest.raises(InputError, match="rooms 13"):
        random_plan(0, 13)


# pictures

MODELS: list[tuple[DistortionModel, tuple[float, ...]]] = [
    ("plumb_bob", (-0.15, 0.05, 0.001, -0.001, 0.0)),
    ("rational_polynomial", (0.15, -0.06, 0.0003, -0.0002, 0.01, 0.25, -0.04, 0.005)),
    ("equidistant", (0.02, -0.01, 0.004, -0.001)),
]


@pytest.mark.parametrize(("model", "coefficients"), MODELS)
def test_labels_are_where_the_camera_projects_the_truth(
    model: DistortionModel, coefficients: tuple[float, ...]
) -> None:
    camera = dataclasses.replace(SMALL, distortion_model=model, distortion=coefficients, tilt_deg=3.0)
    simulation = run_simulation(two_rooms(camera=camera))
    pinhole = true_camera(camera)
    renderer = Renderer(simulation.building, pinhole, 0)
    plan_from_map = Pose3.from_planar(inverse2(simulation.map_from_plan))
    right = wrong = 0
    for pose in image_poses(simulation, true_extrinsics(simulation.building.plan)):
        _, labels = renderer.render(plan_from_map @ pose, Exposure(1.0, 0.0, (0,)))
        assert (labels > 0).all()
        for points, label in _truth_points(simulation, pose.translation[:2]):
            pixels = np.round(pinhole.project(pose.inverse().apply(points)))
            ok = np.isfinite(pixels).all(axis=1) & (pixels >= 2).all(axis=1) & (pixels < [158, 118]).all(axis=1)
            x, y = pixels[ok].astype(int).T
            flat = np.all([labels[y + j, x + i] == labels[y, x] for i in (-2, 2) for j in (-2, 2)], axis=0)
            right += int((labels[y, x] == label)[flat].sum())
            wrong += int((labels[y, x] != label)[flat].sum())
    assert right > 3000
    assert wrong == 0


def _truth_points(simulation: Simulation, eye: Array) -> list[tuple[Array, int]]:
    """Points (n, 3) on walls, floors and ceilings that can be seen from `eye` (lines of sight in the plan), labels."""
    layout, rng, out = simulation.layout, np.random.default_rng(1), []
    holes = [o for o in layout.openings if o.type == "passage"]
    solid = shapely.union_all([shapely.LineString([w.start, w.end]) for w in layout.walls])
    solid = solid.difference(shapely.union_all([shapely.LineString([o.start, o.end]).buffer(0.01) for o in holes]))

    def visible(points: Array) -> Array:
        lines = shapely.linestrings(np.stack([np.broadcast_to(eye, points.shape), points], axis=1))
        return np.asarray(~shapely.intersects(lines, solid))

    inside = [r for r in layout.rooms if shapely.Polygon(r.polygon).contains(shapely.Point(eye))]
    for wall in layout.walls:
        share = rng.uniform(0.02, 0.98, 600)[:, None]
        points = wall.start + share * (wall.end - wall.start) + 0.003 * wall.normal
        away = [o for o in holes if o.wall == wall.id]
        hole = shapely.union_all([shapely.LineString([o.start, o.end]).buffer(0.05) for o in away])
        points = points[visible(points) & ~shapely.contains_xy(hole, points)]
        z = rng.uniform(0.02, 0.9, len(points))
        out.append((np.column_stack([points, z]), 10 + wall.id))
    for room in layout.rooms:
        box = rng.uniform(room.polygon.min(axis=0), room.polygon.max(axis=0), (900, 2))
        box = box[shapely.contains_xy(shapely.Polygon(room.polygon), box)]
        box = box[visible(box)]
        out.append((np.column_stack([box, np.zeros(len(box))]), 1))
        if room in inside:
            top = layout.ceiling_height if room.ceiling_height is None else room.ceiling_height
            out.append((np.column_stack([box, np.full(len(box), top)]), 2))
    return out


def test_pictures_have_edges_at_the_foot_of_walls_and_the_top_of_baseboards() -> None:
    camera = dataclasses.replace(SMALL, image_width=320, image_height=240, fx=250.0, fy=250.0)
    simulation = run_simulation(two_rooms(camera=camera))
    pinhole = true_camera(camera)
    renderer = Renderer(simulation.building, pinhole, 3)
    plan_from_map = Pose3.from_planar(inverse2(simulation.map_from_plan))
    foot: list[Array] = []
    top: list[Array] = []
    beside: list[Array] = []
    for i, pose in enumerate(image_poses(simulation, true_extrinsics(simulation.building.plan))):
        image, labels = renderer.render(plan_from_map @ pose, Exposure(1.0, 2.0, (i,)))
        assert 40 < image.mean() < 220
        edge = cv2.dilate(cv2.Canny(image, 40, 90), np.ones((3, 3), np.uint8)) > 0
        foot.append(edge[:-1][(labels[:-1] >= 10) & (labels[1:] == 1)])
        for points, label in _truth_points(simulation, pose.translation[:2]):
            for z, found in ((simulation.building.plan.look.baseboard, top), (0.25, beside)):
                pixels = np.round(
                    pinhole.project(pose.inverse().apply(np.column_stack([points[:, :2], 0 * points[:, 2] + z])))
                )
                ok = np.isfinite(pixels).all(axis=1) & (pixels >= 0).all(axis=1) & (pixels < [320, 240]).all(axis=1)
                x, y = pixels[ok].astype(int).T
                found.append(edge[y, x][labels[y, x] == label] if label >= 10 else np.zeros(0, bool))
    assert min(len(np.concatenate(found)) for found in (foot, top, beside)) > 500
    assert np.concatenate(foot).mean() > 0.8
    assert np.concatenate(top).mean() > 0.8
    assert np.concatenate(beside).mean() < 0.4


# folders


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("simulated") / "deep" / "seq"
    simulate(two_rooms(write_extrinsics=True), path, seed=7)
    return path


def test_a_simulated_folder_reads_back(folder: Path) -> None:
    plan = two_rooms(write_extrinsics=True)
    scans, truth, odometry = simulate_scans(plan, 7)
    sequence, known = read_sequence(folder), read_groundtruth(folder)
    assert sequence.warnings == ()
    np.testing.assert_array_equal(sequence.scans.ranges, scans.ranges)
    assert sequence.odometry is not None and sequence.images is not None and sequence.camera is not None
    np.testing.assert_allclose(between2(sequence.odometry.poses, odometry.poses), 0.0, atol=2e-6)
    assert known.trajectory is not None and known.layout is not None and known.camera_trajectory is not None
    np.testing.assert_allclose(between2(known.trajectory.poses, truth.poses), 0.0, atol=2e-6)
    np.testing.assert_allclose(truth.poses[0], 0.0, atol=1e-12)
    expected = true_extrinsics(plan)
    for pose in (sequence.platform_from_camera, known.platform_from_camera):
        assert pose is not None
        np.testing.assert_allclose(pose.matrix(), expected.matrix(), atol=1e-6)
    assert expected.translation[2] == plan.camera.height
    assert np.degrees(np.arcsin(-expected.rotation[2, 2])) == pytest.approx(plan.camera.tilt_deg, abs=1e-9)
    assert [w.id for w in known.layout.walls] == list(range(8))
    assert known.layout.rooms[1].ceiling_height == 3.0
    np.testing.assert_array_equal(sequence.images.timestamps, known.camera_trajectory.timestamps)
    _check_pictures(folder)


def _check_pictures(folder: Path) -> None:
    sequence, known = read_sequence(folder), read_groundtruth(folder)
    assert sequence.images is not None
    for name, path in zip(sequence.images.names, sequence.images.paths, strict=True):
        label_path = known.label_path(name)
        assert label_path is not None
        labels = cv2.imread(str(label_path), cv2.IMREAD_UNCHANGED)
        image = cv2.imread(str(path))
        assert labels is not None and image is not None
        assert labels.dtype == np.uint16
        assert labels.shape == (120, 160) and image.shape == (120, 160, 3)
        assert set(np.unique(labels)) <= {1, 2, *range(10, 18)}


def test_the_same_seed_gives_the_same_bytes(folder: Path, tmp_path: Path) -> None:
    files = sorted(p.relative_to(folder) for p in folder.rglob("*") if p.is_file())
    for seed, same in ((7, True), (8, False)):
        simulate(two_rooms(write_extrinsics=True), tmp_path / "again", seed=seed)
        again = sorted(p.relative_to(tmp_path / "again") for p in (tmp_path / "again").rglob("*") if p.is_file())
        assert again == files
        equal = [(tmp_path / "again" / f).read_bytes() == (folder / f).read_bytes() for f in files]
        assert all(equal) == same
    assert sorted(p.name for p in tmp_path.iterdir()) == ["again"]


def test_only_what_is_asked_for_is_written(tmp_path: Path) -> None:
    camera = dataclasses.replace(SMALL, rate=0.0)
    simulate(two_rooms(camera=camera, write_odometry=False), tmp_path / "seq")
    names = sorted(p.name for p in (tmp_path / "seq").iterdir())
    assert names == ["groundtruth", "scans.npz"]
    sequence = read_sequence(tmp_path / "seq")
    assert sequence.odometry is None and sequence.images is None


def test_other_peoples_folders_are_left_alone(tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.txt").write_text("all my work")
    (tmp_path / "file").write_text("x")
    plan = two_rooms(camera=dataclasses.replace(SMALL, rate=0.0))
    for name in ("mine", "file", "file/seq"):
        with pytest.raises(OutputError, match=name):
            simulate(plan, tmp_path / name)
    assert (tmp_path / "mine" / "thesis.txt").read_text() == "all my work"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["file", "mine"]
    (tmp_path / "empty").mkdir()
    simulate(plan, tmp_path / "empty")
    assert (tmp_path / "empty" / "scans.npz").is_file()


def test_the_sample_plan_simulates_with_all_its_kinds_of_things() -> None:
    plan = Plan.from_json(SAMPLE)
    simulation = run_simulation(plan)
    assert {o.type for o in simulation.layout.openings} == {"door", "passage", "window"}
    assert len(simulation.layout.objects) == len(plan.objects) + sum(o.open for o in plan.openings)
    valid = np.mean([simulation.scans.valid(i).mean() for i in range(len(simulation.scans))])
    assert 0.95 < valid < 1.0


# a big office


@pytest.mark.parametrize(("seed", "rooms", "variety"), [(0, 12, 0.0), (1, 25, 1.0), (2, 40, 0.5)])
def test_an_office_has_rooms_apart_all_within_reach_and_corridors_that_loop(
    seed: int, rooms: int, variety: float
) -> None:
    plan = office_plan(seed, rooms, 30.0 * rooms, variety, 0.4)
    check_plan(plan)
    assert plan == office_plan(seed, rooms, 30.0 * rooms, variety, 0.4)
    shapes = [shapely.Polygon(room.polygon) for room in plan.rooms]
    offices = [shape for shape, room in zip(shapes, plan.rooms, strict=True) if room.name.startswith("room")]
    assert len(offices) == rooms
    assert all(a.distance(b) > 0.19 for i, a in enumerate(shapes) for b in shapes[:i])
    doors = [n for n in niches(plan) if n.closed == "nothing"]
    holes = [shapely.Polygon(np.concatenate([n.front, n.back[::-1]])).buffer(1e-3) for n in doors]
    whole = shapely.union_all([*shapes, *holes])
    assert whole.geom_type == "Polygon" and len(whole.interiors) >= 1, "one piece, with ways round"
    path = shapely.LineString(plan.path)
    assert all(path.intersects(office.buffer(-0.9)) for office in offices)
    assert drive_path(plan).lengths.sum() == pytest.approx(30.0 * rooms, rel=0.1)
    widths = [office.bounds[2] - office.bounds[0] for office in offices if office.area > 0]
    assert (np.ptp(widths) < 1e-3) == (variety == 0.0)


def test_office_numbers_out_of_range() -> None:
    for arguments in ((0, 11), (0, 401), (0, 20, 5.0), (0, 20, 100.0, 1.5)):
        with pytest.raises(InputError, match="office_plan: rooms"):
            office_plan(*arguments)


def test_long_drives_are_simulated_block_by_block(monkeypatch: pytest.MonkeyPatch) -> None:
    """Exact ranges do not depend on how many scans are made at once."""
    plan = dataclasses.replace(office_plan(3, 12, 40.0), lidar=dataclasses.replace(EXACT, beams=90))
    whole = simulate_scans(plan)[0].ranges
    monkeypatch.setattr("recon.simulate.lidar.BLOCK", 7)
    assert len(whole) > 14
    np.testing.assert_array_equal(simulate_scans(plan)[0].ranges, whole)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10**6))
def test_rays_through_the_grid_hit_what_all_segments_tried_one_by_one_give(seed: int) -> None:
    rng = np.random.default_rng(seed)
    ends = rng.uniform(0, 20, (30, 1, 2)) + rng.normal(0, 3, (30, 2, 2))
    ends[:5, 1, 0] = ends[:5, 0, 0]
    scene = Slice(ends.reshape(30, 4), np.zeros(30, np.bool_), np.arange(30))
    origins, angle = rng.uniform(-10, 30, (200, 2)), rng.uniform(-np.pi, np.pi, 200)
    angle[:20] = np.round(angle[:20] / (np.pi / 2)) * np.pi / 2
    directions = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    distance, index = cast(scene, origins, directions)
    along, rays = ends[:, 1] - ends[:, 0], directions[:, None]
    to = ends[None, :, 0] - origins[:, None]
    cross = rays[..., 0] * along[:, 1] - rays[..., 1] * along[:, 0]
    t = (to[..., 0] * along[:, 1] - to[..., 1] * along[:, 0]) / cross
    share = (to[..., 0] * rays[..., 1] - to[..., 1] * rays[..., 0]) / cross
    t[(share < 0) | (share > 1) | (t <= 0)] = np.inf
    np.testing.assert_allclose(distance, t.min(axis=1), rtol=1e-9)
    hit = np.isfinite(distance)
    assert np.array_equal(index[hit], t.argmin(axis=1)[hit]) and (index[~hit] == -1).all() and hit.any()
