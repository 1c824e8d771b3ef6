"""A result on a time line: walls, trajectory, scans and images as a recording that Rerun's viewer plays."""

from __future__ import annotations

import errno
import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.cloud import ASSUMED_HEIGHT
from recon.errors import InputError, OutputError
from recon.files import atomic_path
from recon.geometry import Array, Pose3
from recon.model import NEUTRAL_COLOURS, Face, Model, Wall
from recon.results.accuracy import read_closures, read_scan_residuals
from recon.results.reader import load_model
from recon.sequence.images import load_image
from recon.sequence.sequence import Sequence
from recon.sequence.trajectory import Trajectory
from recon.sequence.tum import read_tum
from recon.tiles import MOST_TEXELS, tiled

if TYPE_CHECKING:
    import rerun

MOST_SCANS, MOST_IMAGES = 4000, 1000
"""Of longer drives, evenly: a viewer holds all in memory."""
LARGEST = 800
"""Pixels, the width of images."""
SAME_TIME = 1e-4
"""s between an image and its pose: poses are written with six decimals."""
WALL_COLOURS = {"lidar": (31, 111, 235), "image": (46, 158, 79), "inferred": (154, 160, 166)}
PATH_COLOUR, LOOP_COLOUR, SCAN_COLOUR = (240, 163, 94), (46, 158, 79), (198, 40, 40)
RESIDUAL_COLOURS = {
    "lidar": (31, 111, 235),
    "image": (198, 40, 40),
    "motion": (46, 158, 79),
    "odometry": (240, 163, 94),
}
LINE, POINT = 0.02, 0.02
"""m: radii of lines and points."""
EYE = np.array([-0.3, -0.45, 0.85])
"""From the middle of the building to the eye, in diagonals of it."""
BACKGROUND = (30, 32, 36)
FOOTER, END = b"RRF2FOOT", 64
"""What a whole recording has in its last bytes."""


@dataclass(frozen=True)
class _Result:
    """What a result folder holds that can be shown. stamps (N,), poses (N,): of the camera, empty without images."""

    model: Model
    trajectory: Trajectory
    closures: Array
    residuals: dict[str, Array]
    stamps: Array
    poses: tuple[Pose3, ...]


def save_recording(folder: Path, sequence: Sequence | None, path: Path) -> None:
    """Write a result folder as an .rrd file; `sequence` brings scans and images, which no result holds.

    Raises InputError for a damaged result, or one of another sequence; OutputError when rerun-sdk is not there or
    `path` cannot be written.
    """
    stream = _stream(folder.stem)
    result = _read(folder)
    try:
        with atomic_path(path) as temporary:
            stream.save(temporary, default_blueprint=_blueprint(result, sequence))
            _record(stream, result, sequence)
            stream.disconnect()
            _check_whole(temporary)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written: {error.strerror or error}") from error


def _check_whole(path: Path) -> None:
    """Raises OSError for a recording without its end: Rerun's writer says nothing when the disk is full."""
    with path.open("rb") as file:
        file.seek(-min(END, path.stat().st_size), os.SEEK_END)
        if FOOTER not in file.read():
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def show_recording(folder: Path, sequence: Sequence | None) -> None:
    """The same in a window of Rerun's viewer, which stays open. Raises as `save_recording`."""
    stream = _stream(folder.stem)
    result = _read(folder)
    try:
        stream.spawn(default_blueprint=_blueprint(result, sequence))
    except (OSError, RuntimeError) as error:
        raise OutputError(f"Rerun's viewer did not start ({error}); -o run.rrd writes a file for it") from error
    _record(stream, result, sequence)
    stream.flush()


def _stream(name: str) -> rerun.RecordingStream:
    try:
        import rerun
    except ImportError:
        raise OutputError("rerun-sdk is not installed, `recon view` needs it: pip install 'recon[view]'") from None
    stream = rerun.RecordingStream("recon", recording_id=name, send_properties=False)
    stream.set_log_time_enabled(False)
    stream.set_log_tick_enabled(False)
    return stream


def _blueprint(result: _Result, sequence: Sequence | None) -> Any:
    """What the viewer shows first: the building from above at an angle; beside it the image, sigmas and residuals."""
    from rerun import blueprint

    faces = [face.vertices for face in result.model.faces]
    points = np.concatenate([*faces, _on_floor(result.trajectory.poses[:, :2])])
    low, high = points.min(axis=0), points.max(axis=0)
    middle, size = (low + high) / 2, float(np.linalg.norm(high - low))
    eye = blueprint.EyeControls3D(position=middle + EYE * size, look_target=middle, eye_up=[0.0, 0.0, 1.0])
    beside: list[Any] = []
    if sequence is not None and sequence.images is not None and len(result.poses):
        beside.append(blueprint.Spatial2DView(origin="world/camera/image", name="image"))
    if len(result.model.pose_sigmas):
        beside.append(blueprint.TimeSeriesView(origin="sigma", name="standard deviation of the position, m"))
    if result.residuals:
        beside.append(blueprint.TimeSeriesView(origin="residuals", name="residuals, standard deviations"))
    view = blueprint.Spatial3DView(origin="world", name="building", eye_controls=eye, background=BACKGROUND)
    shown = blueprint.Horizontal(view, blueprint.Vertical(*beside), column_shares=[2, 1]) if beside else view
    panels = (
        blueprint.TimePanel(state="collapsed", timeline="time"),
        blueprint.SelectionPanel(state="hidden"),
        blueprint.BlueprintPanel(state="collapsed"),
    )
    return blueprint.Blueprint(shown, *panels)


def _read(folder: Path) -> _Result:
    model = load_model(folder)
    if model.trajectory is None:
        raise InputError(f"{folder}: holds no trajectory.txt, expected what recon build wrote")
    stamps, poses = np.zeros(0), tuple[Pose3, ...]()
    if (path := folder / "camera_trajectory.txt").is_file():
        stamps, positions, quaternions = read_tum(path)
        poses = tuple(Pose3.from_quaternion(p, q) for p, q in zip(positions, quaternions, strict=True))
    return _Result(model, model.trajectory, read_closures(folder), read_scan_residuals(folder), stamps, poses)


def _record(stream: rerun.RecordingStream, result: _Result, sequence: Sequence | None) -> None:
    import rerun

    if sequence is not None and len(sequence.scans) != len(result.trajectory):
        raise InputError(
            f"the sequence has {len(sequence.scans)} scans and the result {len(result.trajectory)}, expected the one "
            "that the result was built from"
        )
    stream.log("world", rerun.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    for face in tiled(result.model.faces, MOST_TEXELS):
        if face.kind != "ceiling":
            stream.log(f"world/model/{face.name}", _mesh(face), static=True)
    _lines(stream, result)
    _platform(stream, result, sequence)
    if sequence is not None and sequence.images is not None and sequence.camera is not None and result.poses:
        _images(stream, result, sequence)


def _mesh(face: Face) -> Any:
    """Texture coordinates have v downwards here."""
    import rerun

    return rerun.Mesh3D(
        vertex_positions=face.vertices,
        triangle_indices=face.triangles,
        vertex_texcoords=np.column_stack([face.uv[:, 0], 1 - face.uv[:, 1]]),
        vertex_normals=np.broadcast_to(face.normal, face.vertices.shape),
        albedo_texture=face.texture,
        albedo_factor=None if face.texture is not None else NEUTRAL_COLOURS[face.kind],
    )


def _lines(stream: rerun.RecordingStream, result: _Result) -> None:
    """Walls by how they are known, the way of the platform, loop closures."""
    import rerun

    layout = result.model.layout
    for source, colour in WALL_COLOURS.items():
        walls = [wall for wall in layout.walls if wall.source == source]
        if walls:
            strips, words = [_foot(wall) for wall in walls], [_words(wall) for wall in walls]
            drawn = rerun.LineStrips3D(strips, colors=colour, radii=LINE, labels=words, show_labels=False)
            stream.log(f"world/walls/{source}", drawn, static=True)
    way = _on_floor(result.trajectory.poses[:, :2])
    stream.log("world/trajectory", rerun.LineStrips3D([way], colors=PATH_COLOUR, radii=LINE / 2), static=True)
    if len(result.closures):
        index = result.trajectory.nearest(result.closures.ravel()).reshape(-1, 2)
        ends = [_on_floor(result.trajectory.poses[pair, :2]) for pair in index]
        stream.log("world/loop_closures", rerun.LineStrips3D(ends, colors=LOOP_COLOUR, radii=LINE / 2), static=True)


def _foot(wall: Wall) -> Array:
    return _on_floor(np.stack([wall.start, wall.end]))


def _words(wall: Wall) -> str:
    sigma = "" if wall.source == "inferred" else f" +- {1000 * wall.sigma_offset:.1f} mm"
    return f"wall {wall.id}, {wall.source}, {wall.length:.3f} m{sigma}"


def _on_floor(points: Array) -> Array:
    return np.column_stack([points, np.full(len(points), LINE)])


def _platform(stream: rerun.RecordingStream, result: _Result, sequence: Sequence | None) -> None:
    """The platform over time, with its scan, its sigmas and its residuals."""
    import rerun

    stamps = result.trajectory.timestamps
    for kind in result.residuals:
        stream.log(f"residuals/{kind}", rerun.SeriesLines(colors=RESIDUAL_COLOURS[kind], names=kind), static=True)
    for i in _evenly(len(stamps), MOST_SCANS):
        stream.set_time("time", duration=float(stamps[i] - stamps[0]))
        x, y, yaw = result.trajectory.poses[i]
        turn = rerun.Quaternion(xyzw=[0.0, 0.0, np.sin(yaw / 2), np.cos(yaw / 2)])
        stream.log("world/platform", rerun.Transform3D(translation=[x, y, 0.0], quaternion=turn))
        if sequence is not None:
            points = sequence.scans.points(i)
            heights = np.full(len(points), ASSUMED_HEIGHT)
            seen = rerun.Points3D(np.column_stack([points, heights]), colors=SCAN_COLOUR, radii=POINT)
            stream.log("world/platform/scan", seen)
        for kind, values in result.residuals.items():
            if np.isfinite(values[i]):
                stream.log(f"residuals/{kind}", rerun.Scalars(float(values[i])))
        if len(result.model.pose_sigmas):
            sigma_x, sigma_y, _ = result.model.pose_sigmas[i]
            stream.log("sigma/position", rerun.Scalars(float(np.hypot(sigma_x, sigma_y))))


def _images(stream: rerun.RecordingStream, result: _Result, sequence: Sequence) -> None:
    """Images with their lens distortion taken off, where they were taken."""
    import rerun

    camera, images = sequence.camera, sequence.images
    assert camera is not None and images is not None
    scale = min(1.0, LARGEST / camera.width)
    size = round(camera.width * scale), round(camera.height * scale)
    matrix = np.diag([scale, scale, 1.0]) @ camera.matrix
    view = rerun.Pinhole(image_from_camera=matrix, resolution=size, camera_xyz=rerun.ViewCoordinates.RDF)
    stream.log("world/camera/image", view, static=True)
    first = result.trajectory.timestamps[0]
    for i in _evenly(len(images), MOST_IMAGES):
        k = int(np.argmin(np.abs(result.stamps - images.timestamps[i])))
        if abs(result.stamps[k] - images.timestamps[i]) > SAME_TIME:
            continue  # an image outside the scans' time has no pose
        stream.set_time("time", duration=float(images.timestamps[i] - first))
        pose = result.poses[k]
        stream.log("world/camera", rerun.Transform3D(translation=pose.translation, mat3x3=pose.rotation))
        raw = load_image(images, i, camera)
        if raw is not None:
            small = cv2.resize(_undistorted(raw, sequence), size, interpolation=cv2.INTER_AREA)
            data = cv2.imencode(".jpg", small)[1].tobytes()
            stream.log("world/camera/image", rerun.EncodedImage(contents=data, media_type="image/jpeg"))


def _undistorted(raw: NDArray[np.uint8], sequence: Sequence) -> NDArray[np.uint8]:
    """The image as a pinhole camera of the same matrix would see it."""
    camera = sequence.camera
    assert camera is not None
    if not camera.is_distorted:
        return raw
    pixels = camera.project(camera.rectified().rays().reshape(-1, 3)).astype(np.float32)
    place = np.nan_to_num(pixels, nan=-1.0).reshape(camera.height, camera.width, 2)
    return np.asarray(cv2.remap(raw, place, None, cv2.INTER_LINEAR), dtype=np.uint8)


def _evenly(count: int, most: int) -> list[int]:
    """At most `most` of `count` indices, evenly, the first and the last among them."""
    return [int(i) for i in np.unique(np.linspace(0, count - 1, min(count, most)).round())] if count else []
