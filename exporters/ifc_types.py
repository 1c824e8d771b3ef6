"""Types of an IFC file: walls by thickness, doors and windows by size; and what whole groups have in common."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Sequence
from typing import Any, TypeVar

from recon.exporters.ifc_file import Entity, IfcFile
from recon.exporters.ifc_walls import WallPart, inferred
from recon.solids import WallSolid

SIZE = 0.05
"""m: sizes of doors and windows of one type agree to this; those of walls to a millimetre."""
Key = TypeVar("Key", bound=Hashable)


def add_types(ifc: IfcFile, project: Entity, walls: Sequence[WallPart], spaces: Sequence[Entity]) -> None:
    """A type for every wall, door and window, declared in the project, and property sets of what lies between rooms."""
    types = [_wall_type(ifc, *key, things) for key, things in _grouped((_kind(w.solid), w.entity) for w in walls)]
    openings = [opening for wall in walls for opening in wall.openings]
    filled = [(opening.doorway, opening.filling) for opening in openings if opening.filling is not None]
    sizes = [((way.type, _size(thing.OverallWidth), _size(thing.OverallHeight)), thing) for way, thing in filled]
    types += [_filling_type(ifc, *key, things) for key, things in _grouped(sizes)]
    if types and ifc.schema == "IFC4":
        ifc.root("IfcRelDeclares", "types", RelatingContext=project, RelatedDefinitions=types)
    inner = {"Wall": [wall.entity for wall in walls if wall.solid.front and wall.solid.back]}
    for kind in ("door", "window"):
        inner[kind.title()] = [thing for way, thing in filled if way.type == kind and None not in way.rooms]
    if ifc.schema == "IFC4":
        inner["Space"] = list(spaces)
    for kind, things in inner.items():
        if things:
            ifc.properties("inner", things, f"Pset_{kind}Common", {"IsExternal": ("IfcBoolean", False)})


def _kind(solid: WallSolid) -> tuple[int, str, bool]:
    """Thickness in mm, how it is known, and whether nobody saw the wall."""
    source = "none: rooms touch" if solid.flat else "measured" if solid.seen else "assumed"
    return round(1000 * solid.thickness), source, inferred(solid)


def _wall_type(ifc: IfcFile, thick: int, source: str, unseen: bool, walls: Sequence[Entity]) -> Entity:
    """One layer as thick as the wall, about its middle line."""
    name = f"Wall {thick} mm" + ("" if source == "measured" else f" ({source})") + (", inferred" if unseen else "")
    kind = "STANDARD" if ifc.schema == "IFC2X3" else "NOTDEFINED" if unseen else "SOLIDWALL"
    found = ifc.typed("IfcWallType", name, name, walls, PredefinedType=kind)
    material = ifc.shared("IfcMaterial", "not known", lambda: {"Name": "not known"})
    layer = ifc.create("IfcMaterialLayer", Material=material, LayerThickness=thick / 1000)
    layers = ifc.create("IfcMaterialLayerSet", MaterialLayers=[layer], LayerSetName=name)
    ways = {"LayerSetDirection": "AXIS2", "DirectionSense": "POSITIVE", "OffsetFromReferenceLine": -thick / 2000}
    ifc.material(f"{name}/type", [found], layers)
    ifc.material(name, walls, ifc.create("IfcMaterialLayerSetUsage", ForLayerSet=layers, **ways))
    return found


def _filling_type(ifc: IfcFile, kind: str, width: float, height: float, things: Sequence[Entity]) -> Entity:
    """How a leaf swings or a window is divided was not seen."""
    name = f"{kind.title()} {width:.2f} x {height:.2f} m"
    if ifc.schema == "IFC2X3":
        unknown: dict[str, Any] = {"OperationType": "NOTDEFINED", "ConstructionType": "NOTDEFINED"}
        more = {"ParameterTakesPrecedence": False, "Sizeable": False}
        return ifc.typed(f"Ifc{kind.title()}Style", name, name, things, **unknown, **more)
    unknown = {"OperationType" if kind == "door" else "PartitioningType": "NOTDEFINED"}
    return ifc.typed(f"Ifc{kind.title()}Type", name, name, things, PredefinedType=kind.upper(), **unknown)


def _size(metres: float) -> float:
    return round(round(metres / SIZE) * SIZE, 6)


def _grouped(pairs: Iterable[tuple[Key, Entity]]) -> Iterable[tuple[Key, list[Entity]]]:
    """Things by key, in the order of the keys."""
    groups: dict[Key, list[Entity]] = {}
    for key, thing in pairs:
        groups.setdefault(key, []).append(thing)
    return sorted(groups.items(), key=lambda group: str(group[0]))
