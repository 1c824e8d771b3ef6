"""The house, top to bottom: from a sequence to a model.

    sequence -> features -> calibration -> trajectory + walls -> layout -> texture -> Model

Every stage is a function of what the stages before it gave; only readers read files, only exporters write them.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from recon.calibration.calibrate import TOLERANCE, calibrate, check_given
from recon.calibration.clock import heading_offset
from recon.calibration.frames import collect_frames
from recon.calibration.result import Calibration
from recon.calibration.support import CalibrationFrames
from recon.calibration.synchronise import Drive, calibrate_with_clock
from recon.cloud import PointCloud, coloured
from recon.config import Config
from recon.faces import extrude
from recon.furniture import Furniture, suspects
from recon.geometry import Array, Pose3, between2
from recon.graph.blind import Eye, blind_steps, guessed_steps, see_along, unplaced_scans
from recon.graph.boundary import boundary_observations
from recon.graph.control import Control
from recon.graph.ekf import solve_filter
from recon.graph.estimate import MapEstimate
from recon.graph.motion import Motion
from recon.graph.observation import WallObservations
from recon.graph.solve import solve_graph
from recon.graph.tape import Tape
from recon.layout.build import build_layout
from recon.layout.evidence import scan_rays
from recon.layout.heights import measure_heights
from recon.layout.occupancy import build_occupancy
from recon.layout_json import layout_from_json, layout_to_json
from recon.lidar.matching import ScanMatching
from recon.lidar.noise import with_noise
from recon.lidar.segment import ScanSegments
from recon.lidar.split_and_merge import extract_segments
from recon.lidar.sweep import match_in_order
from recon.loops.close import ClosedLoops, close_loops
from recon.measured import NOTHING, Measured
from recon.memory import give_back
from recon.model import Face, Layout, Model
from recon.progress import SILENT, Progress, Stage
from recon.reveals import with_side_colours
from recon.segmentation.furniture import standing_furniture
from recon.segmentation.heights import measure_objects
from recon.sequence.images import iterate_images, load_image
from recon.sequence.sequence import Sequence
from recon.sequence.trajectory import Trajectory
from recon.sequence.tum import as_written
from recon.texture.notes import texture_notes
from recon.texture.refine import refine_poses
from recon.texture.texture import texture_faces
from recon.vision.frame import FrameLines
from recon.vision.frame_lines import detect_lines, relabel
from recon.vision.vertical import vertical_direction

MAX_EXTRAPOLATION = 0.2  # s: images farther outside the scans' time have no pose


@dataclass(frozen=True)
class Build:
    """All that a build found. `map_from_camera`: one pose an image, None where it has none."""

    sequence: Sequence
    config: Config
    model: Model
    estimate: MapEstimate
    calibration: Calibration | None
    map_from_camera: tuple[Pose3 | None, ...]
    seconds: dict[str, float]
    counts: dict[str, int]
    warnings: tuple[str, ...]
    measured: Measured = NOTHING


@dataclass
class _Run:
    """What accumulates while the stages run."""

    progress: Progress
    seconds: dict[str, float] = field(default_factory=dict)
    counts: dict[str, int] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)

    @contextmanager
    def stage(self, name: str, total: int | None = None, unit: str = "") -> Iterator[Stage]:
        """Shown to whoever watches, and timed."""
        start = time.perf_counter()
        with self.progress.stage(name, total, unit) as stage:
            yield stage
            give_back()
        self.seconds[name] = round(self.seconds.get(name, 0.0) + time.perf_counter() - start, 3)


def build(
    sequence: Sequence,
    config: Config,
    progress: Progress = SILENT,
    measured: Measured = NOTHING,
    plan_only: bool = False,
) -> Build:
    """From one drive to a textured model with known accuracy.

    measured: by people; walls are named by their ids in the layout of a build without it. plan_only: the same layout,
    without textures, heights of objects, cloud and occupancy. Raises InputError for walls that are not there, ConfigError
    where the backend takes no measures.
    """
    measured.check_backend(config.graph)
    run = _Run(progress, warnings=list(sequence.warnings))
    sequence, matching, segments = _scans(sequence, config, run)
    lines, vertical = _lines(sequence, config, run)
    calibration = _calibration(sequence, lines, vertical, matching.trajectory, segments, config, run)
    matching = _sighted(sequence, calibration, matching, segments, run)
    closed = _closed(sequence, matching, config, run)
    estimate = _estimate(sequence, lines, calibration, matching, closed, segments, config, run)
    if measured:
        plain = _layout(sequence, lines, calibration, estimate, config, run)
        named = measured.on_layout(plain, sequence.scans.timestamps)
        estimate = _estimate(sequence, lines, calibration, matching, closed, segments, config, run, *named)
        run.warnings.extend(measured.surprises(estimate))
    poses = _camera_poses(sequence, calibration, estimate.trajectory, run)
    layout = _layout(sequence, lines, calibration, estimate, config, run)
    layout = layout_from_json(layout_to_json(layout), "layout.json")  # its decimals: exports made later are equal
    if plan_only:
        model = _model(sequence, layout, (), config, run)
    else:
        model, poses = _finished(sequence, calibration, estimate, layout, poses, config, run)
    warnings = tuple(dict.fromkeys(run.warnings))
    return Build(sequence, config, model, estimate, calibration, poses, run.seconds, run.counts, warnings, measured)


def _finished(
    sequence: Sequence,
    calibration: Calibration | None,
    estimate: MapEstimate,
    layout: Layout,
    poses: tuple[Pose3 | None, ...],
    config: Config,
    run: _Run,
) -> tuple[Model, tuple[Pose3 | None, ...]]:
    """The model with all that images and scans tell of it, and the cameras, refined."""
    poses = _refined_poses(sequence, calibration, estimate, layout, poses, config, run)
    model = _model(sequence, layout, poses, config, run)
    with run.stage("occupancy"):
        occupancy = build_occupancy(estimate.trajectory, sequence.scans)
    cloud = _cloud(sequence, estimate.trajectory, model.faces, poses, run)
    drive = as_written(estimate.trajectory)
    model = replace(model, trajectory=drive, pose_sigmas=estimate.pose_sigmas, occupancy=occupancy, cloud=cloud)
    return model, poses


def _scans(sequence: Sequence, config: Config, run: _Run) -> tuple[Sequence, ScanMatching, ScanSegments]:
    """Odometry from scan matching, and line segments of every scan (paper 2.1); the scans with their beams in order."""
    scans = sequence.scans
    lidar = with_noise(scans, config.lidar)
    with run.stage("scan matching", len(scans), "scans") as stage:
        scans, matching = match_in_order(scans, sequence.odometry, lidar, run.warnings)
        stage.advance(len(scans))
    with run.stage("scan lines", len(scans), "scans") as stage:
        parts = []
        for i in range(len(scans)):
            parts.append(extract_segments(scans, i, lidar, matching.velocities[i]))
            stage.advance()
        segments = ScanSegments.pack(parts)
        del parts
    run.counts |= {"scans": len(scans), "scan segments": len(segments.table)}
    if matching.failed.any():
        run.warnings.append(
            f"{int(matching.failed.sum())} of {len(scans)} scans fitted no map; their motion is predicted"
        )
    return replace(sequence, scans=scans), matching, segments


def _lines(sequence: Sequence, config: Config, run: _Run) -> tuple[list[FrameLines | None], tuple[Array, float] | None]:
    """Lines and vanishing points of every image, and the vertical that all images share (paper 2.2, 2.3.1)."""
    if sequence.images is None or sequence.camera is None:
        return [], None
    frames: list[FrameLines | None] = []
    with run.stage("image lines", len(sequence.images), "images") as stage:
        for _, image in iterate_images(sequence.images, sequence.camera, grey=True, warnings=run.warnings):
            frames.append(None if image is None else detect_lines(image, sequence.camera, config.vision, config.seed))
            stage.advance()
        found = [f for f in frames if f is not None]
        down, sigma, count = vertical_direction(found, sequence.camera)
        run.counts |= {"images": len(frames), "image lines": sum(map(len, found)), "vertical lines": count}
        if count == 0:
            run.warnings.append("no image shows vertical lines; the images are left out")
            return frames, None
        camera = sequence.camera
        return [None if f is None else relabel(f, camera, down) for f in frames], (down, sigma)


def _calibration(
    sequence: Sequence,
    lines: list[FrameLines | None],
    vertical: tuple[Array, float] | None,
    trajectory: Trajectory,
    segments: ScanSegments,
    config: Config,
    run: _Run,
) -> Calibration | None:
    """platform_from_camera, estimated or given and checked (paper 2.3, 2.4), and the camera's clock."""
    camera, images, given = sequence.camera, sequence.images, sequence.platform_from_camera
    if camera is None or images is None or vertical is None:
        return None
    times = images.timestamps

    def collect(offset: float) -> CalibrationFrames:
        return collect_frames(lines, times + offset, trajectory, segments)

    def solve(frames: CalibrationFrames) -> Calibration | None:
        if given is not None:
            return check_given(frames, camera, vertical, given)
        return calibrate(frames, camera, vertical, config.calibration, config.seed)

    with run.stage("calibration"):
        drive = Drive(collect, times, trajectory, camera, vertical, TOLERANCE * camera.matrix[0, 0])
        result = calibrate_with_clock(drive, solve, heading_offset(lines, vertical[0], times, trajectory))
    if result is None:
        run.warnings.append(
            "the camera's pose on the platform was not found (too few wall feet agree with the scans); "
            "the model stays untextured, give extrinsics.yaml to use the images"
        )
        return None
    run.warnings.extend(result.warnings)
    run.counts["calibration images"] = len(result.inlier_frames)
    return result


def _sighted(
    sequence: Sequence, calibration: Calibration | None, matching: ScanMatching, segments: ScanSegments, run: _Run
) -> ScanMatching:
    """The scan matches, filled in where they say nothing along a corridor: from images, else from what platforms do."""
    eye = None if calibration is None else Eye.of(sequence, calibration)
    if not blind_steps(matching).any() or (eye is None and matching.odometry is not None):
        return matching
    with run.stage("image motion"):
        matching, seen = see_along(matching, segments, eye)
    if seen == 0:
        run.warnings.append("neither scans nor images tell the way along some corridor; constant velocity is assumed")
    run.counts["image motions"] = seen
    return matching


def _closed(sequence: Sequence, matching: ScanMatching, config: Config, run: _Run) -> ClosedLoops:
    """Places visited again, and the poses that agree with them; the paper's filter knows none."""
    if config.graph.backend == "ekf":
        return ClosedLoops.none(matching.trajectory)
    with run.stage("loop closure"):
        placed = replace(matching, failed=matching.failed | unplaced_scans(matching))
        closed = close_loops(sequence.scans, placed, config.lidar, config.workers)
    run.counts["loop closures"] = len(closed.closures)
    return closed


def _estimate(
    sequence: Sequence,
    lines: list[FrameLines | None],
    calibration: Calibration | None,
    matching: ScanMatching,
    closed: ClosedLoops,
    segments: ScanSegments,
    config: Config,
    run: _Run,
    tape: Tape | None = None,
    control: Control | None = None,
) -> MapEstimate:
    """Platform poses and wall lines from one factor graph, or from the paper's filter."""
    with run.stage("factor graph" if config.graph.backend == "graph" else "filter"):
        observations = [_wall_observations(segments)]
        if calibration is not None and sequence.images is not None and sequence.camera is not None:
            times, camera = calibration.on_scan_clock(sequence.images.timestamps), sequence.camera
            observations.append(
                boundary_observations(lines, times, camera, calibration, sequence.scans, closed.trajectory)
            )
        poses = matching.trajectory.poses
        motion = Motion(between2(poses[:-1], poses[1:]), matching.scan_covariances, guessed_steps(matching))
        given = closed.trajectory, motion, WallObservations.concatenate(observations), matching.odometry
        if config.graph.backend == "ekf":
            estimate = solve_filter(*given)
        else:
            estimate = solve_graph(*given, config.graph, closures=closed.seen_again, tape=tape, control=control)
            pairs = np.stack([closed.closures.first, closed.closures.second], axis=1)
            estimate = replace(estimate, closures=pairs)
    run.counts["wall lines"] = len(estimate.walls)
    return replace(estimate, odometry_clock=matching.clock)


def _wall_observations(segments: ScanSegments) -> WallObservations:
    """The LiDAR segments of all scans."""
    table = segments.table
    return WallObservations(segments.scan, table.endpoints, table.covariance, np.full(len(table), -1, np.int64))


def _camera_poses(
    sequence: Sequence, calibration: Calibration | None, trajectory: Trajectory, run: _Run
) -> tuple[Pose3 | None, ...]:
    """map_from_camera at every image; None where the image is outside the scans' time."""
    if sequence.images is None:
        return ()
    if calibration is None:
        return (None,) * len(sequence.images)
    times = calibration.on_scan_clock(sequence.images.timestamps)
    first, last = trajectory.timestamps[0] - MAX_EXTRAPOLATION, trajectory.timestamps[-1] + MAX_EXTRAPOLATION
    inside = (times >= first) & (times <= last)
    if not inside.all():
        run.warnings.append(
            f"{int((~inside).sum())} of {len(times)} images lie outside the scans' time and are left out"
        )
    return tuple(
        Pose3.from_planar(pose) @ calibration.platform_from_camera if ok else None
        for pose, ok in zip(trajectory.at(times), inside, strict=True)
    )


def _layout(
    sequence: Sequence,
    lines: list[FrameLines | None],
    calibration: Calibration | None,
    estimate: MapEstimate,
    config: Config,
    run: _Run,
) -> Layout:
    """The plan with heights, without the furniture that images tell from walls."""
    images, camera = sequence.images, sequence.camera
    if images is None or camera is None or calibration is None:
        with run.stage("layout"):
            return build_layout(estimate, sequence.scans, config.layout)
    poses = _camera_poses(sequence, calibration, estimate.trajectory, run)

    def plan(furniture: Iterable[Furniture] = ()) -> Layout:
        layout = build_layout(estimate, sequence.scans, config.layout, tuple(furniture))
        return measure_heights(layout, lines, poses, camera)

    def load(index: int) -> NDArray[np.uint8] | None:
        return load_image(images, index, camera, warnings=run.warnings)

    with run.stage("layout"):
        layout = plan()
        doubtful = suspects(layout)
        found = standing_furniture(doubtful, plan(doubtful), camera, poses, load) if doubtful else []
        return plan(found) if found else layout


def _refined_poses(
    sequence: Sequence,
    calibration: Calibration | None,
    estimate: MapEstimate,
    layout: Layout,
    poses: tuple[Pose3 | None, ...],
    config: Config,
    run: _Run,
) -> tuple[Pose3 | None, ...]:
    """The cameras, moved within what is known of them so that images agree on the faces."""
    images, camera = sequence.images, sequence.camera
    if images is None or camera is None or calibration is None:
        return poses

    def load(index: int) -> NDArray[np.uint8] | None:
        return load_image(images, index, camera, warnings=run.warnings)

    scans = estimate.trajectory.nearest(calibration.on_scan_clock(images.timestamps))
    x, y, yaw = estimate.pose_sigmas[scans].T
    sigmas = np.column_stack([np.hypot(x, y), yaw])
    with run.stage("image poses"):
        return refine_poses(extrude(layout), camera, poses, load, sigmas, config.workers)


def _model(sequence: Sequence, layout: Layout, poses: tuple[Pose3 | None, ...], config: Config, run: _Run) -> Model:
    """Faces extruded from the layout, textured from the images."""
    faces = extrude(layout)
    if sequence.images is not None and sequence.camera is not None and any(p is not None for p in poses):
        images, camera = sequence.images, sequence.camera

        def load(index: int) -> NDArray[np.uint8] | None:
            return load_image(images, index, camera, warnings=run.warnings)

        with run.stage("objects"):
            layout = replace(layout, objects=measure_objects(layout, faces, camera, poses, load))
        with run.stage("texture"):
            faces = with_side_colours(texture_faces(faces, camera, poses, load, config.texture, config.workers))
    notes = []
    if layout.ceiling_height is None:
        notes.append(f"No image shows the ceiling; walls are {layout.default_ceiling_height:.2f} m high by default.")
    if any(wall.source == "inferred" for wall in layout.walls):
        notes.append("Walls of source 'inferred' close the outline where no sensor saw a wall.")
    notes += texture_notes(faces, config.texture)
    run.counts |= {"walls": len(layout.walls), "rooms": len(layout.rooms), "openings": len(layout.openings)}
    return Model(sequence.name, layout, faces, tuple(notes))


def _cloud(
    sequence: Sequence,
    trajectory: Trajectory,
    faces: tuple[Face, ...],
    poses: tuple[Pose3 | None, ...],
    run: _Run,
) -> PointCloud:
    """The returns of all scans, in the colours of the images."""

    def load(index: int) -> NDArray[np.uint8] | None:
        assert sequence.images is not None and sequence.camera is not None
        return load_image(sequence.images, index, sequence.camera, warnings=run.warnings)

    with run.stage("cloud"):
        _, ends = scan_rays(trajectory, sequence.scans)
        cloud = coloured(ends, faces, sequence.camera, poses, load)
    run.counts["points"] = len(cloud.points)
    return cloud
