"""glTF 2.0: .glb (one file) and .gltf (with .bin and textures beside it); metres, Y up (glTF 2.0, 3.4)."""

from __future__ import annotations

import json
import struct

from recon.exporters.gltf_document import Document
from recon.exporters.options import DEFAULTS, ExportOptions
from recon.exporters.output import Output
from recon.exporters.parts import part_pictures, parts_of
from recon.model import Model
from recon.storeys import Building, one_storey


def write_glb(model: Model, stem: str, options: ExportOptions = DEFAULTS) -> Output:
    """Everything in one file: building > rooms > floor, ceiling, walls and openings, as `Document` says."""
    return write_building_glb(one_storey(model), stem, options)


def write_gltf(model: Model, stem: str, options: ExportOptions = DEFAULTS) -> Output:
    """The same as text, with `<stem>.bin` and the folder `<stem>.textures` beside it."""
    return write_building_gltf(one_storey(model), stem, options)


def write_building_glb(building: Building, stem: str, options: ExportOptions = DEFAULTS) -> Output:
    """All storeys in one file, as `write_glb`."""
    document = Document(building.name, parts_of(building, ""), options, embedded=True)
    content = document.content({})
    binary = bytes(document.binary)
    chunks = _chunk(b"JSON", _text(content), b" ") + (_chunk(b"BIN\0", binary, b"\0") if binary else b"")
    return Output(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)


def write_building_gltf(building: Building, stem: str, options: ExportOptions = DEFAULTS) -> Output:
    """All storeys, as `write_gltf`, with pictures by storey where there are several."""
    parts = parts_of(building, f"{stem}.textures")
    document = Document(building.name, parts, options, embedded=False)
    beside = part_pictures(parts, options)
    if document.binary:
        beside[f"{stem}.bin"] = bytes(document.binary)
    return Output(_text(document.content({"uri": _uri(f"{stem}.bin")})), beside)


def _text(content: object) -> bytes:
    return json.dumps(content, ensure_ascii=False, allow_nan=False, separators=(",", ":")).encode()


def _uri(name: str) -> str:
    from urllib.parse import quote

    return quote(name)


def _chunk(kind: bytes, data: bytes, padding: bytes) -> bytes:
    data += padding * (-len(data) % 4)
    return struct.pack("<I4s", len(data), kind) + data
