"""What IFC files are made of: roots with stable ids, placements, extrusions, property sets and quantities."""

from __future__ import annotations

import hashlib
import unicodedata
from collections.abc import Iterable, Sequence
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
    "space": ((190, 215, 240), 0.85),
}
"""Colour (RGB) and transparency by name."""


class IfcFile:
    """A file in the making. ids: every GlobalId is a hash of the texts that name a thing, so nothing is random."""

    def __init__(self, schema: IfcSchema, name: str) -> None:
        import ifcopenshell

        self.file = ifcopenshell.file(schema=schema)
        self.schema, self.name = schema, name
        self._styles: dict[str, Entity] = {}
        self._used: set[str] = set()
        stamp = self.file.header.file_name
        stamp.time_stamp = "1970-01-01T00:00:00"  # same model, same bytes
        stamp.name = label(name)
        stamp.preprocessor_version = stamp.originating_system = f"recon {recon.__version__}"
        self.owner = self._owner_history() if schema == "IFC2X3" else None
        self.up = self.create("IfcDirection", DirectionRatios=(0.0, 0.0, 1.0))
        self.origin = self.create("IfcCartesianPoint", Coordinates=(0.0, 0.0, 0.0))
        self.world = self.create("IfcAxis2Placement3D", Location=self.origin)
        self.flat = self.create("IfcAxis2Placement2D", Location=self.point((0.0, 0.0)))
        self.model = self._context("Model")
        self.body = self._subcontext("Body", "MODEL_VIEW")
        self.axis = self._subcontext("Axis", "GRAPH_VIEW")
        self.foot = self._subcontext("FootPrint", "MODEL_VIEW")
        self.unknown_material = self.create("IfcMaterial", Name="not known")

    def create(self, kind: str, **attributes: Any) -> Entity:
        """An entity; attributes that are None stay unset."""
        return self.file.create_entity(kind, **{k: v for k, v in attributes.items() if v is not None})

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
        return self.create("IfcCartesianPoint", Coordinates=tuple(round(float(v), 6) + 0.0 for v in xyz))

    def direction(self, xyz: Iterable[float]) -> Entity:
        """A unit vector."""
        return self.create("IfcDirection", DirectionRatios=tuple(round(float(v), 12) + 0.0 for v in xyz))

    def placement(self, parent: Entity | None, xyz: Iterable[float] = (0, 0, 0), way: Any = (1, 0)) -> Entity:
        """A local placement: origin (3,), and the direction (2,) of its x axis in plan; z stays up."""
        axes = self.create(
            "IfcAxis2Placement3D",
            Location=self.point(xyz),
            Axis=self.up,
            RefDirection=self.direction((way[0], way[1], 0.0)),
        )
        return self.create("IfcLocalPlacement", PlacementRelTo=parent, RelativePlacement=axes)

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

    def extrusion(self, polygon: Polygon, bottom: float, height: float) -> Entity:
        """A prism over a polygon in local coordinates, from `bottom`, m."""
        position = self.create("IfcAxis2Placement3D", Location=self.point((0.0, 0.0, bottom)))
        return self.create(
            "IfcExtrudedAreaSolid",
            SweptArea=self.profile(polygon),
            Position=position,
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
        made = [
            self.create("IfcPropertySingleValue", Name=k, NominalValue=self.create(t, wrappedValue=v))
            for k, (t, v) in values.items()
        ]
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

    def to_bytes(self) -> bytes:
        """The file as STEP text."""
        return str(self.file.to_string()).encode()

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
            WorldCoordinateSystem=self.world,
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
