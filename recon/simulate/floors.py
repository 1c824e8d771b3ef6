"""Painted floors and ceilings."""

from __future__ import annotations

import numpy as np

from recon.geometry import Array
from recon.simulate.building import Building, Surface
from recon.simulate.canvas import Canvas, Image, smooth_noise
from recon.simulate.light import PANEL, floor_distance, lamp_cells
from recon.simulate.style import RoomStyle

GROUT = 0.005
"""m; width of the joints between tiles."""


def paint_floor(surface: Surface, building: Building, style: RoomStyle, ppm: float, rng: np.random.Generator) -> Canvas:
    """A floor; its pattern runs along the room's longest wall."""
    canvas = Canvas(*surface.size, ppm, style.floor_colours[0])
    {"tiles": _tiles, "checker": _tiles, "planks": _planks, "carpet": _carpet}[style.floor](canvas, style, rng)
    canvas.noise(rng, 0.02, 0.8)
    if style.border and style.floor != "planks":
        distance = floor_distance(surface, building, canvas.image.shape[:2], False)
        strip = np.clip(0.5 + (0.06 - np.abs(distance - 0.26)) * ppm, 0, 1)[..., None]
        canvas.image += strip * (np.array([0.15, 0.16, 0.18], np.float32) - canvas.image)
    return canvas


def paint_ceiling(surface: Surface, style: RoomStyle, ppm: float, rng: np.random.Generator) -> tuple[Canvas, Image]:
    """A ceiling and the (H, W) light that it gives off itself."""
    canvas = Canvas(*surface.size, ppm, (0.88, 0.88, 0.86))
    canvas.noise(rng, 0.04 if style.panels else 0.01, 0.008)
    if style.panels:
        joint = np.maximum.outer(_joint(canvas.v, PANEL, 0.012, ppm), _joint(canvas.u, PANEL, 0.012, ppm))
        canvas.shade(1.0 - 0.25 * joint)
    glow = Canvas(*surface.size, ppm, (0.0, 0.0, 0.0))
    for u, v in lamp_cells(surface):
        canvas.frame(u, v, u + PANEL, v + PANEL, 0.03, (0.75, 0.75, 0.75))
        glow.rectangle(u + 0.03, v + 0.03, u + PANEL - 0.03, v + PANEL - 0.03, (1.0, 1.0, 1.0))
        glow.rectangle(u + PANEL / 2 - 0.005, v, u + PANEL / 2 + 0.005, v + PANEL, (0.3, 0.3, 0.3))
    return canvas, glow.image[..., 0]


def _joint(x: Array, period: float, width: float, ppm: float) -> Array:
    """(N,) 1 on the lines between cells of `period` m, 0 off them, antialiased."""
    away = np.abs((x / period + 0.5) % 1.0 - 0.5) * period
    return np.clip(0.5 + (width / 2 - away) * ppm, 0.0, min(1.0, width * ppm))


def _tiles(canvas: Canvas, style: RoomStyle, rng: np.random.Generator) -> None:
    size, (light, dark) = style.tile, np.array(style.floor_colours, np.float32)
    i, j = (canvas.u / size).astype(int), (canvas.v / size).astype(int)
    shades = 1.0 + 0.04 * rng.standard_normal((j.max() + 1, i.max() + 1), dtype=np.float32)
    if style.floor == "checker":
        odd = ((i[None, :] + j[:, None]) % 2)[..., None]
        canvas.image[:] = light + odd.astype(np.float32) * (dark - light)
    canvas.shade(shades[j][:, i])
    canvas.noise(rng, 0.03, 0.03)
    canvas.noise(rng, 0.04, 0.006)
    joint = np.maximum.outer(_joint(canvas.v, size, GROUT, canvas.ppm), _joint(canvas.u, size, GROUT, canvas.ppm))
    weight = (0.6 * joint).astype(np.float32)[..., None]
    canvas.image += weight * (0.6 * dark - canvas.image)


def _planks(canvas: Canvas, style: RoomStyle, rng: np.random.Generator) -> None:
    width, length = 0.14, 1.4
    row = (canvas.v / width).astype(int)
    shift = rng.uniform(0, length, row.max() + 1)
    along = (canvas.u[None, :] + shift[row][:, None]) / length
    table = 1.0 + 0.09 * rng.standard_normal((row.max() + 1, int(along.max()) + 1), dtype=np.float32)
    canvas.shade(table[row[:, None], along.astype(int)])
    canvas.shade(1.0 + 0.05 * smooth_noise(canvas.image.shape[:2], 0.012 * canvas.ppm, rng, 30.0))
    end = np.abs((along + 0.5) % 1.0 - 0.5) * length
    joint = np.maximum(
        np.clip(0.5 + (0.0015 - end) * canvas.ppm, 0, 1), _joint(canvas.v, width, 0.003, canvas.ppm)[:, None]
    )
    canvas.shade(1.0 - 0.5 * joint)


def _carpet(canvas: Canvas, style: RoomStyle, rng: np.random.Generator) -> None:
    light, dark = np.array(style.floor_colours, np.float32)
    i, j = (canvas.u / 0.5).astype(int), (canvas.v / 0.5).astype(int)
    odd = ((i[None, :] + j[:, None]) % 2)[..., None]
    canvas.image[:] = light + odd.astype(np.float32) * (dark - light)
    canvas.noise(rng, 0.10, 0.005)
    canvas.noise(rng, 0.05, 0.02)
    joint = np.maximum.outer(_joint(canvas.v, 0.5, 0.004, canvas.ppm), _joint(canvas.u, 0.5, 0.004, canvas.ppm))
    canvas.shade(1.0 - 0.2 * joint)
