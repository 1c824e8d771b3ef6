"""Where rooms touch walls, doors, floor and ceiling: first-level space boundaries of an IFC file."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from recon.exporters.ifc_file import Entity, IfcFile
from recon.exporters.ifc_rooms import SMALLEST, RoomPart, Slab
from recon.exporters.ifc_walls import Opening, Storeyed, WallPart
from recon.facing import rooms_before
from recon.geometry import Array
from recon.model import Layout, Wall
from recon.polygons import polygons

if TYPE_CHECKING:
    from shapely.geometry import Polygon

SHORTEST = 0.01
"""m: shorter stretches of a face bound no room."""


def add_boundaries(
    at: Storeyed, layout: Layout, rooms: Sequence[RoomPart], walls: Sequence[WallPart], slabs: Sequence[Slab]
) -> None:
    """A relation of every room to the faces of walls around it, to what fills or leaves open their openings, to floor
    and ceiling. Surfaces are in the coordinates of the space, which are those of its storey.
    """
    before, parts = rooms_before(layout), {part.room.id: part for part in rooms}
    stretches = _stretches(walls)
    for number, wall in enumerate(walls):
        sides = [(face, parts[room.id]) for face in wall.solid.faces
                 if (room := before[face.id]) is not None and room.id in parts]  # fmt: skip
        between = len({face.normal @ wall.solid.normal > 0 for face, _ in sides}) == 2
        for face, part in sides:
            key, inside = f"{at.key}/{part.room.id}/{number}/{face.id}", "INTERNAL" if between else "NOTDEFINED"
            low, high = stretches[number, face.id]
            whole = None
            if high - low >= SHORTEST:
                ends = face.start + np.array([[low], [high]]) * face.direction
                surface = _upright(at.ifc, ends, 0.0, part.height)
                whole = _bound(at.ifc, key, part.space, wall.entity, surface, inside)
            for opening in wall.openings:
                _opening(at.ifc, f"{key}/{opening.doorway.id}", part, opening, face, inside, whole)
    for part in rooms:
        for n, polygon in enumerate(polygons(part.polygon, SMALLEST)):
            key, inner = f"{at.key}/{part.room.id}/{n}", polygon.representative_point()
            slab = next((slab.entity for slab in slabs if slab.ground.contains(inner)), None)
            if slab is not None:
                _bound(at.ifc, f"{key}/floor", part.space, slab, _level(at.ifc, polygon, 0.0), "NOTDEFINED")
            lid = _level(at.ifc, polygon, part.height)
            _bound(at.ifc, f"{key}/ceiling", part.space, part.ceiling, lid, "NOTDEFINED")


def _stretches(walls: Sequence[WallPart]) -> dict[tuple[int, int], tuple[float, float]]:
    """By wall (index) and face (id), m from the face's start: the part of the face that is this wall's.

    The walls of a face share all of it; its ends, where the neighbour's body may stand, go to the first and the last.
    """
    by_face: dict[int, list[tuple[float, float, int, float]]] = {}
    for number, wall in enumerate(walls):
        for face in wall.solid.faces:
            along = (np.asarray(wall.solid.footprint.exterior.coords) - face.start) @ face.direction
            by_face.setdefault(face.id, []).append((float(along.min()), float(along.max()), number, face.length))
    out = {}
    for face_id, parts in by_face.items():
        parts.sort()
        cuts = [0.0, *(0.5 * (a[1] + b[0]) for a, b in pairwise(parts)), parts[0][3]]
        for (low, high), part in zip(pairwise(cuts), parts, strict=True):
            out[part[2], face_id] = low, high
    return out


def _opening(
    ifc: IfcFile, key: str, part: RoomPart, opening: Opening, face: Wall, inside: str, whole: Entity | None
) -> None:
    """An opening, where it is in this face; a passage is a virtual boundary. whole: the boundary that it lies in."""
    doorway = opening.doorway
    if part.room.id not in doorway.rooms:
        return
    along = np.sort((np.stack([doorway.start, doorway.end]) - face.start) @ face.direction)
    low, high = np.clip(along, 0.0, face.length)
    if high - low < SHORTEST:
        return
    ends = face.start + np.array([[low], [high]]) * face.direction
    surface = _upright(ifc, ends, max(doorway.bottom, 0.0), min(doorway.top, part.height))
    thing = opening.void if opening.closed is None else opening.closed
    kind = "VIRTUAL" if opening.closed is None else "PHYSICAL"
    _bound(ifc, key, part.space, thing, surface, inside, kind, whole)


def _bound(
    ifc: IfcFile,
    key: str,
    space: Entity,
    thing: Entity,
    surface: Entity,
    inside: str,
    kind: str = "PHYSICAL",
    whole: Entity | None = None,
) -> Entity:
    geometry = ifc.create("IfcConnectionSurfaceGeometry", SurfaceOnRelatingElement=surface)
    nameless = ifc.schema == "IFC2X3" and kind == "VIRTUAL"  # it allows no opening there
    more = {} if whole is None or ifc.schema == "IFC2X3" else {"ParentBoundary": whole}
    return ifc.root(
        "IfcRelSpaceBoundary1stLevel" if ifc.schema == "IFC4" else "IfcRelSpaceBoundary",
        key,
        "1stLevel",
        RelatingSpace=space,
        RelatedBuildingElement=None if nameless else thing,
        ConnectionGeometry=geometry,
        PhysicalOrVirtualBoundary=kind,
        InternalOrExternalBoundary=inside,
        **more,
    )


def _upright(ifc: IfcFile, ends: Array, bottom: float, top: float) -> Entity:
    """The rectangle over ends (2, 2), m."""
    line = ifc.polyline(ends)
    return ifc.create(
        "IfcSurfaceOfLinearExtrusion",
        SweptCurve=ifc.create("IfcArbitraryOpenProfileDef", ProfileType="CURVE", Curve=line),
        Position=ifc.level(bottom),
        ExtrudedDirection=ifc.up,
        Depth=round(float(top - bottom), 6),
    )


def _level(ifc: IfcFile, polygon: Polygon, height: float) -> Entity:
    """The polygon at a height, m."""
    outer, *inner = (
        ifc.polyline(np.asarray(ring.coords)[:-1], closed=True) for ring in (polygon.exterior, *polygon.interiors)
    )
    return ifc.create(
        "IfcCurveBoundedPlane",
        BasisSurface=ifc.shared("IfcPlane", round(height, 6), lambda: {"Position": ifc.level(height)}),
        OuterBoundary=outer,
        InnerBoundaries=inner,
    )
