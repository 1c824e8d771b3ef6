"""Heights of things of which the scanner saw the legs: the space above them carved by what images show."""

from __future__ import annotations

import cv2
import numpy as np

from recon.geometry import Array, Pose3
from recon.segmentation.crop import Crop
from recon.segmentation.solid import learned
from recon.segmentation.thing import Thing
from recon.sequence.camera import Camera

CELL = 0.04
"""m"""
CORE = 0.4
"""m: below are pixels from which the colours of the legs are first learned."""
LEAST_VIEWS = 3
"""Crops that must see a cell."""
DISSENT = 25
"""Per cent of the crops that may see the background in a cell of the thing."""
FULL = 0.5
"""Evidence for a cell."""
LOWEST = 0.2
"""m"""
DROP = 0.15
"""Above a thing there are at most this share of the cells below its top ..."""
ABOVE = 4
"""... in so many layers."""
ROUNDS = 3
OFF = -1e6
"""Pixel: out of the image."""


def legged_span(
    thing: Thing, crops: list[Crop], poses: list[Pose3], camera: Camera, top: float
) -> tuple[float, float] | None:
    """From 0 to the height, m, above which the cells over the legs are empty in most images; None when that is nowhere.

    A soft visual hull (Laurentini 1994) of what differs from the background.
    """
    cells = _cells(thing, top)
    legs = [(crop.lowest < CORE).astype(float) for crop in crops]
    weights, height = legs, None
    for _ in range(ROUNDS):
        if not any(weight.any() for weight in weights):
            return None
        evidence = learned(crops, weights)
        scores = _scores(cells, crops, evidence, poses, camera)
        height = _top(np.count_nonzero(scores > FULL, axis=(0, 1)))
        if height is None:
            return None
        inside = [(crop.reach < height) & (e > 1.5) for crop, e in zip(crops, evidence, strict=True)]
        weights = [i + 0.05 * leg for i, leg in zip(inside, legs, strict=True)]
    return None if height is None else (0.0, height)


def _cells(thing: Thing, top: float) -> Array:
    """Centres (x, y, z, 3) of cells in the thing's reach, m."""
    low, high = thing.reach.outline.min(axis=0) - CELL, thing.reach.outline.max(axis=0) + CELL
    axes = [np.arange(a, b + CELL, CELL) for a, b in zip(low, high, strict=True)]
    return np.stack(np.meshgrid(*axes, np.arange(CELL / 2, top, CELL), indexing="ij"), axis=-1)


def _scores(cells: Array, crops: list[Crop], evidence: list[Array], poses: list[Pose3], camera: Camera) -> Array:
    """Evidence (x, y, z) for every cell that all but a few crops exceed; -inf where too few see it."""
    points = cells.reshape(-1, 3)
    seen = np.full((len(crops), len(points)), np.inf)
    for row, crop, found, pose in zip(seen, crops, evidence, poses, strict=True):
        pixels = camera.project(pose.inverse().apply(points))
        pixels = np.nan_to_num(pixels, nan=OFF, posinf=OFF, neginf=OFF).clip(OFF, -OFF)
        r = np.round((pixels[:, 1] - crop.rows[0]) / crop.step).astype(np.int64)
        c = np.round((pixels[:, 0] - crop.columns[0]) / crop.step).astype(np.int64)
        inside = (r >= 0) & (r < len(crop.rows)) & (c >= 0) & (c < len(crop.columns))
        wide = cv2.dilate(found.astype(np.float32), np.ones((3, 3), np.uint8))  # legs are thin
        row[inside] = wide[r[inside], c[inside]]
    seen.sort(axis=0)
    count = np.isfinite(seen).sum(axis=0)
    quantile = seen[count * DISSENT // 100, np.arange(len(points))]
    return np.asarray(np.where(count >= LEAST_VIEWS, quantile, -np.inf)).reshape(cells.shape[:3])


def _top(layers: Array) -> float | None:
    """The lowest height, m, at which full cells (z,) end."""
    for i in range(int(LOWEST / CELL), len(layers) - ABOVE):
        if layers[i : i + ABOVE].max() < DROP * layers[i - 2 : i].min():
            return (i - 1 + min(1.0, float(layers[i - 1] / layers[i - 2]))) * CELL  # the last may be part full
    return None
