"""From wall lines and rays to walls, rooms, openings and objects."""

from __future__ import annotations

import numpy as np
import shapely

from recon.config import LayoutConfig
from recon.geometry import Array
from recon.graph.estimate import MapEstimate
from recon.layout.cells import Cells, cut_plane
from recon.layout.evidence import FreeSpace, free_space, scan_rays
from recon.layout.frontier import frontier_lines
from recon.layout.labelling import free_areas, label_cells, supports
from recon.layout.line import PlanLine, merged_lines
from recon.layout.objects import floor_objects
from recon.layout.openings import find_openings
from recon.layout.outline import sides, spurs, walls_of
from recon.layout.recess import absorb_steps
from recon.layout.rooms import Region, regions, room_names, simple_polygons
from recon.model import Layout, Room, Wall
from recon.sequence.sequence import Scans

SHORTEST_WALL = 0.5
"""m of support; lines with less are clutter."""


def build_layout(estimate: MapEstimate, scans: Scans, config: LayoutConfig) -> Layout:
    """The plan of what a drive saw, in the map frame, without a ceiling height (`measure_ceiling` finds it).

    The plane is cut into cells by the wall lines and by the rim of the space that rays passed; each cell is inside or
    outside by one energy (`label_cells`); the outline of the inside gives rooms and walls. Where no wall was seen the
    outline is closed all the same, by walls of source "inferred" with wide sigmas.
    """
    starts, ends = scan_rays(estimate.trajectory, scans)
    space = free_space(estimate.trajectory, starts, ends)
    lines = [line for line in absorb_steps(merged_lines(estimate.walls)) if _is_wall(line)]
    lines += frontier_lines(space, lines)
    cells = cut_plane(lines, *_bounds(space, lines))
    support = supports(cells, lines)
    inside = label_cells(cells, lines, free_areas(cells, space), support)
    spans = cells.spans(lines)
    found, parting = regions(cells, inside, support[:, 0], spans, estimate.trajectory.poses[:, :2])
    walls: list[Wall] = []
    for region in found:
        for side in [s for ring in sides(cells, region) for s in ring] + spurs(cells, region, parting, spans):
            walls += walls_of(side, lines, len(walls))
    rooms = _rooms(found, cells)
    openings = find_openings(walls, ends, space)
    objects = floor_objects(walls, [shapely.Polygon(room.polygon) for room in rooms], space)
    return Layout(
        tuple(walls),
        tuple(rooms),
        tuple(openings),
        tuple(objects),
        default_ceiling_height=config.default_ceiling_height,
    )


def _is_wall(line: PlanLine) -> bool:
    return line.source == "image" or line.supported_length >= SHORTEST_WALL


def _bounds(space: FreeSpace, lines: list[PlanLine]) -> tuple[Array, Array]:
    """Lower and upper corner (2,) m of a box around the grid and every stretch of wall."""
    low, high = space.bounds
    ends = [line.point(line.support.ravel()) for line in lines if len(line.support)]
    everything = np.concatenate([np.stack([low, high]), *ends])
    return everything.min(axis=0) - 1.0, everything.max(axis=0) + 1.0


def _rooms(found: list[Region], cells: Cells) -> list[Room]:
    """Simple, disjoint, counter-clockwise polygons, without corners on straight sides."""
    polygons = []
    for region in found:
        rings = [np.array([side.start for side in ring]) for ring in sides(cells, region)]
        polygons += simple_polygons(shapely.Polygon(rings[0], rings[1:]))
    names = room_names(polygons)
    rings = [np.asarray(shapely.orient_polygons(polygon).exterior.coords)[:-1] for polygon in polygons]
    return [Room(i, name, ring) for i, (name, ring) in enumerate(zip(names, rings, strict=True))]
