"""Walls of an IFC file, and the doors, windows and passages in them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from recon.doorways import Doorway, doorways
from recon.exporters.ifc_file import Entity, IfcFile, Value
from recon.geometry import Array
from recon.model import Layout
from recon.solids import WallSolid, wall_solids

if TYPE_CHECKING:
    from shapely.geometry import Polygon

MARGIN = 0.01
"""m of wall left around an opening (but at the floor), and that its void reaches out of both faces."""
LEAF = {"door": 0.04, "window": 0.02}
"""m, assumed thickness of leaves and panes."""
NARROWEST = 0.05
"""m: narrower or lower openings are not cut."""


@dataclass(frozen=True)
class Storeyed:
    """Where things go: the file, the IfcBuildingStorey, and the text that tells its ids from other storeys'.

    slab: m, thickness of its floor.
    """

    ifc: IfcFile
    storey: Entity
    key: str
    slab: float


@dataclass(frozen=True)
class Opening:
    """An opening cut in one wall: the void, what fills it, its area (m^2) and volume (m^3).

    filling: None for passages, and where the way goes on through a second wall. closed: what fills it in either.
    """

    doorway: Doorway
    void: Entity
    filling: Entity | None
    closed: Entity | None
    area: float
    volume: float


@dataclass(frozen=True)
class WallPart:
    """A physical wall and its IfcWall."""

    solid: WallSolid
    entity: Entity
    openings: tuple[Opening, ...]


def add_walls(at: Storeyed, layout: Layout) -> list[WallPart]:
    """IfcWall of every physical wall, with its openings cut and filled."""
    solids = wall_solids(layout)
    by_face: dict[int, list[int]] = {}
    for n, solid in enumerate(solids):
        for face in solid.faces:
            by_face.setdefault(face.id, []).append(n)
    cuts: list[list[_Cut]] = [[] for _ in solids]
    for doorway in doorways(layout):
        for n, cut in _cuts(solids, by_face, doorway):
            if not any(cut.overlaps(other) for other in cuts[n]):
                cuts[n].append(cut)
    leaves: dict[int, Entity | None] = {}
    return [_wall(at, n, solid, mine, leaves) for n, (solid, mine) in enumerate(zip(solids, cuts, strict=True))]


def _cuts(solids: Sequence[WallSolid], by_face: dict[int, list[int]], doorway: Doorway) -> Iterator[tuple[int, _Cut]]:
    """The walls (index) that a doorway goes through: that of either side, which is one but where faces form a wedge."""
    done: set[int] = set()
    for opening in doorway.openings:
        mine = by_face.get(opening.wall, [])
        found = [(cut.low - cut.high, n, cut) for n in mine if (cut := _cut(solids[n], doorway)) is not None]
        if found and not done.intersection(mine):
            _, n, cut = min(found, key=lambda f: f[:2])
            done.add(n)
            yield n, cut


@dataclass(frozen=True)
class _Cut:
    """Where a doorway goes through a wall: from low to high m along its middle line, bottom to top above the floor."""

    doorway: Doorway
    low: float
    high: float
    bottom: float
    top: float

    def overlaps(self, other: _Cut) -> bool:
        """Whether the two have more than an edge in common, or nearly."""
        beside = min(self.high, other.high) - max(self.low, other.low)
        return beside > -MARGIN and min(self.top, other.top) - max(self.bottom, other.bottom) > -MARGIN


def _cut(solid: WallSolid, doorway: Doorway) -> _Cut | None:
    """The part of a doorway strictly inside a wall; None where that is too small."""
    low, high = sorted(float((p - solid.start) @ solid.direction) for p in (doorway.start, doorway.end))
    low, high = max(low, MARGIN), min(high, solid.length - MARGIN)
    bottom, top = max(doorway.bottom, 0.0), min(doorway.top, solid.height - MARGIN)
    if min(high - low, top - bottom) < NARROWEST:
        return None
    return _Cut(doorway, low, high, bottom, top)


def _local(solid: WallSolid, polygon: Polygon) -> Polygon:
    """A polygon of the map in the wall's frame: x along its middle line from its start."""
    import shapely

    d = solid.direction
    turn = np.array([[d[0], -d[1]], [d[1], d[0]]])
    moved: Polygon = shapely.transform(polygon, lambda xy: (xy - solid.start) @ turn)
    return moved


def _wall(at: Storeyed, number: int, solid: WallSolid, cuts: list[_Cut], leaves: dict[int, Entity | None]) -> WallPart:
    """leaves: what fills doorways, by id; added to."""
    ifc, key = at.ifc, f"{at.key}/wall {number}"
    footprint = _local(solid, solid.footprint)
    axis = ifc.polyline([(0.0, 0.0), (solid.length, 0.0)])
    line = ifc.representation(ifc.axis, "Axis", "Curve2D", [axis])
    body = ifc.extrusion(footprint, 0.0, solid.height)
    place = ifc.placement(at.storey.ObjectPlacement, (*solid.start, 0.0), solid.direction)
    wall = ifc.root(
        "IfcWall" if ifc.schema == "IFC4" else "IfcWallStandardCase",
        key,
        " ".join(f"wall_{face.id:03d}" for face in solid.faces),
        ObjectPlacement=place,
        Representation=ifc.shape([body], "inferred wall" if inferred(solid) else "wall", [line]),
        Tag=f"{number:03d}",
        **({"PredefinedType": "SOLIDWALL"} if ifc.schema == "IFC4" and not inferred(solid) else {}),
    )
    openings = tuple(_opening(at, solid, (wall, place), cut, footprint, leaves) for cut in cuts)
    ifc.properties(key, [wall], "Recon_Measurement", _known(solid))
    ifc.quantities(key, wall, "Qto_WallBaseQuantities", _sizes(solid, openings))
    return WallPart(solid, wall, openings)


def inferred(solid: WallSolid) -> bool:
    """Whether nobody saw any of a wall's faces."""
    return all(face.source == "inferred" for face in solid.faces)


def _known(solid: WallSolid) -> dict[str, Value]:
    """How a wall is known: the worst of its faces."""
    faces = solid.faces
    values: dict[str, Value] = {
        "Source": ("IfcLabel", ", ".join(dict.fromkeys(face.source for face in faces))),
        "Observations": ("IfcInteger", sum(int(face.observations) for face in faces)),
        "Faces": ("IfcLabel", " ".join(str(face.id) for face in faces)[:255]),
        "ThicknessSource": ("IfcLabel", _thickness_source(solid)),
        "ThicknessSeenLength": ("IfcLengthMeasure", round(float(solid.seen), 6)),
        "UnseenLength": ("IfcLengthMeasure", round(sum(_unseen(face.unseen) for face in faces), 6)),
    }
    for name, kind, sigmas in (
        ("SigmaOffset", "IfcLengthMeasure", [face.sigma_offset for face in faces]),
        ("SigmaAngle", "IfcPlaneAngleMeasure", [face.sigma_angle for face in faces]),
    ):
        if np.isfinite(sigmas).all():
            values[name] = (kind, round(float(max(sigmas)), 9))
    return values


def _thickness_source(solid: WallSolid) -> str:
    if solid.flat:
        return "none: the rooms touch"
    return "measured" if solid.seen else "assumed"


def _unseen(spans: Array) -> float:
    return float(np.ptp(spans, axis=1).sum()) if len(spans) else 0.0


def _sizes(solid: WallSolid, openings: tuple[Opening, ...]) -> dict[str, tuple[str, float]]:
    ground, side = float(solid.footprint.area), solid.length * solid.height
    return {
        "Length": ("Length", solid.length),
        "Width": ("Length", solid.thickness),
        "Height": ("Length", solid.height),
        "GrossFootprintArea": ("Area", ground),
        "GrossSideArea": ("Area", side),
        "NetSideArea": ("Area", side - sum(opening.area for opening in openings)),
        "GrossVolume": ("Volume", ground * solid.height),
        "NetVolume": ("Volume", ground * solid.height - sum(opening.volume for opening in openings)),
    }


def _opening(
    at: Storeyed,
    solid: WallSolid,
    placed: tuple[Entity, Entity],
    cut: _Cut,
    footprint: Polygon,
    leaves: dict[int, Entity | None],
) -> Opening:
    """The void, from face to face and a little out of both, and the leaf or pane in the middle. placed: wall, place."""
    import shapely

    ifc, doorway, (wall, wall_place) = at.ifc, cut.doorway, placed
    key = f"{at.key}/{doorway.type} {doorway.id}" + ("/behind" if doorway.id in leaves else "")
    width, height = cut.high - cut.low, cut.top - cut.bottom
    way = footprint.intersection(shapely.box(cut.low, footprint.bounds[1], cut.high, footprint.bounds[3]))
    back, front = (way.bounds[1], way.bounds[3]) if not way.is_empty else (-solid.thickness / 2, solid.thickness / 2)
    place = ifc.placement(wall_place, (cut.low, 0.0, cut.bottom))
    hole = ifc.extrusion(shapely.box(0.0, back - MARGIN, width, front + MARGIN), 0.0, height)
    void = ifc.root(
        "IfcOpeningElement",
        key,
        f"{doorway.type}_{doorway.id:03d}",
        ObjectPlacement=place,
        Representation=ifc.shape([hole]),
        **({"PredefinedType": "OPENING"} if ifc.schema == "IFC4" else {}),
    )
    ifc.root("IfcRelVoidsElement", key, RelatingBuildingElement=wall, RelatedOpeningElement=void)
    filling = None
    if doorway.id not in leaves and doorway.type != "passage":
        filling = _filling(at, key, doorway, place, (width, height, 0.5 * (back + front)), front - back)
        ifc.root("IfcRelFillsElement", key, RelatingOpeningElement=void, RelatedBuildingElement=filling)
    closed = leaves.setdefault(doorway.id, filling)
    return Opening(doorway, void, filling, closed, width * height, float(way.area) * height)


def _filling(
    at: Storeyed, key: str, doorway: Doorway, place: Entity, size: tuple[float, float, float], deep: float
) -> Entity:
    """IfcDoor or IfcWindow in its void. size: width, height, and y of its middle, m; deep: m, the wall's thickness."""
    import shapely

    ifc, (width, height, middle) = at.ifc, size
    half = min(LEAF[doorway.type], deep) / 2
    slab = ifc.extrusion(shapely.box(0.0, middle - half, width, middle + half), 0.0, height)
    kind, style = ("IfcDoor", "door") if doorway.type == "door" else ("IfcWindow", "glass")
    more = {"PredefinedType": doorway.type.upper()} if ifc.schema == "IFC4" else {}
    if ifc.schema == "IFC4":
        more["OperationType" if doorway.type == "door" else "PartitioningType"] = "NOTDEFINED"
    thing = ifc.root(
        kind,
        key,
        f"{doorway.type}_{doorway.id:03d}",
        ObjectPlacement=ifc.placement(place),
        Representation=ifc.shape([slab], style),
        OverallHeight=round(height, 6),
        OverallWidth=round(width, 6),
        **more,
    )
    values: dict[str, Value] = {
        "SidesSeen": ("IfcInteger", len(doorway.openings)),
        "HeadSource": ("IfcLabel", "assumed" if doorway.sigma_top is None else "image"),
        "FoundOpen": ("IfcBoolean", doorway.open),
    }
    if doorway.sigma_top is not None:
        values["SigmaHead"] = ("IfcLengthMeasure", round(float(doorway.sigma_top), 6))
    ifc.properties(key, [thing], "Recon_Measurement", values)
    return thing
