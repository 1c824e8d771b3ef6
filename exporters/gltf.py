"""Binary glTF 2.0 (GLB): one file, textures inside; metres, Y up (glTF 2.0, 3.4)."""

from __future__ import annotations

import json
import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

import recon
from recon.exporters.output import Output
from recon.exporters.pictures import encode_jpeg, linear_rgb
from recon.exporters.shape import face_facts, face_normal, grouped, y_up
from recon.model import NEUTRAL_COLOURS, Face, Model

ROUGHNESS = 0.9
# Names of the values that the specification gives as numbers.
FLOAT, UNSIGNED_INT = 5126, 5125
ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER = 34962, 34963
LINEAR, LINEAR_MIPMAP_LINEAR, CLAMP_TO_EDGE = 9729, 9987, 33071


def write_glb(model: Model, stem: str) -> Output:
    """A node a face (`wall_003`), under nodes of their kind (`walls`), under one root named as the model.

    What is known of a face (`face_facts`) are its node's `extras`; the model's notes those of the root.
    """
    return Output(_Document(model).glb())


class _Document:
    """The JSON and the binary buffer, as they grow."""

    def __init__(self, model: Model) -> None:
        self.model = model
        self.binary = bytearray()
        self.lists: dict[str, list[dict[str, Any]]] = {}
        self.materials: dict[str, int] = {}
        groups = [self.add("nodes", self.group(name, faces)) for name, faces in grouped(model).items()]
        root: dict[str, Any] = {"name": model.name} | ({"children": groups} if groups else {})
        if model.notes:
            root["extras"] = {"notes": list(model.notes)}
        self.root = self.add("nodes", root)

    def add(self, kind: str, item: dict[str, Any]) -> int:
        items = self.lists.setdefault(kind, [])
        items.append(item)
        return len(items) - 1

    def group(self, name: str, faces: list[Face]) -> dict[str, Any]:
        return {"name": name, "children": [self.add("nodes", self.node(face)) for face in faces]}

    def node(self, face: Face) -> dict[str, Any]:
        positions = y_up(face.vertices).astype("<f4")
        normals = np.broadcast_to(y_up(face_normal(face)), positions.shape).astype("<f4")
        attributes = {"POSITION": self.accessor(positions, "VEC3"), "NORMAL": self.accessor(normals, "VEC3")}
        if face.texture is not None:  # v of glTF points down, from the top of the picture
            uv = np.stack([face.uv[:, 0], 1 - face.uv[:, 1]], axis=1)
            attributes["TEXCOORD_0"] = self.accessor(uv.astype("<f4"), "VEC2")
        indices = self.accessor(face.triangles.reshape(-1).astype("<u4"), "SCALAR")
        primitive = {"attributes": attributes, "indices": indices, "material": self.material(face)}
        mesh = self.add("meshes", {"name": face.name, "primitives": [primitive]})
        return {"name": face.name, "mesh": mesh, "extras": face_facts(self.model, face)}

    def accessor(self, values: NDArray[Any], kind: str) -> int:
        target = ELEMENT_ARRAY_BUFFER if kind == "SCALAR" else ARRAY_BUFFER
        accessor: dict[str, Any] = {
            "bufferView": self.view(values.tobytes(), target),
            "componentType": UNSIGNED_INT if kind == "SCALAR" else FLOAT,
            "count": len(values),
            "type": kind,
        }
        if kind == "VEC3":
            accessor |= {"min": values.min(axis=0).tolist(), "max": values.max(axis=0).tolist()}
        return self.add("accessors", accessor)

    def view(self, data: bytes, target: int | None = None) -> int:
        self.binary += b"\0" * (-len(self.binary) % 4)
        view = {"buffer": 0, "byteOffset": len(self.binary), "byteLength": len(data)}
        self.binary += data
        return self.add("bufferViews", view | ({"target": target} if target else {}))

    def material(self, face: Face) -> int:
        name = f"neutral_{face.kind}" if face.texture is None else face.name
        if name not in self.materials:
            self.materials[name] = self.add("materials", {"name": name, "pbrMetallicRoughness": self.surface(face)})
        return self.materials[name]

    def surface(self, face: Face) -> dict[str, Any]:
        surface: dict[str, Any] = {"metallicFactor": 0.0, "roughnessFactor": ROUGHNESS}
        if face.texture is None:
            return surface | {"baseColorFactor": [*linear_rgb(NEUTRAL_COLOURS[face.kind]).round(6).tolist(), 1.0]}
        if "samplers" not in self.lists:
            filters = {"magFilter": LINEAR, "minFilter": LINEAR_MIPMAP_LINEAR}
            self.add("samplers", filters | {"wrapS": CLAMP_TO_EDGE, "wrapT": CLAMP_TO_EDGE})
        view = self.view(encode_jpeg(face.texture))
        image = self.add("images", {"name": face.name, "mimeType": "image/jpeg", "bufferView": view})
        texture = self.add("textures", {"name": face.name, "sampler": 0, "source": image})
        return surface | {"baseColorTexture": {"index": texture}}

    def glb(self) -> bytes:
        document: dict[str, Any] = {
            "asset": {"version": "2.0", "generator": f"recon {recon.__version__}"},
            "scene": 0,
            "scenes": [{"name": self.model.name, "nodes": [self.root]}],
            **self.lists,
        }
        chunks = b""
        if self.binary:
            document["buffers"] = [{"byteLength": len(self.binary)}]
            chunks = _chunk(b"BIN\0", bytes(self.binary), b"\0")
        text = json.dumps(document, ensure_ascii=False, allow_nan=False, separators=(",", ":")).encode()
        chunks = _chunk(b"JSON", text, b" ") + chunks
        return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def _chunk(kind: bytes, data: bytes, padding: bytes) -> bytes:
    data += padding * (-len(data) % 4)
    return struct.pack("<I4s", len(data), kind) + data
