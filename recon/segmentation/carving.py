"""Heights of things of which the scanner saw the legs: the space above them carved by what images show."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array, Pose3
from recon.segmentation.crop import Crop
from recon.segmentation.solid import learned
from recon.segmentation.thing import Thing
from recon.sequence.camera import Camera

CELL = 0.04
"""m"""
MOST_CELLS = 400
"""In one layer; cells of wide things are wider."""
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
    places = [_places(cells, crop, pose, camera) for crop, pose in zip(crops, poses, strict=True)]
    legs = [(crop.lowest < CORE).astype(float) for crop in crops]
    weights, height = legs, None
    for _ in range(ROUNDS):
        if not any(weight.any() for weight in weights):
            return None
        evidence = learned(crops, weights)
        full = _scores(places, evidence).reshape(cells.shape[:3]) > FULL
        height = _top(np.count_nonzero(full, axis=(0, 1)))
        if height is None:
            return None
        inside = [(crop.reach < height) & (e > 1.5) for crop, e in zip(crops, evidence, strict=True)]
        weights = [i + 0.05 * leg for i, leg in zip(inside, legs, strict=True)]
    return None if height is None else (0.0, height)


def _cells(thing: Thing, top: float) -> Array:
    """Centres (x, y, z, 3) of cells in the thing's reach, m."""
    low, high = thing.reach.outline.min(axis=0) - CELL, thing.reach.outline.max(axis=0) + CELL
    width = max(CELL, float(np.sqrt(np.prod(high - low) / MOST_CELLS)))
    axes = [np.arange(a, b + width, width) for a, b in zip(low, high, strict=True)]
    return np.stack(np.meshgrid(*axes, np.arange(CELL / 2, top, CELL), indexing="ij"), axis=-1)


def _places(cells: Array, crop: Crop, pose: Pose3, camera: Camera) -> NDArray[np.int64]:
    """Index (cells,) into the crop's pixels where each cell is seen, -1 outside."""
    pixels = camera.project(pose.inverse().apply(cells.reshape(-1, 3)))
    pixels = np.nan_to_num(pixels, nan=OFF, posinf=OFF, neginf=OFF).clip(OFF, -OFF)
    row = np.round((pixels[:, 1] - crop.rows[0]) / crop.step).astype(np.int64)
    column = np.round((pixels[:, 0] - crop.columns[0]) / crop.step).astype(np.int64)
    inside = (row >= 0) & (row < len(crop.rows)) & (column >= 0) & (column < len(crop.columns))
    return np.asarray(np.where(inside, row * len(crop.columns) + column, -1))


def _scores(places: list[NDArray[np.int64]], evidence: list[Array]) -> Array:
    """Evidence (cells,) that all but a few crops exceed; -inf where too few see a cell."""
    seen = np.full((len(places), len(places[0])), np.inf)
    for row, place, found in zip(seen, places, evidence, strict=True):
        wide = cv2.dilate(found.astype(np.float32), np.ones((3, 3), np.uint8))  # legs are thin
        row[place >= 0] = wide.ravel()[place[place >= 0]]
    seen.sort(axis=0)
    count = np.isfinite(seen).sum(axis=0)
    quantile = seen[count * DISSENT // 100, np.arange(seen.shape[1])]
    return np.asarray(np.where(count >= LEAST_VIEWS, quantile, -np.inf))


def _top(layers: Array) -> float | None:
    """The lowest height, m, at which full cells (z,) end."""
    for i in range(int(LOWEST / CELL), len(layers) - ABOVE):
        if layers[i : i + ABOVE].max() < DROP * layers[i - 2 : i].min():
            return (i - 1 + min(1.0, float(layers[i - 1] / layers[i - 2]))) * CELL  # the last may be part full
    return None
