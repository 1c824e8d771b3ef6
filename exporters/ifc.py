"""IFC4 and IFC2x3: the building as architects' programs exchange it; metres, map coordinates, Z up."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from recon.exporters.ifc_boundaries import add_boundaries
from recon.exporters.ifc_file import Entity, IfcFile
from recon.exporters.ifc_rooms import CEILING, SLAB, THINNEST, RoomPart, add_floor, add_objects, add_rooms
from recon.exporters.ifc_types import add_types
from recon.exporters.ifc_walls import Storeyed, WallPart, add_walls
from recon.exporters.options import DEFAULTS, ExportOptions
from recon.exporters.output import Output
from recon.model import Model
from recon.storeys import Building, Storey, headroom, one_storey


def write_ifc(model: Model, stem: str, options: ExportOptions = DEFAULTS) -> Output:
    """Project, site, building and one storey with walls, openings, rooms, floor, ceilings and furniture."""
    return write_building_ifc(one_storey(model), stem, options)


def write_building_ifc(building: Building, stem: str, options: ExportOptions = DEFAULTS) -> Output:
    """As `write_ifc`, with several storeys, each at its elevation."""
    ifc = IfcFile(options.ifc_schema, building.name)
    project = ifc.root("IfcProject", "project", building.name or "building")
    project.UnitsInContext = _units(ifc)
    project.RepresentationContexts = [ifc.model]
    notes = list(dict.fromkeys(note for storey in building.storeys for note in storey.model.notes))
    if notes:
        project.Description = "\n".join(notes)
    site = _place(ifc, "IfcSite", "site", "Site", None)
    house = _place(ifc, "IfcBuilding", "building", building.name or "building", site.ObjectPlacement)
    _aggregate(ifc, "project", project, [site])
    _aggregate(ifc, "site", site, [house])
    below = (None, *building.storeys[:-1])
    floors = [
        _storey(ifc, storey, house, SLAB if under is None else _slab(under, storey))
        for under, storey in zip(below, building.storeys, strict=True)
    ]
    _aggregate(ifc, "building", house, [floor.entity for floor in floors])
    walls = [wall for floor in floors for wall in floor.walls]
    add_types(ifc, project, walls, [room.space for floor in floors for room in floor.rooms])
    return Output(ifc.to_bytes())


def _place(ifc: IfcFile, kind: str, key: str, name: str, parent: Entity | None) -> Entity:
    place = ifc.placement(parent)
    return ifc.root(kind, key, name, ObjectPlacement=place, CompositionType="ELEMENT")


@dataclass(frozen=True)
class _Floor:
    entity: Entity
    walls: list[WallPart]
    rooms: list[RoomPart]


def _slab(below: Storey, above: Storey) -> float:
    """Thickness of a floor, m: no more than the ceilings under it leave."""
    left = headroom(below, above)
    return SLAB if left is None else min(SLAB, max(round(left - CEILING, 6), THINNEST))


def _storey(ifc: IfcFile, storey: Storey, house: Entity, slab: float) -> _Floor:
    place = ifc.placement(house.ObjectPlacement, (0.0, 0.0, storey.elevation))
    entity = ifc.root(
        "IfcBuildingStorey",
        storey.name,
        storey.name,
        ObjectPlacement=place,
        CompositionType="ELEMENT",
        Elevation=float(storey.elevation),
    )
    at, layout = Storeyed(ifc, entity, storey.name, slab), storey.model.layout
    walls = add_walls(at, layout)
    rooms = add_rooms(at, layout)
    slabs = add_floor(at, rooms, walls)
    things = [wall.entity for wall in walls]
    things += [o.filling for wall in walls for o in wall.openings if o.filling is not None]
    things += [*(slab.entity for slab in slabs), *(room.ceiling for room in rooms), *add_objects(at, layout)]
    _aggregate(ifc, f"{storey.name}/rooms", entity, [room.space for room in rooms])
    if things:
        kind = "IfcRelContainedInSpatialStructure"
        ifc.root(kind, storey.name, RelatedElements=things, RelatingStructure=entity)
    add_boundaries(at, layout, rooms, walls, slabs)
    return _Floor(entity, walls, rooms)


def _aggregate(ifc: IfcFile, key: str, whole: Entity, parts: Sequence[Entity]) -> None:
    if parts:
        ifc.root("IfcRelAggregates", key, RelatingObject=whole, RelatedObjects=list(parts))


def _units(ifc: IfcFile) -> Entity:
    units = [
        ifc.create("IfcSIUnit", UnitType=kind, Name=name)
        for kind, name in (
            ("LENGTHUNIT", "METRE"),
            ("AREAUNIT", "SQUARE_METRE"),
            ("VOLUMEUNIT", "CUBIC_METRE"),
            ("PLANEANGLEUNIT", "RADIAN"),
        )
    ]
    return ifc.create("IfcUnitAssignment", Units=units)
