"""The scans as one cloud of points in the map, in the colours that images show there."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from recon.errors import InputError
from recon.geometry import Array, Pose3
from recon.model import Face
from recon.raycast import RayScene
from recon.sampling import bilinear
from recon.sequence.camera import Camera

CLOUD = "cloud.ply"
"""Name of the file in a result folder."""
ASSUMED_HEIGHT = 0.3
"""m above the floor: walls that are vertical do not tell how high the scanner sits, and nothing else needs it."""
CELL = 0.02
"""m: of the points in a square of this side the first is kept."""
MOST_POINTS = 1_000_000
"""Squares are larger where there would be more."""
REACH = 8.0
"""m from a camera."""
BEHIND = 0.05
"""m behind the model's surface where a point still is seen."""
GREY = 128
"""Of points that no image shows."""

_RECORD = np.dtype([("position", "<f4", 3), ("colour", "u1", 3)])
_PROPERTIES = [f"property float {axis}" for axis in "xyz"] + [f"property uchar {c}" for c in ("red", "green", "blue")]
_END = b"end_header\n"


@dataclass(frozen=True)
class PointCloud:
    """points: (N, 3) float32, m, map frame, all ASSUMED_HEIGHT above the floor. colours: (N, 3) uint8, RGB."""

    points: NDArray[np.float32]
    colours: NDArray[np.uint8]


def thinned(ends: Array) -> Array:
    """Of returns (R, 2) m one a square of a grid, in their order."""
    side = CELL
    while True:
        cells = np.floor((ends - ends.min(axis=0)) / side).astype(np.int64) if len(ends) else np.zeros((0, 2), np.int64)
        first = np.sort(np.unique(cells[:, 0] * (1 << 32) + cells[:, 1], return_index=True)[1])
        if len(first) <= MOST_POINTS:
            return np.asarray(ends[first])
        side *= 1.5


def coloured(
    ends: Array,
    faces: tuple[Face, ...],
    camera: Camera | None,
    map_from_camera: Sequence[Pose3 | None],
    load: Callable[[int], NDArray[np.uint8] | None],
) -> PointCloud:
    """The cloud of returns (R, 2), m, map frame; every point in the colour of the nearest image that shows it.

    An image shows a point when no face of the model is before it. load(i): image i, BGR, or None when it is corrupt.
    """
    flat = thinned(ends)
    points = np.column_stack([flat, np.full(len(flat), ASSUMED_HEIGHT)])
    colours = np.full((len(points), 3), GREY, np.uint8)
    poses = [(i, pose) for i, pose in enumerate(map_from_camera) if pose is not None]
    if camera is not None and poses and len(points):
        for index, pixels, image in _views(points, faces, camera, poses, load):
            colours[index] = np.rint(bilinear(image, pixels[:, 0], pixels[:, 1])[:, ::-1])
    return PointCloud(points.astype(np.float32), colours)


def _views(
    points: Array,
    faces: tuple[Face, ...],
    camera: Camera,
    poses: list[tuple[int, Pose3]],
    load: Callable[[int], NDArray[np.uint8] | None],
) -> Iterator[tuple[NDArray[np.int64], Array, NDArray[np.uint8]]]:
    """For every image the points that are best seen in it: indices (n,), pixels (n, 2), and the image."""
    from scipy.spatial import cKDTree

    tree, scene = cKDTree(points[:, :2]), RayScene(faces)
    nearest = np.full(len(points), np.inf)
    owner, place = np.full(len(points), -1), np.zeros((len(points), 2))
    for k, (_, pose) in enumerate(poses):
        near = np.sort(np.array(tree.query_ball_point(pose.translation[:2], REACH), dtype=np.int64))
        offset = points[near] - pose.translation
        distance = np.linalg.norm(offset, axis=1)
        pixels = camera.project(offset @ pose.rotation)
        inside = ((pixels >= 0) & (pixels <= [camera.width - 1, camera.height - 1])).all(axis=1)
        use = np.flatnonzero(inside & (distance < nearest[near]))
        reach, _ = scene.cast_front(pose.translation, offset[use] / distance[use, None])
        use = use[reach > distance[use] - BEHIND]
        nearest[near[use]], owner[near[use]], place[near[use]] = distance[use], k, pixels[use]
    for k in np.unique(owner[owner >= 0]):
        image = load(poses[k][0])
        if image is not None:
            index = np.flatnonzero(owner == k)
            yield index, place[index], image


def ply_of(cloud: PointCloud) -> bytes:
    """A binary PLY file."""
    records = np.zeros(len(cloud.points), _RECORD)
    records["position"], records["colour"] = cloud.points, cloud.colours
    comment = f"comment recon, metres, Z up, the scan plane is assumed {ASSUMED_HEIGHT} m above the floor"
    head = ["ply", "format binary_little_endian 1.0", comment, f"element vertex {len(records)}", *_PROPERTIES]
    return ("\n".join(head) + "\n").encode("ascii") + _END + records.tobytes()


def load_cloud(path: Path) -> PointCloud | None:
    """What `ply_of` wrote, None where there is no file; InputError where it is damaged."""
    if not path.exists():
        return None
    head, _, body = path.read_bytes().partition(_END)
    words = [line.split() for line in head.decode("ascii", "replace").splitlines()]
    count = next((int(w[2]) for w in words if w[:2] == ["element", "vertex"] and w[2].isdigit()), -1)
    if count < 0 or len(body) != count * _RECORD.itemsize:
        raise InputError(f"{path}: is damaged, expected the point cloud that recon build wrote")
    records = np.frombuffer(body, _RECORD)
    return PointCloud(records["position"].copy(), records["colour"].copy())
