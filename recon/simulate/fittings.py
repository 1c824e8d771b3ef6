"""Painted door leaves, windows, reveals and objects."""

from __future__ import annotations

import numpy as np

from recon.simulate.building import Building, Surface
from recon.simulate.canvas import Canvas, Colour, Image, mix, smooth_noise
from recon.simulate.plan import ObjectStyle
from recon.simulate.style import RoomStyle

OBJECT_COLOURS: dict[ObjectStyle, tuple[Colour, ...]] = {
    "carton": ((0.70, 0.53, 0.35), (0.64, 0.48, 0.32)),
    "cabinet": ((0.78, 0.77, 0.74), (0.55, 0.57, 0.60), (0.62, 0.48, 0.33)),
    "metal": ((0.42, 0.43, 0.45), (0.66, 0.67, 0.68)),
    "wood": ((0.60, 0.43, 0.27), (0.45, 0.30, 0.19)),
    "fabric": ((0.55, 0.22, 0.22), (0.22, 0.30, 0.45), (0.30, 0.36, 0.30)),
    "plastic": ((0.20, 0.21, 0.22), (0.80, 0.20, 0.16), (0.25, 0.45, 0.65)),
    "leaf": ((0.55, 0.38, 0.24),),
}


def paint_leaf(surface: Surface, style: RoomStyle, ppm: float, rng: np.random.Generator) -> Canvas:
    """A closed door: wood or paint, handle, plate at the foot, sometimes a window; wide doors have two leaves."""
    width, height = surface.size
    canvas = Canvas(width, height, ppm, style.door)
    canvas.shade(1.0 + 0.05 * _grain(canvas, rng))
    leaves = [(0.0, width)] if width < 1.25 else [(0.0, width / 2), (width / 2, width)]
    windowed = rng.random() < 0.35
    for k, (u0, u1) in enumerate(leaves):
        canvas.frame(u0, 0, u1, height, 0.008, mix(style.door, (0, 0, 0), 0.7))
        canvas.rectangle(u0 + 0.03, 0.03, u1 - 0.03, 0.25, (0.62, 0.62, 0.62))
        if windowed:
            middle = (u0 + u1) / 2
            canvas.rectangle(middle - 0.1, 1.15, middle + 0.1, height - 0.2, (0.7, 0.7, 0.68))
            canvas.rectangle(middle - 0.08, 1.17, middle + 0.08, height - 0.22, (0.25, 0.28, 0.30))
        handle = u1 - 0.08 if k == 0 else u0 + 0.08
        inwards = -0.12 if k == 0 else 0.12
        canvas.rectangle(handle - 0.022, 0.92, handle + 0.022, 1.14, (0.75, 0.75, 0.74))
        low, high = sorted((handle, handle + inwards))
        canvas.rectangle(low, 1.03, high, 1.055, (0.88, 0.88, 0.87))
    return canvas


def paint_glass(surface: Surface, style: RoomStyle, ppm: float, rng: np.random.Generator) -> Canvas:
    """A window: frame, mullions and the bright outside."""
    width, height = surface.size
    canvas = Canvas(width, height, ppm, (0.90, 0.95, 1.0))
    horizon = float(np.clip(1.3 - surface.origin[2], 0.1 * height, 0.9 * height))
    canvas.rectangle(0, 0, width, horizon, (0.52, 0.60, 0.42))
    for _ in range(int(width * 3) + 1):
        u, w, h = rng.uniform(0, width), rng.uniform(0.15, 0.5), rng.uniform(0.05, 0.5)
        grey = rng.uniform(0.45, 0.75)
        canvas.rectangle(u, horizon, u + w, horizon + h, (float(grey), float(grey), float(grey)))
    canvas.noise(rng, 0.06, 0.15)
    panes = max(1, round(width / 0.9))
    for k in range(panes):
        canvas.frame(k * width / panes, 0, (k + 1) * width / panes, height, 0.045, style.frame)
    return canvas


def paint_reveal(surface: Surface, style: RoomStyle, ppm: float) -> Canvas:
    """The sides of an opening: the frame's colour."""
    return Canvas(*surface.size, ppm, mix(style.frame, (1, 1, 1), 0.1))


def paint_threshold(surface: Surface, ppm: float, rng: np.random.Generator) -> Canvas:
    """The floor inside an opening: a worn metal or stone sill."""
    canvas = Canvas(*surface.size, ppm, (0.50, 0.49, 0.47))
    canvas.noise(rng, 0.05, 0.01)
    return canvas


def paint_object(
    surface: Surface, building: Building, style: RoomStyle, ppm: float, rng: np.random.Generator
) -> Canvas:
    """One side of an object in its style."""
    item = building.objects[surface.ref]
    colours = OBJECT_COLOURS[item.style]
    colour = style.door if item.style == "leaf" else colours[surface.ref % len(colours)]
    width, height = surface.size
    canvas = Canvas(width, height, ppm, colour)
    if item.style in ("wood", "leaf"):
        canvas.shade(1.0 + 0.06 * _grain(canvas, rng))
    else:
        canvas.noise(rng, 0.03, 0.01)
    if item.shape == "cylinder":
        canvas.rectangle(0, height - 0.03, width, height, mix(colour, (0, 0, 0), 0.4))
    elif item.style == "carton":
        canvas.rectangle(width / 2 - 0.03, 0, width / 2 + 0.03, height, mix(colour, (1, 0.95, 0.8), 0.3))
    elif item.style == "cabinet" and surface.axis_v[2] == 1.0:
        _drawers(canvas, colour)
    elif item.style == "leaf" and width > 0.2 and surface.axis_v[2] == 1.0:
        canvas.rectangle(width - 0.1, 1.0, width - 0.06, 1.2, (0.75, 0.75, 0.74))
    return canvas


def _drawers(canvas: Canvas, colour: Colour) -> None:
    columns, rows = max(1, round(canvas.width / 0.5)), max(1, round(canvas.height / 0.4))
    w, h = canvas.width / columns, canvas.height / rows
    for i in range(columns):
        for j in range(rows):
            canvas.frame(i * w, j * h, (i + 1) * w, (j + 1) * h, 0.006, mix(colour, (0, 0, 0), 0.6))
            middle, top = (i + 0.5) * w, (j + 0.85) * h
            canvas.rectangle(middle - 0.06, top - 0.01, middle + 0.06, top + 0.01, (0.3, 0.3, 0.3))


def _grain(canvas: Canvas, rng: np.random.Generator) -> Image:
    """(H, W) wood grain that runs up."""
    h, w = canvas.image.shape[:2]
    return smooth_noise((w, h), 0.008 * canvas.ppm, rng, 40.0).T
