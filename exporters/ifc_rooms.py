"""Rooms of an IFC file: spaces, ceilings, the floor slab, and what stands in them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from recon.exporters.ifc_file import Entity, Value, label
from recon.exporters.ifc_walls import Storeyed, WallPart
from recon.holes import room_height
from recon.model import FloorObject, Layout, Room
from recon.polygons import polygons

if TYPE_CHECKING:
    from shapely.geometry import Polygon
    from shapely.geometry.base import BaseGeometry

SLAB, CEILING = 0.2, 0.02
"""m, assumed thicknesses of the floor, where ceilings below leave room for it, and of what hangs below the next."""
THINNEST = 0.02
"""m, of floors where they leave none."""
TABLE = 0.75
"""m, assumed height of furniture where no image shows it."""
SMALLEST = 1e-4
"""m^2: smaller parts of rooms and floors are left out."""
SEAM = 0.005
"""m: gaps in the floor that are narrower than twice this are closed."""


@dataclass(frozen=True)
class RoomPart:
    """A room, its IfcSpace, and the IfcCovering over it. polygon: valid, its ground."""

    room: Room
    polygon: BaseGeometry
    height: float
    space: Entity
    ceiling: Entity


@dataclass(frozen=True)
class Slab:
    """A part of the floor that hangs together, and its IfcSlab."""

    ground: Polygon
    entity: Entity


def add_rooms(at: Storeyed, layout: Layout) -> list[RoomPart]:
    """IfcSpace and IfcCovering of every room that has an area, in the order of the layout."""
    import shapely

    out = []
    for room in layout.rooms:
        ground = shapely.make_valid(shapely.Polygon(room.polygon))
        parts = [shapely.orient_polygons(p) for p in polygons(ground, SMALLEST)]
        if parts:
            out.append(_room(at, layout, room, shapely.union_all(parts), parts))
    return out


def _room(at: Storeyed, layout: Layout, room: Room, ground: BaseGeometry, parts: list[Polygon]) -> RoomPart:
    ifc, key, height = at.ifc, f"{at.key}/room {room.id}", room_height(layout, room)
    measured = room.ceiling_height is not None or layout.ceiling_height is not None
    kind = {"PredefinedType": "SPACE"} if ifc.schema == "IFC4" else {"InteriorOrExteriorSpace": "INTERNAL"}
    foot = ifc.outline(parts)
    space = ifc.root(
        "IfcSpace",
        key,
        f"{room.id:03d}",
        LongName=label(room.name),
        ObjectPlacement=ifc.placement(at.storey.ObjectPlacement),
        Representation=ifc.shape([ifc.extrusion(part, 0.0, height) for part in parts], "space", [foot]),
        CompositionType="ELEMENT",
        **kind,
    )
    sigma = room.sigma_ceiling if room.ceiling_height is not None else layout.sigma_ceiling
    values: dict[str, Value] = {"CeilingSource": ("IfcLabel", "image" if measured else "assumed")}
    if sigma is not None and np.isfinite(sigma):
        values["SigmaCeiling"] = ("IfcLengthMeasure", round(float(sigma), 6))
    ifc.properties(key, [space], "Recon_Measurement", values)
    area, around = float(ground.area), float(ground.length)
    sizes = {
        "Height": ("Length", height),
        "FinishCeilingHeight": ("Length", height),
        "GrossPerimeter": ("Length", around),
        "NetPerimeter": ("Length", around),
        "GrossFloorArea": ("Area", area),
        "NetFloorArea": ("Area", area),
        "GrossCeilingArea": ("Area", area),
        "NetCeilingArea": ("Area", area),
        "GrossWallArea": ("Area", around * height),
        "GrossVolume": ("Volume", area * height),
        "NetVolume": ("Volume", area * height),
    }
    ifc.quantities(key, space, "Qto_SpaceBaseQuantities", sizes)
    return RoomPart(room, ground, height, space, _ceiling(at, key, room, parts, height, space))


def _ceiling(at: Storeyed, key: str, room: Room, parts: list[Polygon], height: float, space: Entity) -> Entity:
    ifc = at.ifc
    ceiling = ifc.root(
        "IfcCovering",
        key,
        f"ceiling_{room.id:03d}",
        ObjectPlacement=ifc.placement(at.storey.ObjectPlacement),
        Representation=ifc.shape([ifc.extrusion(part, height, CEILING) for part in parts], "ceiling"),
        PredefinedType="CEILING",
    )
    covered = "RelatedSpace" if ifc.schema == "IFC2X3" else "RelatingSpace"
    ifc.root("IfcRelCoversSpaces", key, **{covered: space}, RelatedCoverings=[ceiling])
    return ceiling


def add_floor(at: Storeyed, rooms: Sequence[RoomPart], walls: Sequence[WallPart]) -> list[Slab]:
    """IfcSlab under rooms and walls, its upper side at the floor; one for each part that hangs together."""
    import shapely

    ifc = at.ifc
    ground = _closed(shapely.union_all([room.polygon for room in rooms] + [wall.solid.footprint for wall in walls]))
    slabs = []
    for n, part in enumerate(sorted(polygons(ground, SMALLEST), key=lambda p: (-round(p.area, 6), p.bounds))):
        key = f"{at.key}/floor {n}"
        slab = ifc.root(
            "IfcSlab",
            key,
            f"floor_{n:03d}",
            ObjectPlacement=ifc.placement(at.storey.ObjectPlacement),
            Representation=ifc.shape([ifc.extrusion(shapely.orient_polygons(part), -at.slab, at.slab)], "floor"),
            PredefinedType="FLOOR",
        )
        ifc.properties(key, [slab], "Recon_Measurement", {"ThicknessSource": ("IfcLabel", "assumed")})
        sizes = {
            "Width": ("Length", at.slab),
            "Perimeter": ("Length", float(part.length)),
            "GrossArea": ("Area", float(part.area)),
            "NetArea": ("Area", float(part.area)),
            "GrossVolume": ("Volume", float(part.area) * at.slab),
        }
        ifc.quantities(key, slab, "Qto_SlabBaseQuantities", sizes)
        slabs.append(Slab(part, slab))
    return slabs


def _closed(ground: BaseGeometry) -> BaseGeometry:
    """Without gaps and holes narrower than twice SEAM; holes one by one, as a buffer of thousands takes minutes."""
    import shapely

    filled = shapely.union_all([shapely.Polygon(part.exterior) for part in polygons(ground)])
    holes = np.array(polygons(shapely.difference(filled, ground)), dtype=object)
    wide = shapely.buffer(shapely.buffer(holes, -SEAM, join_style="mitre"), SEAM, join_style="mitre")
    outer = filled.buffer(SEAM, join_style="mitre").buffer(-SEAM, join_style="mitre")
    return shapely.difference(outer, shapely.union_all(wide))


def add_objects(at: Storeyed, layout: Layout) -> list[Entity]:
    """Furniture: a prism as high as images show it, else as high as a table, pale."""
    return [thing for item in layout.objects if (thing := _object(at, item)) is not None]


def _object(at: Storeyed, item: FloorObject) -> Entity | None:
    import shapely

    ifc, key = at.ifc, f"{at.key}/object {item.id}"
    parts = polygons(shapely.make_valid(shapely.Polygon(item.footprint)), SMALLEST)
    if not parts:
        return None
    foot = ifc.outline(parts)
    known = item.top is not None and item.top > item.bottom
    bottom, top = (item.bottom, float(item.top or 0.0)) if known else (0.0, TABLE)
    solids = [ifc.extrusion(shapely.orient_polygons(part), bottom, top - bottom) for part in parts]
    shape = ifc.shape(solids, "object" if known else "assumed object", [foot])
    thing = ifc.root(
        "IfcFurniture" if ifc.schema == "IFC4" else "IfcFurnishingElement",
        key,
        f"object_{item.id:03d}",
        ObjectPlacement=ifc.placement(at.storey.ObjectPlacement),
        Representation=shape,
    )
    source = ("IfcLabel", "image" if known else "assumed")
    ifc.properties(key, [thing], "Recon_Measurement", {"HeightSource": source})
    return thing
