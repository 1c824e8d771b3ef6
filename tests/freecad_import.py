"""Run by the Python of FreeCAD: python3 freecad_import.py FILE.ifc PACKAGES [FOLDER ...], FOLDERs being FreeCAD's.

Opens the file with FreeCAD's own importer and prints what came in: [IFC type, label, volume in m^3] of every solid.
FreeCAD 0.20 knows an older IfcOpenShell: names of settings are translated, and tuples made lists.
"""

# mypy: ignore-errors

import json
import site
import sys

site.addsitedir(sys.argv[2])
sys.path[:0] = sys.argv[3:]

import ifcopenshell  # noqa: E402
import ifcopenshell.geom  # noqa: E402
import ifcopenshell.ifcopenshell_wrapper as wrapper  # noqa: E402


class Settings(ifcopenshell.geom.settings):
    """Those of today under the names of then."""

    USE_BREP_DATA, SEW_SHELLS, USE_WORLD_COORDS = "iterator-output", "reorient-shells", "use-world-coords"
    DISABLE_OPENING_SUBTRACTIONS, INCLUDE_CURVES = "disable-opening-subtractions", "dimensionality"

    def set(self, name, value):
        if name == self.USE_BREP_DATA:
            value = wrapper.SERIALIZED
        elif name == self.INCLUDE_CURVES:
            value = wrapper.CURVES_SURFACES_AND_SOLIDS if value else wrapper.SURFACES_AND_SOLIDS
        super().set(name, value)


by_type = ifcopenshell.file.by_type
ifcopenshell.file.by_type = lambda self, *of, **how: list(by_type(self, *of, **how))
ifcopenshell.geom.settings = Settings

import FreeCAD  # noqa: E402
import importIFC  # noqa: E402

document = FreeCAD.newDocument()
importIFC.insert(sys.argv[1], document.Name)
solids = [thing for thing in document.Objects if hasattr(thing, "IfcType") and hasattr(thing, "Shape")]
found = [[thing.IfcType, thing.Label, thing.Shape.Volume / 1e9] for thing in solids if thing.Shape.Solids]
print("\n" + json.dumps(found))
