"""What every image sees of every face."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array, Pose3
from recon.model import Face
from recon.ordered import ordered_map
from recon.progress import Stage
from recon.raycast import RayScene
from recon.texture.blur import blur_cost
from recon.texture.candidates import Candidates, view_cost
from recon.texture.canvas import BLOCK, Canvas, Plane
from recon.texture.fixed import Fixed, cell_of
from recon.texture.gains import ExposureSamples
from recon.texture.view import Image, Lens, Sight, look, pyramid, sample

if TYPE_CHECKING:
    from scipy.sparse import csr_array

TOLERANCE = 0.05
"""m: a ray that ends this much before a point has still met it (corners, walls that stand a little too near)."""
EXPOSURE_STRIDE = 4
"""Blocks between the points that exposure is compared at."""
MIN_STEP, MIN_TURN = 0.10, np.deg2rad(4.0)
"""m, rad: an image nearer than both to the last one used shows nothing new."""
PROBES = 24
"""Points a side at which resolution is probed."""
LAST = 12.0
"""Octaves: what a shadow of the platform lies on is shown where no other image shows it."""
RIM = 0.005
"""Share of the image's width: as far around an object's pixels blends, shadows at its foot and inexact masks reach."""
DETAIL = 0.7
"""Texels a side of what one pixel covers: finer would show nothing more."""

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Rig:
    """The camera, its pose at every image (None: not known) and the surfaces that hide one another."""

    lens: Lens
    poses: list[Pose3 | None]
    scene: RayScene


def useful_images(poses: Sequence[Pose3 | None]) -> list[int]:
    """Images with a pose, less those taken where the one before was."""
    out: list[int] = []
    last: Pose3 | None = None
    for i, pose in enumerate(poses):
        if pose is None:
            continue
        if last is not None:
            step = float(np.linalg.norm(pose.translation - last.translation))
            turn = float(np.arccos(np.clip((np.trace(last.rotation.T @ pose.rotation) - 1) / 2, -1, 1)))
            if step < MIN_STEP and turn < MIN_TURN:
                continue
        out.append(i)
        last = pose
    return out


def probe(rig: Rig, face: Face, images: list[int]) -> csr_array:
    """Pixels per metre (len(images), points) with which images see points all over a face, none where they do not."""
    from scipy import sparse

    plane = Plane.of(face)
    counts = [int(np.clip(np.ceil(side / 0.2), 2, PROBES)) for side in plane.size]
    canvas = Canvas(face, plane, *(BLOCK * count for count in counts))
    points, some = canvas.block_points
    points = points[some]
    values, columns = [np.zeros(0, np.float32)], [np.zeros(0, np.int64)]
    starts = np.zeros(len(images) + 1, np.int64)
    for k, i in enumerate(images):
        pose = rig.poses[i]
        starts[k + 1] = starts[k]
        if pose is not None and faces_it(rig.lens, pose, face):
            sight = _visible(rig.scene, pose, points, look(rig.lens, pose, points, canvas.axes, 0.01))
            values.append(np.sqrt(sight.fine * sight.coarse).astype(np.float32))
            columns.append(sight.index)
            starts[k + 1] += len(sight.index)
    table = np.concatenate(values), np.concatenate(columns), starts
    return sparse.csr_array(table, shape=(len(images), len(points)))


def faces_it(lens: Lens, map_from_camera: Pose3, face: Face) -> bool:
    """Whether the camera is before a face and the face may reach into the image: no is sure."""
    before = (map_from_camera.translation - face.vertices[0]) @ face.normal > 0
    return bool(before) and lens.may_see(map_from_camera, face.vertices)


def best_resolution(seen: csr_array) -> float | None:
    """Metres per texel worth having where a face is seen best (its best tenth); None when no image sees it."""
    best = np.asarray(seen.max(axis=0).toarray()).ravel() if seen.nnz else np.zeros(0)
    return DETAIL / float(np.percentile(best[best > 0], 90)) if best.any() else None


def survey(
    rig: Rig,
    canvases: list[Canvas],
    images: list[int],
    load: Callable[[int], Image | None],
    objects: Callable[[int], Mask | None] | None,
    workers: int,
    stage: Stage,
    fixed: Fixed | None = None,
) -> tuple[list[Candidates], ExposureSamples]:
    """The best views of every block of every canvas, and samples of exposure. Every image is decoded once.

    fixed: what lies over all images, made up for, looked at last and not among the samples.
    objects(i): mask (height, width) of the pixels of image i that show something before the faces; never used.
    """
    candidates = [Candidates(canvas.blocks[0] * canvas.blocks[1]) for canvas in canvases]
    samples = ExposureSamples()
    starts = np.cumsum([0] + [len(c.cost) for c in candidates])
    for canvas in canvases:
        _ = canvas.block_points  # computed here once, not by several threads at the same time

    def observe(i: int) -> tuple[float, list[tuple[int, Sight, NDArray[np.uint8]]]]:
        image, pose = load(i), rig.poses[i]
        return (0.0, []) if image is None or pose is None else (blur_cost(image), _observe(rig, canvases, pose, image))

    for i, (blur, seen) in zip(images, ordered_map(observe, images, workers), strict=True):
        mask = None if objects is None or not seen else _with_rim(objects(i))
        for k, sight, colour in seen:
            cost = view_cost(sight, canvases[k], rig.lens.camera) + blur
            before = _shows(mask, sight, BLOCK * canvases[k].texel)
            cost[before] = np.inf
            radius = rig.lens.radius_of(sight.pixels)
            row, column = np.divmod(sight.index, canvases[k].blocks[1])
            use = (row % EXPOSURE_STRIDE == 0) & (column % EXPOSURE_STRIDE == 0) & ~before
            shown = sight.pixels, rig.lens.camera, canvases[k].floor
            if fixed is not None:
                doubtful, hidden = fixed.at(*shown)
                cost = np.where(hidden, np.inf, cost + LAST * doubtful)
                colour = fixed.lit(colour, *shown)
                use &= ~doubtful
            candidates[k].offer(sight.index, i, cost, colour, radius)
            cells = cell_of(*shown)
            samples.add(starts[k] + sight.index[use], i, colour[use], radius[use], cells[use])
        stage.advance()
    return candidates, samples


def _with_rim(mask: Mask | None) -> Mask | None:
    if mask is None:
        return None
    reach = round(RIM * mask.shape[1])
    return cv2.dilate(mask.astype(np.uint8), np.ones((2 * reach + 1, 2 * reach + 1), np.uint8)) > 0


def _shows(mask: Mask | None, sight: Sight, size: float) -> NDArray[np.bool_]:
    """(n,) whether the middle or a corner of a block, `size` metres a side, lies in the mask."""
    found = np.zeros(len(sight.index), np.bool_)
    if mask is None:
        return found
    half = 0.5 * size * sight.fine[:, None]
    for corner in ((0, 0), (1, 1), (1, -1), (-1, 1), (-1, -1)):
        column, row = np.rint(sight.pixels + half * corner).astype(np.int64).T
        found |= mask[np.clip(row, 0, mask.shape[0] - 1), np.clip(column, 0, mask.shape[1] - 1)]
    return found


def _observe(rig: Rig, canvases: list[Canvas], pose: Pose3, image: Image) -> list[tuple[int, Sight, NDArray[np.uint8]]]:
    levels = pyramid(image)
    out = []
    for k, canvas in enumerate(canvases):
        if not faces_it(rig.lens, pose, canvas.face):
            continue
        points, some = canvas.block_points
        size = BLOCK * canvas.texel
        inner = np.flatnonzero(some)
        sight = look(rig.lens, pose, points.reshape(-1, 3)[inner], canvas.axes, size)
        sight = Sight(inner[sight.index], sight.pixels, sight.fine, sight.coarse)
        sight = _visible(rig.scene, pose, points.reshape(-1, 3), sight, some.shape)
        if len(sight.index):
            footprint = size * np.sqrt(sight.fine * sight.coarse)
            out.append((k, sight, sample(levels, sight.pixels, footprint)))
    return out


def _visible(scene: RayScene, pose: Pose3, points: Array, sight: Sight, shape: tuple[int, ...] | None = None) -> Sight:
    """The part of a sight that nothing hides; with the `shape` of the grid of points, nor hides next to it."""
    if len(sight.index) == 0:
        return sight
    directions = points[sight.index] - pose.translation
    reach, _ = scene.cast(pose.translation, directions)
    hidden = (1 - reach) * np.linalg.norm(directions, axis=1) > TOLERANCE
    if shape is not None:
        grid = np.zeros(shape[0] * shape[1], np.uint8)
        grid[sight.index[hidden]] = 1
        hidden = cv2.dilate(grid.reshape(shape[0], shape[1]), np.ones((3, 3), np.uint8)).ravel()[sight.index] > 0
    return Sight(*(a[~hidden] for a in (sight.index, sight.pixels, sight.fine, sight.coarse)))
