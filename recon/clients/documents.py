"""Text formats: whether they are well-formed, and whether the files that they name are there."""

from __future__ import annotations

import json
from pathlib import Path
from xml.etree import ElementTree

from recon.clients import libraries
from recon.clients.finding import Broken
from recon.errors import InputError
from recon.layout_json import layout_from_json


def xml(path: Path) -> str:
    """Any XML file."""
    return f"well-formed, {sum(1 for _ in _tree(path).iter())} elements"


def layout(path: Path) -> str:
    """A layout as recon reads it."""
    try:
        found = layout_from_json(json.loads(path.read_text(encoding="utf-8")), path.name)
    except (InputError, ValueError) as error:
        raise Broken(str(error)) from None
    return f"{len(found.walls)} walls, {len(found.rooms)} rooms, {len(found.openings)} openings"


def stl_length(path: Path) -> str:
    """Whether a binary STL is as long as it says; text is left to other readers."""
    content = path.read_bytes()
    if content[:5] == b"solid":
        return "text"
    count = int.from_bytes(content[80:84], "little")
    if len(content) != 84 + 50 * count:
        raise Broken(f"is {len(content)} bytes long, expected {84 + 50 * count} for {count} triangles")
    return f"{count} triangles, of the right length"


def obj_files(path: Path) -> str:
    """Whether the materials and pictures that an OBJ names are there."""
    pictures = [picture for library in _named(path, "mtllib") for picture in _named(library, "map_Kd")]
    return f"its materials and {len(pictures)} pictures are there"


def _named(path: Path, keyword: str) -> list[Path]:
    """The files that lines of a text file name after a keyword; Broken where one is missing."""
    lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    files = [path.parent / line.split(maxsplit=1)[1] for line in lines if line.startswith(f"{keyword} ")]
    for file in files:
        if not file.is_file():
            raise Broken(f"{path.name} names {file.name}, which is missing")
    return files


def robot_meshes(path: Path) -> str:
    """The meshes that an SDF or URDF file names, each opened by trimesh."""
    root = _tree(path)
    expected = path.suffix.lower().removeprefix(".").replace("urdf", "robot")
    if root.tag != expected:
        raise Broken(f"its root is {root.tag!r}, expected {expected!r}")
    names = [uri.text or "" for uri in root.iter("uri")] + [mesh.get("filename", "") for mesh in root.iter("mesh")]
    found = [name for name in dict.fromkeys(names) if name]
    for name in found:
        if not (path.parent / name).is_file():
            raise Broken(f"{name} is missing")
    said = [libraries.trimesh(path.parent / name) for name in found]
    return f"{len(found)} meshes, the first has {said[0]}" if said else "names no mesh"


def _tree(path: Path) -> ElementTree.Element:
    try:
        return ElementTree.parse(path).getroot()
    except (ElementTree.ParseError, OSError) as error:
        raise Broken(f"is no XML: {error}") from None
