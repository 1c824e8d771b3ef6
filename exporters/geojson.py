"""GeoJSON: rooms, walls, openings and objects for maps, in local metres."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from recon.doorways import Doorway, doorways
from recon.exporters.options import DEFAULTS, ExportOptions
from recon.exporters.output import Output
from recon.geometry import Array
from recon.holes import room_height
from recon.model import FloorObject, Layout, Model, Room
from recon.polygons import polygons
from recon.solids import WallSolid, wall_solids
from recon.storeys import Building, one_storey

if TYPE_CHECKING:
    from shapely.geometry import Polygon

NOTE = (
    "Coordinates are metres in a local frame, not longitude and latitude: RFC 7946 (section 4) allows this by prior "
    "arrangement only. x, y are those of layout.json."
)
Feature = dict[str, Any]


def write_geojson(model: Model, stem: str, options: ExportOptions = DEFAULTS) -> Output:
    """A FeatureCollection; `properties.kind` is room, wall, door, passage, window or object, lengths are in m."""
    return write_building_geojson(one_storey(model), stem, options)


def write_building_geojson(building: Building, stem: str, options: ExportOptions = DEFAULTS) -> Output:
    """As `write_geojson`; several storeys also say `storey` and `elevation` (m) of every feature."""
    features: list[Feature] = []
    for storey in building.storeys:
        for feature in _features(storey.model.layout):
            if len(building.storeys) > 1:
                feature["properties"] |= {"storey": storey.name, "elevation": storey.elevation}
                feature["id"] = f"{storey.name}/{feature['id']}"
            features.append(feature)
    notes = dict.fromkeys(note for storey in building.storeys for note in storey.model.notes)
    head = {"type": "FeatureCollection", "name": building.name, "coordinates": "local metres", "about": [NOTE, *notes]}
    lines = ",\n".join(json.dumps(feature, ensure_ascii=False, allow_nan=False) for feature in features)
    text = json.dumps(head, ensure_ascii=False)[:-1] + f', "features": [\n{lines}\n]}}\n'
    return Output(text.encode("utf-8", "replace"))


def _features(layout: Layout) -> Iterator[Feature]:
    for room in layout.rooms:
        yield _room(layout, room)
    for number, solid in enumerate(wall_solids(layout)):
        yield _wall(number, solid)
    for doorway in doorways(layout):
        yield _doorway(doorway)
    for thing in layout.objects:
        yield _object(thing)


def _feature(name: str, geometry: dict[str, Any] | None, kind: str, properties: dict[str, Any]) -> Feature:
    known = {key: _rounded(value) for key, value in properties.items()}
    return {"type": "Feature", "id": name, "geometry": geometry, "properties": {"kind": kind, **known}}


def _rounded(value: Any) -> Any:
    if not isinstance(value, float):
        return value
    return round(value, 6) + 0.0 if math.isfinite(value) else None


def _ring(points: Array) -> list[list[float]]:
    """Closed, as RFC 7946 wants it."""
    ring = [[round(float(v), 6) + 0.0 for v in p] for p in points]
    return ring if ring[0] == ring[-1] else [*ring, ring[0]]


def _ground(points: Array) -> dict[str, Any] | None:
    """The polygon through points (n, 2), as it is where it is simple, else in its parts; None without an area."""
    import shapely

    outline = shapely.Polygon(points)
    if outline.is_valid and outline.area > 0:
        return _polygons([outline])
    return _polygons(polygons(shapely.make_valid(outline)))


def _polygons(parts: Sequence[Polygon]) -> dict[str, Any] | None:
    """Outer rings counter-clockwise, holes clockwise, as RFC 7946 wants it."""
    import shapely

    if not parts:
        return None
    turned = [shapely.orient_polygons(part) for part in parts]
    rings = [[_ring(np.asarray(r.coords)[:-1]) for r in (part.exterior, *part.interiors)] for part in turned]
    if len(rings) == 1:
        return {"type": "Polygon", "coordinates": rings[0]}
    return {"type": "MultiPolygon", "coordinates": rings}


def _room(layout: Layout, room: Room) -> Feature:
    properties = {
        "name": room.name,
        "area": float(room.area),
        "perimeter": float(room.perimeter),
        "height": float(room_height(layout, room)),
        "height_source": "assumed" if room.ceiling_height is None and layout.ceiling_height is None else "image",
        "sigma_height": room.sigma_ceiling if room.ceiling_height is not None else layout.sigma_ceiling,
    }
    return _feature(f"room_{room.id:03d}", _ground(room.polygon), "room", properties)


def _wall(number: int, solid: WallSolid) -> Feature:
    faces = solid.faces
    properties = {
        "faces": [face.id for face in faces],
        "length": solid.length,
        "thickness": solid.thickness,
        "thickness_source": "none" if solid.flat else "measured" if solid.seen else "assumed",
        "height": float(solid.height),
        "source": ", ".join(dict.fromkeys(face.source for face in faces)),
        "observations": sum(int(face.observations) for face in faces),
        "sigma_offset": float(max(face.sigma_offset for face in faces)),
        "sigma_angle": float(max(face.sigma_angle for face in faces)),
    }
    return _feature(f"wall_{number:03d}", _polygons([solid.footprint]), "wall", properties)


def _doorway(doorway: Doorway) -> Feature:
    line = {"type": "LineString", "coordinates": _ring(np.stack([doorway.start, doorway.end]))[:2]}
    properties = {
        "rooms": list(doorway.rooms),
        "width": doorway.width,
        "bottom": float(doorway.bottom),
        "top": float(doorway.top),
        "sigma_top": doorway.sigma_top,
        "open": doorway.open,
    }
    return _feature(f"{doorway.type}_{doorway.id:03d}", line, doorway.type, properties)


def _object(thing: FloorObject) -> Feature:
    properties = {"bottom": float(thing.bottom), "top": thing.top}
    return _feature(f"object_{thing.id:03d}", _ground(thing.footprint), "object", properties)
