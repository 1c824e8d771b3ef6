"""IFC files opened by FreeCAD's own importer, where FreeCAD is installed."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import ifcopenshell
import ifcopenshell.util.element
import pytest
from two_rooms import two_rooms

from recon.exporters import export

PYTHON = Path("/usr/bin/python3")
FOLDERS = [
    Path("/usr/lib/freecad-python3/lib"),
    *(Path("/usr/share/freecad") / name for name in ("Ext", "Mod/Arch", "Mod/Draft")),
]
"""Where Debian's freecad-python3 puts FreeCAD."""
VOLUMES = {
    "Wall": ("IfcWall", "Qto_WallBaseQuantities", "NetVolume"),
    "Space": ("IfcSpace", "Qto_SpaceBaseQuantities", "NetVolume"),
    "Slab": ("IfcSlab", "Qto_SlabBaseQuantities", "GrossVolume"),
}


def opened(path: Path) -> list[Any]:
    """[type, label, volume] of what FreeCAD makes of a file; skips where it is not installed."""
    if not all(place.exists() for place in (PYTHON, *FOLDERS)):
        pytest.skip("FreeCAD is not installed (Debian: freecad-python3)")
    version = subprocess.run([PYTHON, "-c", "import sys; print(sys.version_info[:2])"], capture_output=True, text=True)
    if version.stdout.strip() != str(sys.version_info[:2]):
        pytest.skip("FreeCAD's Python is another version: it cannot load this IfcOpenShell")
    packages = Path(ifcopenshell.__file__).parent.parent
    command = [PYTHON, Path(__file__).with_name("freecad_import.py"), path, packages, *FOLDERS]
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"} | {"QT_QPA_PLATFORM": "offscreen"}
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, env=environment)
    assert done.returncode == 0, done.stderr
    found: list[Any] = json.loads(done.stdout.splitlines()[-1])
    return found


def test_freecad_finds_what_the_file_says(tmp_path: Path) -> None:
    export(two_rooms(), tmp_path / "a.ifc")
    found = opened(tmp_path / "a.ifc")
    file = ifcopenshell.open(str(tmp_path / "a.ifc"))
    for kind, (entity, name, quantity) in VOLUMES.items():
        there = [ifcopenshell.util.element.get_psets(thing)[name][quantity] for thing in file.by_type(entity)]
        volumes = [volume for one, _, volume in found if one == kind]
        assert sorted(volumes) == pytest.approx(sorted(there), rel=1e-4)
    for kind, entity in (("Door", "IfcDoor"), ("Window", "IfcWindow"), ("Covering", "IfcCovering")):
        assert sum(one == kind for one, _, _ in found) == len(file.by_type(entity))
    labels = {label for one, label, _ in found if one == "Door"}
    assert labels == {door.Name for door in file.by_type("IfcDoor")}
