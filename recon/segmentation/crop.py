"""The part of an image that may show one thing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array, Pose3
from recon.raycast import RayScene
from recon.segmentation.colours import colour_bins, density
from recon.segmentation.column import Column
from recon.segmentation.thing import Thing
from recon.sequence.camera import Camera

COARSE = 8
"""Pixels between the rays that find a column in an image."""
BORDER = 0.4
"""Border of a crop, share of the column's width in it, and at least ..."""
LEAST_BORDER = 24
"""... pixels."""
LARGEST = 160
"""Pixels along the longer side of a crop; larger ones are thinned."""
NOVEL, STRAY = 0.2, 0.02
"""Share of a thing's and of its background's pixels whose colour is like nothing seen before."""
FEW = 150.0
"""Pixels of one surface around a thing that count as much as all others for its colours there."""
BAND, BANDS = 0.15, 24
"""m: what is around at the same height (baseboards, rails) says more than the rest of a wall; most bands."""
HAIR = 0.05
"""m: a thing may stand this far into the wall behind it."""
SURE = 4.0
"""Largest evidence of one pixel, natural logarithm of a likelihood ratio."""


@dataclass(frozen=True)
class Crop:
    """Pixels [rows, columns] of an image; arrays are (h, w).

    image: BGR. lowest, reach: heights, m, from which what is in the thing's core, or in its reach, hides the background
    (`Column.meet`), inf outside. distance: m, to its reach. bins: `colour_bins`. behind: log density of each pixel's
    colour in the surroundings of what is behind it. clear: whether no other thing can be seen there. step: raw pixels
    between neighbours.
    """

    rows: NDArray[np.int64]
    columns: NDArray[np.int64]
    image: NDArray[np.uint8]
    lowest: Array
    reach: Array
    distance: Array
    bins: NDArray[np.int64]
    behind: Array
    clear: NDArray[np.bool_]
    step: int

    def evidence(self, colours: Array) -> Array:
        """Log likelihood ratio (h, w) of thing to background, for the density of the thing's colours."""
        return np.asarray(np.clip(np.log(colours)[self.bins] - self.behind, -SURE, SURE))

    def colours(self, weight: Array, novel: float = NOVEL) -> Array:
        """Density of the colours of the thing, to which pixels belong with weights (h, w); novel: share of others."""
        return density(self.bins, weight, novel)


class Eye:
    """One camera in one model."""

    def __init__(self, camera: Camera, scene: RayScene) -> None:
        rays = camera.rays()
        self._rays = rays / np.linalg.norm(rays, axis=2, keepdims=True)
        self._scene = scene
        self.focal = float(np.sqrt(camera.matrix[0, 0] * camera.matrix[1, 1]))

    def frame(self, column: Column, pose: Pose3, top: float) -> tuple[slice, slice] | None:
        """Rows and columns of the image around what is in the column, up to `top` m.

        None when it is not in view, or when the camera itself is in the column.
        """
        if column.holds(pose.translation[:2]):
            return None
        coarse = self._rays[::COARSE, ::COARSE] @ pose.rotation.T
        lowest, _ = column.meet(pose.translation, coarse)
        rows, columns = np.nonzero(lowest < top)
        if len(rows) < 2:
            return None
        border = max(LEAST_BORDER, int(BORDER * COARSE * (np.ptp(columns) + 1)))
        return tuple(
            slice(max(0, COARSE * int(i.min()) - border), min(size, COARSE * int(i.max()) + border + 1))
            for i, size in ((rows, self._rays.shape[0]), (columns, self._rays.shape[1]))
        )  # type: ignore[return-value]

    def crop(self, thing: Thing, others: list[Thing], image: NDArray[np.uint8], pose: Pose3, top: float) -> Crop | None:
        """What image (H, W, 3) BGR shows of a thing up to `top` m; None when nothing. others: what else is near."""
        frame = self.frame(thing.reach, pose, top)
        if frame is None:
            return None
        step = max(1, int(np.ceil(max(s.stop - s.start for s in frame) / LARGEST)))
        rows, columns = (np.arange(s.start, s.stop, step) for s in frame)
        origin, rays = pose.translation, self._rays[np.ix_(rows, columns)] @ pose.rotation.T
        background, face = self._scene.cast_front(origin, rays)
        reach, distance = thing.reach.meet(origin, rays)
        reach[distance > background + HAIR] = np.inf
        if not (reach < top).any():
            return None
        around = reach > (top if thing.solid else np.inf)
        around |= np.isinf(reach)
        hidden = reach > top
        reach[hidden] = np.inf
        lowest = np.where(hidden, np.inf, thing.lowest(origin, rays))
        height = origin[2] + np.where(face < 0, 0.0, background) * rays[..., 2]
        surface = face * BANDS + np.clip(height / BAND, 0, BANDS - 1).astype(np.int64)
        clear = np.ones(around.shape, np.bool_)
        for other in others:
            height_there, distance_there = other.reach.meet(origin, rays)
            around &= height_there > top
            clear &= (height_there > top) | (distance_there > background)
        part = np.ascontiguousarray(image[np.ix_(rows, columns)])
        bins = colour_bins(part)
        behind = _behind(bins, surface, around)
        return Crop(rows, columns, part, lowest, reach, distance, bins, behind, clear, step)


def _behind(bins: NDArray[np.int64], surface: NDArray[np.int64], around: NDArray[np.bool_]) -> Array:
    """Log density (h, w) of each pixel's colour `around`: on the same part of a face, the same face, and anywhere."""
    out = density(bins, around.astype(np.float64), STRAY)[bins]
    for part in (surface // BANDS, surface):
        for k in np.unique(part):
            mine = part == k
            count = float(np.count_nonzero(mine & around))
            if count > 0:
                own = density(bins, (mine & around).astype(np.float64), STRAY)[bins[mine]]
                out[mine] += count / (count + FEW) * (own - out[mine])
    return np.asarray(np.log(out))
