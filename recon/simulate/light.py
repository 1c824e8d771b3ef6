"""Lamps, and how bright surfaces are: direct light of the room's lamps, ambient light, darker edges."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array
from recon.simulate.building import UP, Building, Surface
from recon.simulate.canvas import Image
from recon.simulate.check import footprint

PANEL = 0.6
"""m; the ceiling's grid, of which a lamp fills one or two cells."""
AMBIENT = 0.38
POWER = 2.6
"""What a lamp gives at 1 m straight below."""


def lamp_cells(ceiling: Surface) -> Array:
    """Lower left corners (n, 2), u and v m, of the lamps' cells in a ceiling: every fourth cell that is all ceiling."""
    import shapely

    triangles = [shapely.Polygon(ceiling.vertices[t]) for t in ceiling.triangles]
    shape = shapely.union_all(triangles).buffer(1e-6)
    columns, rows = (int(extent / PANEL) for extent in ceiling.size)
    cells = np.array([(i, j) for i in range(columns + 1) for j in range(rows + 1)])
    boxes = shapely.box(*(cells * PANEL).T, *((cells + 1) * PANEL).T)
    inside = shapely.covers(shape, boxes)
    regular = inside & (cells[:, 0] % 4 == 1) & (cells[:, 1] % 4 == 1)
    if not regular.any():
        centres = shapely.centroid(boxes)
        depth = np.where(shapely.covers(shape, centres), shapely.distance(shape.boundary, centres), -1.0)
        regular = np.arange(len(cells)) == int(depth.argmax())
    return np.asarray(cells[regular] * PANEL)


def lamps(building: Building) -> list[Array]:
    """Lamp positions (n, 3), plan frame, m, of every room."""
    out: list[Array] = [np.zeros((0, 3))] * len(building.plan.rooms)
    for surface in building.surfaces:
        if surface.kind == "ceiling":
            out[surface.room] = surface.at(lamp_cells(surface) + PANEL / 2)
    return out


def irradiance(points: Array, normal: Array, room_lamps: Array) -> Array:
    """Brightness (...) at points (..., 3) with this normal; shadows are left out."""
    total = np.full(points.shape[:-1], AMBIENT)
    for lamp in room_lamps:
        away = lamp - 0.02 * UP - points
        square = (away**2).sum(axis=-1) + 0.15
        facing = np.clip(away @ normal, 0.0, None) * np.clip(away[..., 2], 0.0, None) / square
        total += POWER * facing / square
    return total


def light_map(surface: Surface, building: Building, room_lamps: Array, shape: tuple[int, int]) -> Image:
    """(H, W) brightness of a surface's texels."""
    if surface.kind == "ceiling":
        light = np.full((2, 2), AMBIENT + 0.5)
    else:
        width, height = surface.size
        columns, rows = (max(2, int(np.ceil(extent / 0.15))) for extent in (width, height))
        u, v = np.meshgrid((np.arange(columns) + 0.5) / columns * width, (rows - np.arange(rows) - 0.5) / rows * height)
        light = irradiance(surface.at(np.stack([u, v], axis=-1)), surface.normal, room_lamps)
    out = cv2.resize(light.astype(np.float32), (shape[1], shape[0]), interpolation=cv2.INTER_LINEAR)
    return np.asarray(out * _occlusion(surface, building, shape), np.float32)


def floor_distance(surface: Surface, building: Building, shape: tuple[int, int], objects: bool) -> Image:
    """(H, W) m from each texel of a floor or ceiling to the nearest wall (and object on the floor, if asked)."""
    coarse = max(1, round(shape[0] / max(surface.size[1], 1e-6) / 25))
    rows, columns = max(2, shape[0] // coarse), max(2, shape[1] // coarse)
    scale = np.array([columns, -rows]) / np.array(surface.size)
    mask = np.zeros((rows + 2, columns + 2), np.uint8)
    for triangle in surface.triangles:
        _fill(mask, surface.vertices[triangle] * scale + [0, rows], 1)
    mask = np.pad(cv2.morphologyEx(mask, cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))[1:-1, 1:-1], 1)
    for item in building.objects if objects else ():
        if item.bottom < 0.2:
            flat = footprint(item) - surface.origin[:2]
            _fill(mask, flat @ np.stack([surface.axis_u[:2], surface.axis_v[:2]], axis=1) * scale + [0, rows], 0)
    distance = cv2.distanceTransform(mask, cv2.DIST_L2, 5)[1:-1, 1:-1] * (surface.size[1] / rows)
    return np.asarray(cv2.resize(distance, (shape[1], shape[0]), interpolation=cv2.INTER_LINEAR), np.float32)


def _fill(mask: NDArray[np.uint8], pixels: Array, value: int) -> None:
    cv2.fillConvexPoly(mask, np.round((pixels + 0.5) * 16).astype(np.int32), value, shift=4)


def _occlusion(surface: Surface, building: Building, shape: tuple[int, int]) -> Image:
    """(H, W) factor below 1 near the edges where surfaces meet."""
    if surface.kind in ("floor", "ceiling"):
        distance = floor_distance(surface, building, shape, surface.kind == "floor")
        return np.asarray(1.0 - 0.35 * np.exp(-distance / 0.18), np.float32)
    if surface.kind in ("glass", "reveal") or surface.axis_v[2] != 1.0:
        return np.full(shape, 0.7 if surface.kind == "reveal" else 1.0, np.float32)
    width, height = surface.size
    u, v = (np.arange(shape[1]) + 0.5) / shape[1] * width, (shape[0] - np.arange(shape[0]) - 0.5) / shape[0] * height
    rows = 1.0 - 0.3 * np.exp(-(v + surface.origin[2]) / 0.15)
    columns = np.ones_like(u)
    if surface.kind == "wall":
        rows *= 1.0 - 0.25 * np.exp(-(height - v) / 0.15)
        columns = 1.0 - 0.3 * np.exp(-np.minimum(u, width - u) / 0.2)
    return np.outer(rows, columns).astype(np.float32)
