"""Storeys as the mesh formats hold them: each with a plain name and a folder of its own for pictures."""

from __future__ import annotations

import re
from dataclasses import dataclass

from recon.exporters.options import ExportOptions
from recon.exporters.pictures import texture_files
from recon.model import Model
from recon.storeys import Building


@dataclass(frozen=True)
class Part:
    """One storey. name: in the file, "" where the building has one storey only. textures: folder of its pictures."""

    name: str
    title: str
    elevation: float
    model: Model
    textures: str


def parts_of(building: Building, folder: str) -> list[Part]:
    """One part a storey; that of a building with one storey has no name, and its textures no folder of their own."""
    if len(building.storeys) == 1:
        storey = building.storeys[0]
        return [Part("", storey.name, storey.elevation, storey.model, folder)]
    parts: list[Part] = []
    for storey in building.storeys:
        name = plain_name(storey.name, {part.name for part in parts})
        parts.append(Part(name, storey.name, storey.elevation, storey.model, f"{folder}/{name}"))
    return parts


def part_pictures(parts: list[Part], options: ExportOptions) -> dict[str, bytes]:
    """Files of all pictures, by path."""
    files: dict[str, bytes] = {}
    for part in parts:
        files |= texture_files(part.model, part.textures, options.texture_format)
    return files


def plain_name(title: str, taken: set[str]) -> str:
    """Letters, digits and underscores, like `title`, that are not among those `taken`."""
    plain = re.sub(r"[^A-Za-z0-9_]+", "_", title).strip("_") or "storey"
    plain = f"storey_{plain}" if plain[0].isdigit() else plain
    name, number = plain, 2
    while name in taken or name == "materials":
        name, number = f"{plain}_{number}", number + 1
    return name
