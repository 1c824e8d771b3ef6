"""From wall lines and rays to walls, rooms, openings and objects."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import NDArray

from recon.config import LayoutConfig
from recon.furniture import Furniture
from recon.geometry import Array
from recon.graph.estimate import MapEstimate
from recon.layout.blocks import without_blocks
from recon.layout.cells import Cells, cut_plane
from recon.layout.clutter import is_sure, with_returns, without_clutter
from recon.layout.depths import with_depths
from recon.layout.dimensions import with_dimensions
from recon.layout.evidence import FreeSpace, free_space, ray_times, scan_rays
from recon.layout.frontier import frontier_lines
from recon.layout.furniture import filled, with_furniture, without_furniture
from recon.layout.gates import with_gates
from recon.layout.jambs import with_jambs
from recon.layout.labelling import areas, label_cells, supports, trust
from recon.layout.leaves import without_leaves
from recon.layout.line import PlanLine, merged_lines
from recon.layout.moving import stays
from recon.layout.objects import floor_objects
from recon.layout.openings import find_openings
from recon.layout.outline import Side, sides, spurs, walls_of
from recon.layout.piers import with_piers
from recon.layout.polygons import room_rings
from recon.layout.recess import absorb_steps
from recon.layout.returns import Returns
from recon.layout.rooms import regions, room_names
from recon.layout.sight import within_sight
from recon.layout.simplify import simplified
from recon.layout.surface import with_surfaces
from recon.layout.thickness import with_thickness, without_openings
from recon.layout.uncertainty import with_sigmas
from recon.layout.visited import visited_space
from recon.layout.windows import find_windows
from recon.model import Layout, Room, Wall
from recon.sequence.sequence import Scans


def build_layout(
    estimate: MapEstimate, scans: Scans, config: LayoutConfig, furniture: Sequence[Furniture] = ()
) -> Layout:
    """The plan of what a drive saw, in the map frame, without a ceiling height (`measure_ceiling` finds it).

    The plane is cut into cells by the wall lines and by the rim of the space that rays passed; each cell is inside or
    outside by one energy (`label_cells`); the outline of the inside gives rooms and walls. Where no wall was seen the
    outline is closed all the same, by walls of source "inferred" with wide sigmas. furniture: what is known to be no
    wall (`furniture.suspects` that images clear).
    """
    path = estimate.trajectory.poses[:, :2]
    starts, ends = scan_rays(estimate.trajectory, scans)
    still = stays(starts, ends, ray_times(scans))
    space = free_space(estimate.trajectory, starts, ends, still)
    lines = with_sigmas(merged_lines(estimate.walls), estimate)
    lines = within_sight(with_returns(lines, space), path)
    lines = without_furniture(without_blocks(without_leaves(lines, space), space), furniture)
    lines = without_clutter(absorb_steps(lines), space)
    returns = Returns(starts[still], ends[still])
    lines = with_piers(with_surfaces(lines, returns), returns, space)
    visited = visited_space(space, [line for line in lines if is_sure(line)], path) | filled(space, furniture)
    lines = with_gates(lines, space)
    lines += frontier_lines(space, lines)
    cells = cut_plane(lines, *_bounds(space, lines))
    walls, owner, rooms = _walls_and_rooms(cells, lines, space, visited, path)
    openings = find_openings(walls, returns, space, path)
    walls = with_thickness(walls)
    openings += find_windows(walls, rooms, openings, estimate.trajectory, scans)
    openings = with_depths(with_jambs(openings, walls, estimate.trajectory, scans), walls, returns)
    walls = without_openings(walls, openings)
    objects = floor_objects(walls, [shapely.Polygon(room.polygon) for room in rooms], space)
    objects = with_furniture(objects, furniture)
    layout = Layout(
        tuple(walls),
        tuple(rooms),
        tuple(openings),
        tuple(objects),
        default_ceiling_height=config.default_ceiling_height,
    )
    return with_dimensions(layout, owner, lines, estimate)


def _walls_and_rooms(
    cells: Cells, lines: list[PlanLine], space: FreeSpace, visited: NDArray[np.bool_], path: Array
) -> tuple[list[Wall], list[int], list[Room]]:
    """Cells labelled and joined to rooms, and the outlines of these as walls, with the line of each, -1 for none."""
    support, spans = supports(cells, lines), cells.spans(lines)
    evidence = support.copy()
    evidence[:, 1:3] *= trust(cells, lines, space, visited)
    reached, glanced = areas(cells, space, visited, space.free & ~visited)
    inside = label_cells(cells, lines, reached, glanced, evidence)
    found, parting = regions(cells, lines, inside, support[:, 0], spans, glanced > reached, path, space)
    in_room = np.isin(np.arange(len(cells.polygons)), [cell for region in found for cell in region.cells])
    rings = [sides(cells, region, support[:, 0], in_room) for region in found]
    outlines = simplified(rings, [region.polygon for region in found], space)
    walls: list[Wall] = []
    owner: list[int] = []
    for region, outline in zip(found, outlines, strict=True):
        for side in [side for ring in outline for side in ring] + spurs(cells, region, parting, spans, lines):
            walls += walls_of(side, lines, space, len(walls))
            owner += [side.line] * (len(walls) - len(owner))
    return walls, owner, _rooms(outlines)


def _bounds(space: FreeSpace, lines: list[PlanLine]) -> tuple[Array, Array]:
    """Lower and upper corner (2,) m of a box around the grid and every stretch of wall."""
    low, high = space.bounds
    ends = [line.point(line.support.ravel()) for line in lines if len(line.support)]
    everything = np.concatenate([np.stack([low, high]), *ends])
    return everything.min(axis=0) - 1.0, everything.max(axis=0) + 1.0


def _rooms(outlines: list[list[list[Side]]]) -> list[Room]:
    """Rooms with names, from the rings of sides (the outer one first) of every region."""
    corners = [[np.array([side.start for side in ring]) for ring in outline] for outline in outlines]
    rings = room_rings([shapely.Polygon(outer, holes) for outer, *holes in corners])
    names = room_names([shapely.Polygon(ring) for ring in rings])
    return [Room(i, name, ring) for i, (name, ring) in enumerate(zip(names, rings, strict=True))]
