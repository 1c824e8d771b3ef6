"""What IFC files are made of: roots with stable ids, placements, extrusions, property sets and quantities."""

from __future__ import annotations

import hashlib
import unicodedata
from collections.abc import Callable, Hashable, Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

import recon
from recon.exporters.options import IfcSchema

if TYPE_CHECKING:
    from shapely.geometry import Polygon

Entity = Any
Value = tuple[str, Any]
"""IFC type and value of a property, such as ("IfcLengthMeasure", 0.004)."""
LONGEST = 255
"""Characters of an IfcLabel."""
STYLES: dict[str, tuple[tuple[int, int, int], float]] = {
    "wall": ((222, 219, 212), 0.0),
    "inferred wall": ((222, 219, 212), 0.5),
    "floor": ((150, 146, 138), 0.0),
    "ceiling": ((240, 240, 238), 0.0),
    "door": ((176, 138, 98), 0.0),
    "glass": ((150, 190, 210), 0.6),
    "object": ((120, 132, 150), 0.0),
    "assumed object": ((120, 132, 150), 0.5),
    "space": ((190, 215, 240), 0.85),
}
"""Colour (RGB) and transparency by name."""


VIEWS: dict[IfcSchema, str] = {"IFC4": "DesignTransferView_V1.0", "IFC2X3": "CoordinationView_V2.0"}
"""Model view definitions: the subset of the schema that a file keeps to."""


class IfcFile:
    """A file in the making. ids: every GlobalId is a hash of the texts that name a thing, so nothing is random.

    Points, directions, placements and properties that are alike are one entity: files are a third smaller.
    """

    def __init__(self, schema: IfcSchema, name: str) -> None:
        import ifcopenshell

        self.file = ifcopenshell.file(schema=schema)
        self.schema, self.name = schema, name
        self._styles: dict[str, Entity] = {}
        self._shared: dict[tuple[str, Hashable], Entity] = {}
        self._used: set[str] = set()
        self.file.header.file_description.description = (f"ViewDefinition [{VIEWS[schema]}]",)
        stamp = self.file.header.file_name
        stamp.time_stamp = "1970-01-01T00:00:00"  # same model, same bytes
        stamp.name = label(name)
        stamp.preprocessor_version = stamp.originating_system = f"recon {recon.__version__}"
        self.owner = self._owner_history() if schema == "IFC2X3" else None
        self.up = self.direction((0.0, 0.0, 1.0))
        self.model = self._context("Model")
        self.body = self._subcontext("Body", "MODEL_VIEW")
        self.axis = self._subcontext("Axis", "GRAPH_VIEW")
        self.foot = self._subcontext("FootPrint", "MODEL_VIEW")

    def create(self, kind: str, **attributes: Any) -> Entity:
        """An entity; attributes that are None stay unset."""
        return self.file.create_entity(kind, **{k: v for k, v in attributes.items() if v is not None})

    def shared(self, kind: str, key: Hashable, make: Callable[[], dict[str, Any]]) -> Entity:
        """An entity of which one is enough however often its `key` is asked for; make: its attributes."""
        if (kind, key) not in self._shared:
            self._shared[kind, key] = self.create(kind, **make())
        return self._shared[kind, key]

    def root(self, kind: str, key: str, name: str | None = None, **attributes: Any) -> Entity:
        """An entity with a GlobalId made of the file's name and `key`, which no other root has."""
        import ifcopenshell.guid

        text = f"{self.name}/{kind}/{key}"
        if text in self._used:
            raise ValueError(f"two entities are called {text}")
        self._used.add(text)
        guid = ifcopenshell.guid.compress(hashlib.sha256(text.encode("utf-8", "replace")).hexdigest()[:32])
        name = None if name is None else label(name)
        return self.create(kind, GlobalId=guid, OwnerHistory=self.owner, Name=name, **attributes)

    def point(self, xyz: Iterable[float]) -> Entity:
        """A point (2 or 3 coordinates), to the micrometre."""
        place = tuple(round(float(v), 6) + 0.0 for v in xyz)
        return self.shared("IfcCartesianPoint", place, lambda: {"Coordinates": place})

    def direction(self, xyz: Iterable[float]) -> Entity:
        """A unit vector."""
        ratios = tuple(round(float(v), 12) + 0.0 for v in xyz)
        return self.shared("IfcDirection", ratios, lambda: {"DirectionRatios": ratios})

    def placement(self, parent: Entity | None, xyz: Iterable[float] = (0, 0, 0), way: Any = (1, 0)) -> Entity:
        """A local placement: origin (3,), and the direction (2,) of its x axis in plan; z stays up."""
        point, x = self.point(xyz), self.direction((way[0], way[1], 0.0))
        key, parts = (point.id(), x.id()), {"Location": point, "Axis": self.up, "RefDirection": x}
        axes = self.shared("IfcAxis2Placement3D", key, lambda: parts)
        return self.create("IfcLocalPlacement", PlacementRelTo=parent, RelativePlacement=axes)

    def level(self, height: float) -> Entity:
        """Axes at a height (m) above the origin of what they belong to."""
        point = self.point((0.0, 0.0, height))
        return self.shared("IfcAxis2Placement3D", point.id(), lambda: {"Location": point})

    def polyline(self, points: Sequence[Any] | Any, closed: bool = False) -> Entity:
        """Through points (n, 2); closed: the first again at the end."""
        made = [self.point(p) for p in points]
        return self.create("IfcPolyline", Points=made + made[:1] if closed else made)

    def profile(self, polygon: Polygon) -> Entity:
        """The area of a polygon, which may have holes."""
        outer = self.polyline(np.asarray(polygon.exterior.coords)[:-1, :2], closed=True)
        if not polygon.interiors:
            return self.create("IfcArbitraryClosedProfileDef", ProfileType="AREA", OuterCurve=outer)
        inner = [self.polyline(np.asarray(ring.coords)[:-1, :2], closed=True) for ring in polygon.interiors]
        kind = "IfcArbitraryProfileDefWithVoids"
        return self.create(kind, ProfileType="AREA", OuterCurve=outer, InnerCurves=inner)

    def outline(self, parts: Sequence[Polygon]) -> Entity:
        """What polygons look like in plan: all of their rings."""
        rings = [ring for part in parts for ring in (part.exterior, *part.interiors)]
        curves = [self.polyline(np.asarray(ring.coords)[:-1, :2], closed=True) for ring in rings]
        return self.representation(self.foot, "FootPrint", "Curve2D", curves)

    def extrusion(self, polygon: Polygon, bottom: float, height: float) -> Entity:
        """A prism over a polygon in local coordinates, from `bottom`, m."""
        return self.create(
            "IfcExtrudedAreaSolid",
            SweptArea=self.profile(polygon),
            Position=self.level(bottom),
            ExtrudedDirection=self.up,
            Depth=round(float(height), 6),
        )

    def shape(self, solids: Sequence[Entity], style: str | None = None, more: Sequence[Entity] = ()) -> Entity:
        """What a product looks like: swept solids in one style, and further representations."""
        for solid in solids if style is not None else ():
            self.create("IfcStyledItem", Item=solid, Styles=[self._style(str(style))])
        body = self.representation(self.body, "Body", "SweptSolid", solids)
        return self.create("IfcProductDefinitionShape", Representations=[*more, body])

    def representation(self, context: Entity, identifier: str, kind: str, items: Sequence[Entity]) -> Entity:
        """One representation in a context."""
        names = {"RepresentationIdentifier": identifier, "RepresentationType": kind}
        return self.create("IfcShapeRepresentation", ContextOfItems=context, **names, Items=list(items))

    def properties(self, key: str, things: Sequence[Entity], name: str, values: dict[str, Value]) -> None:
        """A property set of one or more things."""
        made = [self._property(name, *value) for name, value in values.items()]
        found = self.root("IfcPropertySet", f"{key}/{name}", name, HasProperties=made)
        self._define(f"{key}/{name}", things, found)

    def quantities(self, key: str, thing: Entity, name: str, values: dict[str, tuple[str, float]]) -> None:
        """Base quantities, each ("Length" | "Area" | "Volume", value); IFC2X3 calls every set BaseQuantities."""
        made = [
            self.create(f"IfcQuantity{kind}", **{"Name": k, f"{kind}Value": round(float(v), 6)})
            for k, (kind, v) in values.items()
        ]
        name = "BaseQuantities" if self.schema == "IFC2X3" else name
        found = self.root("IfcElementQuantity", f"{key}/{name}", name, Quantities=made)
        self._define(f"{key}/{name}", [thing], found)

    def typed(self, kind: str, key: str, name: str, things: Sequence[Entity], **attributes: Any) -> Entity:
        """A type, and what is of it."""
        found = self.root(kind, key, name, **attributes)
        self.root("IfcRelDefinesByType", key, RelatedObjects=list(things), RelatingType=found)
        return found

    def material(self, key: str, things: Sequence[Entity], material: Entity) -> None:
        """What things are made of."""
        self.root("IfcRelAssociatesMaterial", key, RelatedObjects=list(things), RelatingMaterial=material)

    def to_bytes(self) -> bytes:
        """The file as STEP text."""
        return str(self.file.to_string()).encode()

    def _property(self, name: str, kind: str, value: Any) -> Entity:
        def attributes() -> dict[str, Any]:
            return {"Name": name, "NominalValue": self.create(kind, wrappedValue=value)}

        return self.shared("IfcPropertySingleValue", (name, kind, value), attributes)

    def _define(self, key: str, things: Sequence[Entity], definition: Entity) -> None:
        kind = "IfcRelDefinesByProperties"
        self.root(kind, key, RelatedObjects=list(things), RelatingPropertyDefinition=definition)

    def _style(self, name: str) -> Entity:
        if name not in self._styles:
            rgb, transparency = STYLES[name]
            names = ("Red", "Green", "Blue")
            colour = self.create("IfcColourRgb", **{n: round(v / 255, 4) for n, v in zip(names, rgb, strict=True)})
            shading = self.create(
                "IfcSurfaceStyleRendering", SurfaceColour=colour, Transparency=transparency, ReflectanceMethod="FLAT"
            )
            style = self.create("IfcSurfaceStyle", Name=name, Side="BOTH", Styles=[shading])
            if self.schema == "IFC2X3":
                style = self.create("IfcPresentationStyleAssignment", Styles=[style])
            self._styles[name] = style
        return self._styles[name]

    def _context(self, kind: str) -> Entity:
        return self.create(
            "IfcGeometricRepresentationContext",
            ContextType=kind,
            CoordinateSpaceDimension=3,
            Precision=1e-6,
            WorldCoordinateSystem=self.level(0.0),
        )

    def _subcontext(self, identifier: str, view: str) -> Entity:
        return self.create(
            "IfcGeometricRepresentationSubContext",
            ContextIdentifier=identifier,
            ContextType="Model",
            ParentContext=self.model,
            TargetView=view,
        )

    def _owner_history(self) -> Entity:
        """What IFC2X3 wants of every root: who made it, and when: at the beginning of time."""
        person = self.create("IfcPerson", FamilyName="recon")
        organisation = self.create("IfcOrganization", Name="recon")
        user = self.create("IfcPersonAndOrganization", ThePerson=person, TheOrganization=organisation)
        program = self.create(
            "IfcApplication",
            ApplicationDeveloper=organisation,
            Version=recon.__version__,
            ApplicationFullName="recon",
            ApplicationIdentifier="recon",
        )
        return self.create(
            "IfcOwnerHistory", OwningUser=user, OwningApplication=program, ChangeAction="ADDED", CreationDate=0
        )


def label(text: str) -> str:
    """Text that any IFC reader takes: one line, no control characters, at most LONGEST characters."""
    plain = text.encode("utf-8", "replace").decode()
    plain = "".join(" " if unicodedata.category(c).startswith("C") else c for c in plain)
    return plain[:LONGEST]
