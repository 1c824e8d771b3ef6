"""The plan without furniture that images told from walls."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
import shapely
from numpy.typing import NDArray

from recon.furniture import PARALLEL, Furniture
from recon.geometry import Array
from recon.layout.evidence import FreeSpace
from recon.layout.line import PlanLine, subtract, union
from recon.model import FloorObject

AROUND = 0.12
"""m around a footprint within which returns are the thing's."""
AGAINST = 0.15
"""m from the back of a footprint to the line of the wall behind it."""
SAMPLE = 0.02
"""m"""


def without_furniture(lines: Sequence[PlanLine], things: Sequence[Furniture]) -> list[PlanLine]:
    """Lines without the stretches that are fronts and sides of things; what is behind these counts as hidden."""
    out = list(lines)
    for thing in things:
        for k, line in enumerate(out):
            if line.source != "lidar":
                continue
            line = replace(line, front=_without(line, line.front, thing), back=_without(line, line.back, thing))
            out[k] = line
            if thing.island:
                continue
            behind = thing.footprint[2:]
            if abs(line.normal @ thing.normal) > PARALLEL and np.abs(line.offset(behind)).max() < AGAINST:
                hidden = np.concatenate([line.hidden, np.sort(line.along(behind))[None]])
                out[k] = replace(line, hidden=union(hidden))
    return [line for line in out if len(line.front) or len(line.back)]


def _without(line: PlanLine, stretches: Array, thing: Furniture) -> Array:
    for low, high in stretches:
        edges = np.linspace(low, high, max(2, round((high - low) / SAMPLE) + 1))
        owned = thing.owns(line.point((edges[:-1] + edges[1:]) / 2))
        stretches = subtract(stretches, union(np.stack([edges[:-1], edges[1:]], axis=1)[owned], SAMPLE / 2))
    return stretches


def filled(space: FreeSpace, things: Sequence[Furniture]) -> NDArray[np.bool_]:
    """(rows, columns) cells that things stand on: the room goes on above them."""
    mask = np.zeros(space.free.shape, np.uint8)
    for thing in things:
        corners = np.round((thing.footprint - space.origin) / space.resolution - 0.5).astype(np.int32)
        cv2.fillPoly(mask, [corners[:, None]], 1)
    return np.asarray(mask > 0)


def with_furniture(objects: Sequence[FloorObject], things: Sequence[Furniture]) -> list[FloorObject]:
    """Objects, those that are parts of things replaced by these; ids are counted anew."""
    grown = shapely.union_all([thing.polygon.buffer(AROUND, join_style="mitre") for thing in things])
    kept = [item for item in objects if not grown.contains(shapely.Polygon(item.footprint).centroid)]
    kept += [FloorObject(0, thing.clear_footprint) for thing in things]
    return [replace(item, id=k) for k, item in enumerate(kept)]
