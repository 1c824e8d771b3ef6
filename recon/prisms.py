"""Things on the floor in 3D: footprints extruded, and how far up images say they reach."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.faces import triangulate
from recon.geometry import Array, Pose3
from recon.model import Face, FloorObject, Layout
from recon.raycast import RayScene
from recon.sequence.camera import Camera

WORKING_WIDTH = 160
"""Pixels: images are compared at about this width."""
RANGE = 6.0
"""m: objects farther from the camera are too small to be measured."""
BASELINE, TURN = 0.25, np.deg2rad(35.0)
"""An image is compared with the nearest ones at least so many m away, turned no further than this."""
BIN = 0.05
"""m of height."""
FULL = 30.0
"""Levels (0 to 255): larger differences count as this."""
DOUBT, CONVINCING = 1.0, 2.0
"""Levels: evidence below the first speaks against the object; the mean over its height must reach the second."""
LEAST = 0.1
"""m: lowest object."""

Image = NDArray[np.uint8]
Grid = NDArray[np.float32]


def prism(footprint: Array, bottom: float, top: float, number: int) -> Face:
    """An extruded counter-clockwise footprint (n, 2), closed; triangles counter-clockwise seen from outside."""
    from shapely.geometry import Polygon

    n = len(footprint)
    low = np.column_stack([footprint, np.full(n, bottom)])
    high = np.column_stack([footprint, np.full(n, top)])
    k, after = np.arange(n), (np.arange(n) + 1) % n
    sides = np.concatenate([np.stack([k, after, n + after], axis=1), np.stack([k, n + after, n + k], axis=1)])
    flat, lid = triangulate(Polygon(footprint))
    lids = [np.column_stack([flat, np.full(len(flat), z)]) for z in (top, bottom)]
    vertices = np.concatenate([low, high, *lids])
    triangles = np.concatenate([sides, lid + 2 * n, lid[:, ::-1] + 2 * n + len(flat)])
    return Face(f"object_{number:03d}", "wall", number, vertices, triangles, np.zeros((len(vertices), 2)))


def measure_objects(
    layout: Layout,
    faces: tuple[Face, ...],
    camera: Camera,
    map_from_camera: Sequence[Pose3 | None],
    load: Callable[[int], Image | None],
) -> tuple[FloorObject, ...]:
    """The layout's objects with `bottom` and `top`, m, where images show them; `top` None where they do not.

    Every pixel whose ray crosses the footprint shows either the object or what is behind. Whichever it is, the point
    must look the same in the next image; the heights for which the object explains the images best win (the
    contiguous run of heights with the largest sum of evidence).
    """
    if not layout.objects:
        return ()
    poses = [(i, pose) for i, pose in enumerate(map_from_camera) if pose is not None]
    height = layout.extrusion_height
    columns = tuple(prism(o.footprint, 0.0, height, k) for k, o in enumerate(layout.objects))
    bins = max(int(np.ceil(height / BIN)), 1)
    evidence, count = np.zeros((len(columns), bins)), np.zeros((len(columns), bins))
    footprints = [o.footprint for o in layout.objects]
    comparer = _Comparer(camera, RayScene(faces), RayScene(columns), footprints, load)
    for k, (i, pose) in enumerate(poses):
        hits = comparer.hits(pose)
        if len(hits.owner) == 0:
            continue
        place = hits.owner, np.clip((hits.height / BIN).astype(int), 0, bins - 1)
        for j, other in _neighbours(poses, k):
            found = comparer.evidence(i, pose, j, other, hits)
            if found is not None:
                use = np.isfinite(found)
                np.add.at(evidence, (place[0][use], place[1][use]), found[use])
                np.add.at(count, (place[0][use], place[1][use]), 1)
    spans = [_span(e, c) for e, c in zip(evidence, count, strict=True)]
    return tuple(
        o if span is None else replace(o, bottom=span[0], top=span[1])
        for o, span in zip(layout.objects, spans, strict=True)
    )


@dataclass(frozen=True)
class _Hits:
    """Pixels (n, 2) of the small image whose ray meets an object's column before anything else.

    owner (n,): which object; height (n,) m above the floor; on, behind: (n, 3) the points on the column and beyond it.
    """

    pixels: NDArray[np.int64]
    owner: NDArray[np.int64]
    height: Array
    on: Array
    behind: Array


class _Comparer:
    """Small images of one camera, compared by way of points in space."""

    def __init__(
        self,
        camera: Camera,
        background: RayScene,
        columns: RayScene,
        footprints: list[Array],
        load: Callable[[int], Image | None],
    ) -> None:
        self._footprints = [f.astype(np.float32) for f in footprints]
        self._camera, self._background, self._columns, self._load = camera, background, columns, load
        self._factor = max(round(camera.width / WORKING_WIDTH), 1)
        width, height = camera.width // self._factor, camera.height // self._factor
        x, y = np.meshgrid(np.arange(width, dtype=np.float64), np.arange(height, dtype=np.float64))
        pixels = (np.stack([x.ravel(), y.ravel()], axis=1) + 0.5) * self._factor - 0.5
        self._rays = np.column_stack([camera.undistort(pixels), np.ones(len(pixels))])
        self._size = (width, height)
        self._held: dict[int, Grid | None] = {}

    def hits(self, pose: Pose3) -> _Hits:
        """What of the columns is seen from a pose; nothing of one that the camera itself stands in."""
        directions = self._rays @ pose.rotation.T
        near, owner = self._columns.cast(pose.translation, directions)
        far, _ = self._background.cast(pose.translation, directions)
        x, y, _ = map(float, pose.translation)
        above = np.array([cv2.pointPolygonTest(f, (x, y), False) >= 0 for f in self._footprints])
        use = (near < far) & np.isfinite(far) & ~above[owner] & (near * np.linalg.norm(directions, axis=1) < RANGE)
        index = np.flatnonzero(use)
        on = pose.translation + near[index, None] * directions[index]
        behind = pose.translation + far[index, None] * directions[index]
        pixels = np.stack([index % self._size[0], index // self._size[0]], axis=1)
        return _Hits(pixels, owner[index], on[:, 2], on, behind)

    def evidence(self, i: int, pose: Pose3, j: int, other: Pose3, hits: _Hits) -> Array | None:
        """Levels (n,) by which the object explains image j better than what is behind it; nan where j does not see."""
        first, second = self._small(i), self._small(j)
        if first is None or second is None:
            return None
        own = first[hits.pixels[:, 1], hits.pixels[:, 0]]
        there = [self._read(second, other, points) for points in (hits.on, hits.behind)]
        gain = self._gain(first, second, pose, other)
        on, behind = (np.minimum(np.abs(own - gain * t).max(axis=1), FULL) for t in there)
        return np.asarray(behind - on, dtype=np.float64)

    def _gain(self, first: Grid, second: Grid, pose: Pose3, other: Pose3) -> float:
        """How much brighter the first image is, from what both see of the background."""
        rays = self._rays[::17] @ pose.rotation.T
        reach, _ = self._background.cast(pose.translation, rays)
        ok = np.isfinite(reach)
        there = self._read(second, other, pose.translation + reach[ok, None] * rays[ok]).mean(axis=1)
        here = first.reshape(-1, 3)[::17][ok].mean(axis=1)
        use = np.isfinite(there) & (there > 10) & (here > 10)
        return float(np.median(here[use] / there[use])) if use.any() else 1.0

    def _read(self, image: Grid, pose: Pose3, points: Array) -> Grid:
        """Colours (n, 3) of a small image at points in the map, nan outside."""
        pixels = (self._camera.project(pose.inverse().apply(points)) + 0.5) / self._factor - 0.5
        xy = np.nan_to_num(pixels, nan=-1e4).astype(np.float32).reshape(-1, 1, 2)
        found = [
            cv2.remap(image, part, None, cv2.INTER_LINEAR, borderValue=(np.nan, np.nan, np.nan)).reshape(-1, 3)
            for part in np.array_split(xy, len(xy) // 20000 + 1)
        ]
        return np.concatenate(found)

    def _small(self, index: int) -> Grid | None:
        if index not in self._held:
            image = self._load(index)
            if len(self._held) > 16:
                self._held.pop(next(iter(self._held)))
            self._held[index] = None if image is None else self._shrunk(image)
        return self._held[index]

    def _shrunk(self, image: Image) -> Grid:
        small = cv2.resize(image, self._size, interpolation=cv2.INTER_AREA)
        return np.asarray(cv2.GaussianBlur(small, (0, 0), 0.7), dtype=np.float32)


def _neighbours(poses: list[tuple[int, Pose3]], k: int) -> list[tuple[int, Pose3]]:
    """The nearest image before and after that was taken far enough away, if it looks the same way."""
    _, pose = poses[k]
    found = []
    for step in (-1, 1):
        n = k + step
        while 0 <= n < len(poses) and np.linalg.norm(poses[n][1].translation - pose.translation) < BASELINE:
            n += step
        if 0 <= n < len(poses):
            cosine = float(pose.rotation[:, 2] @ poses[n][1].rotation[:, 2])
            if cosine > np.cos(TURN) and np.linalg.norm(poses[n][1].translation - pose.translation) < 8 * BASELINE:
                found.append(poses[n])
    return found


def _span(evidence: Array, count: Array) -> tuple[float, float] | None:
    """Bottom and top, m, of the run of bins with the largest sum of evidence beyond doubt (Kadane), or None."""
    best, start, total, span = 0.0, 0, 0.0, (0, 0)
    for k, value in enumerate(evidence - DOUBT * count):
        if total <= 0:
            start, total = k, 0.0
        total += value
        if total > best:
            best, span = total, (start, k + 1)
    low, high = span
    if evidence[:low].sum() > -CONVINCING * count[:low].sum():
        low = 0  # things stand on the floor unless images say no
    if high - low < LEAST / BIN or evidence[span[0] : high].sum() < CONVINCING * count[span[0] : high].sum():
        return None
    return round(low * BIN, 3), round(high * BIN, 3)
