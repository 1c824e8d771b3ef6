"""Every surface's finished picture: paint times light, with mip levels, in one buffer."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array
from recon.simulate.building import Building, Surface
from recon.simulate.canvas import Canvas, Image
from recon.simulate.fittings import paint_glass, paint_leaf, paint_object, paint_reveal, paint_threshold
from recon.simulate.floors import paint_ceiling, paint_floor
from recon.simulate.light import lamps, light_map
from recon.simulate.style import RoomStyle, room_styles
from recon.simulate.walls import paint_wall

GAMMA = 2.2
BRIGHTEST = 3.0
"""Radiance that the largest stored value stands for; white paint in good light is about 1."""
MOST_TEXELS = 6e6
DECODE: Array = BRIGHTEST * (np.arange(256) / 255.0) ** GAMMA
"""(256,) stored value to radiance."""


@dataclass(frozen=True)
class Atlas:
    """Arrays as `kernels.shade` takes them, one row a surface."""

    scales: Array
    offsets: NDArray[np.int64]
    sizes: NDArray[np.int64]
    levels: NDArray[np.int64]
    texels: NDArray[np.uint8]


def paint_building(building: Building, ppm: float, seed: int) -> Atlas:
    """Paint and light all surfaces at up to `ppm` texels a metre."""
    plan = building.plan
    styles = room_styles(plan.look, [len(room.polygon) for room in plan.rooms], seed)
    all_lamps = lamps(building)
    scales, pyramids = [], []
    for i, surface in enumerate(building.surfaces):
        width, height = surface.size
        scale = min(ppm, float(np.sqrt(MOST_TEXELS / (width * height))))
        rng = np.random.default_rng([seed, 13, i])
        radiance = _paint(surface, building, styles[surface.room], scale, rng, all_lamps[surface.room])
        stored = np.clip(radiance / BRIGHTEST, 0.0, 1.0) ** (1 / GAMMA) * 255
        scales.append(scale)
        pyramids.append(_pyramid(np.round(stored).astype(np.uint8)))
    return _pack(scales, pyramids)


def _paint(
    surface: Surface, building: Building, style: RoomStyle, ppm: float, rng: np.random.Generator, lamps: Array
) -> Image:
    """(H, W, 3) radiance."""
    glow: Image | float = 0.0
    kind = surface.kind
    if kind == "wall":
        canvas = paint_wall(surface, building, style, ppm, rng)
    elif kind == "floor":
        canvas = paint_floor(surface, building, style, ppm, rng)
    elif kind == "ceiling":
        canvas, glow = paint_ceiling(surface, style, ppm, rng)
        glow = 2.5 * glow[..., None]
    else:
        canvas = _paint_fitting(surface, building, style, ppm, rng)
    light = light_map(surface, building, lamps, canvas.image.shape[:2])
    if kind == "glass":
        light = np.full_like(light, 1.8)
    albedo = np.clip(canvas.image, 0.0, 1.0) ** GAMMA
    return np.asarray(albedo * light[..., None] + glow, np.float32)


def _paint_fitting(
    surface: Surface, building: Building, style: RoomStyle, ppm: float, rng: np.random.Generator
) -> Canvas:
    if surface.kind == "leaf":
        return paint_leaf(surface, style, ppm, rng)
    if surface.kind == "glass":
        return paint_glass(surface, style, ppm, rng)
    if surface.kind == "object":
        return paint_object(surface, building, style, ppm, rng)
    if surface.kind == "threshold":
        return paint_threshold(surface, ppm, rng)
    return paint_reveal(surface, style, ppm)


def _pyramid(picture: NDArray[np.uint8]) -> list[NDArray[np.uint8]]:
    levels = [picture]
    while min(levels[-1].shape[:2]) > 2 and len(levels) < 10:
        h, w = levels[-1].shape[:2]
        smaller = cv2.resize(levels[-1], (max(1, w // 2), max(1, h // 2)), interpolation=cv2.INTER_AREA)
        levels.append(np.asarray(smaller, np.uint8))
    return levels


def _pack(scales: list[float], pyramids: list[list[NDArray[np.uint8]]]) -> Atlas:
    deepest = max(len(p) for p in pyramids)
    offsets = np.zeros((len(pyramids), deepest), np.int64)
    sizes = np.ones((len(pyramids), deepest, 2), np.int64)
    at = 0
    for i, pyramid in enumerate(pyramids):
        for k, level in enumerate(pyramid):
            offsets[i, k], sizes[i, k] = at, level.shape[:2]
            at += level.size
    texels = np.concatenate([level.ravel() for pyramid in pyramids for level in pyramid])
    return Atlas(np.array(scales), offsets, sizes, np.array([len(p) for p in pyramids]), texels)
