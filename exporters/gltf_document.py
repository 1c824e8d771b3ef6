"""The JSON and the binary buffer of a glTF file, as they grow."""

from __future__ import annotations

from typing import Any
from urllib.parse import quote

import numpy as np
from numpy.typing import NDArray

import recon
from recon.exporters.bodies import Body, bodies_behind
from recon.exporters.lightmap import light_map, own_light_map
from recon.exporters.options import ExportOptions
from recon.exporters.parts import Part
from recon.exporters.pictures import MIME, OPACITY, encode, linear_rgb, material_name, texture_path
from recon.exporters.shape import Group, Structure, face_normal, room_facts, y_up
from recon.geometry import Array
from recon.model import NEUTRAL_COLOURS, Face

ROUGHNESS = 0.9
# Names of the values that the specification gives as numbers.
FLOAT, UNSIGNED_INT = 5126, 5125
ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER = 34962, 34963
LINEAR, LINEAR_MIPMAP_LINEAR, CLAMP_TO_EDGE = 9729, 9987, 33071
WEBP = "EXT_texture_webp"


class Document:
    """A node a face, under nodes of its opening and its room, under one root named as the building.

    Several storeys have nodes between, and their names before those of all that is on them.

    What is known of a face or room are its node's `extras`; the model's notes those of the root. TEXCOORD_1 are
    light-map coordinates: one square for all faces, or where the engine makes a map of every mesh, one square a face.

    engine: "godot": names of nodes end in -col, Godot then makes collision shapes. "unreal": convex meshes UCX_NAME_00
    beside each face. embedded: pictures are in the binary buffer, else in the folders of the parts.
    """

    def __init__(self, name: str, parts: list[Part], options: ExportOptions, embedded: bool) -> None:
        self.name, self.options, self.embedded = name, options, embedded
        structures = [Structure(part.model) for part in parts]
        self.binary = bytearray()
        self.lists: dict[str, list[dict[str, Any]]] = {}
        self.materials: dict[str, int] = {}
        faces = [(part.name, face) for part, each in zip(parts, structures, strict=True) for face in each.faces()]
        flat = [face for _, face in faces]
        squares = light_map(flat) if options.engine is None else [own_light_map(face) for face in flat]
        self.light = {(part, face.name): square for (part, face), square in zip(faces, squares, strict=True)}
        below: list[int] = []
        self.bodies: dict[str, list[Body]] = {}
        for self.part, self.structure in zip(parts, structures, strict=True):
            if options.engine == "unreal":
                own = list(self.structure.faces())
                self.bodies = {face.name: each for face, each in zip(own, bodies_behind(own), strict=True)}
            rooms = [self._group(group) for group in self.structure.groups]
            below += [self._level(rooms)] if self.part.name else rooms
        root: dict[str, Any] = {"name": name} | ({"children": below} if below else {})
        notes = list(dict.fromkeys(note for part in parts for note in (*part.model.notes, *part.model.picture_notes)))
        if notes:
            root["extras"] = {"notes": notes}
        self.root = self._add("nodes", root)

    def content(self, buffer: dict[str, Any]) -> dict[str, Any]:
        """The whole JSON; buffer: what is said of the binary buffer beside its length."""
        webp = [WEBP] if "textures" in self.lists and self.options.texture_format == "webp" else []
        document: dict[str, Any] = {"asset": {"version": "2.0", "generator": f"recon {recon.__version__}"}}
        if webp:
            document |= {"extensionsUsed": webp, "extensionsRequired": webp}
        document |= {"scene": 0, "scenes": [{"name": self.name, "nodes": [self.root]}], **self.lists}
        if self.binary:
            document["buffers"] = [{"byteLength": len(self.binary)} | buffer]
        return document

    def _add(self, kind: str, item: dict[str, Any]) -> int:
        items = self.lists.setdefault(kind, [])
        items.append(item)
        return len(items) - 1

    def _level(self, rooms: list[int]) -> int:
        elevation = float(self.part.elevation)
        node = {"name": self.part.name, "translation": [0.0, elevation, 0.0]} | ({"children": rooms} if rooms else {})
        return self._add(
            "nodes", node | {"extras": {"kind": "storey", "name": self.part.title, "elevation": elevation}}
        )

    def _named(self, name: str) -> str:
        """The name of something on this storey."""
        return f"{self.part.name}_{name}" if self.part.name else name

    def _group(self, group: Group) -> int:
        children = [node for face in group.faces for node in self._nodes(face)]
        for name, faces in group.parts.items():
            parts = [node for face in faces for node in self._nodes(face)]
            children.append(self._add("nodes", {"name": self._named(name), "children": parts}))
        node: dict[str, Any] = {"name": self._named(group.name), "children": children}
        return self._add("nodes", node | ({"extras": room_facts(group.room)} if group.room else {}))

    def _nodes(self, face: Face) -> list[int]:
        """The face and, where the engine wants them, its collision bodies."""
        own = self._named(face.name)
        name = f"{own}-col" if self.options.engine == "godot" else own
        mesh = self._mesh(own, self._primitive(face))
        found = [self._add("nodes", {"name": name, "mesh": mesh, "extras": self.structure.facts(face)})]
        if self.options.engine == "unreal":
            for k, body in enumerate(self.bodies[face.name]):
                attributes = {"POSITION": self._accessor(y_up(body.vertices).astype("<f4"), "VEC3")}
                shape = {"attributes": attributes, "indices": self._indices(body.triangles)}
                title = f"UCX_{own}_{k:02d}"
                found.append(self._add("nodes", {"name": title, "mesh": self._mesh(title, shape)}))
        return found

    def _mesh(self, name: str, primitive: dict[str, Any]) -> int:
        return self._add("meshes", {"name": name, "primitives": [primitive]})

    def _primitive(self, face: Face) -> dict[str, Any]:
        positions = y_up(face.vertices).astype("<f4")
        normals = np.broadcast_to(y_up(face_normal(face)), positions.shape).astype("<f4")
        attributes = {"POSITION": self._accessor(positions, "VEC3"), "NORMAL": self._accessor(normals, "VEC3")}
        # Numbered from 0 without a gap, so faces without a texture have the first pair, too.
        attributes["TEXCOORD_0"] = self._accessor(_downward(face.uv), "VEC2")
        attributes["TEXCOORD_1"] = self._accessor(_downward(self.light[self.part.name, face.name]), "VEC2")
        return {"attributes": attributes, "indices": self._indices(face.triangles), "material": self._material(face)}

    def _indices(self, triangles: NDArray[np.int64]) -> int:
        return self._accessor(triangles.reshape(-1).astype("<u4"), "SCALAR")

    def _accessor(self, values: NDArray[Any], kind: str) -> int:
        target = ELEMENT_ARRAY_BUFFER if kind == "SCALAR" else ARRAY_BUFFER
        accessor: dict[str, Any] = {
            "bufferView": self._view(values.tobytes(), target),
            "componentType": UNSIGNED_INT if kind == "SCALAR" else FLOAT,
            "count": len(values),
            "type": kind,
        }
        if kind == "VEC3":
            accessor |= {"min": values.min(axis=0).tolist(), "max": values.max(axis=0).tolist()}
        return self._add("accessors", accessor)

    def _view(self, data: bytes, target: int | None = None) -> int:
        self.binary += b"\0" * (-len(self.binary) % 4)
        view = {"buffer": 0, "byteOffset": len(self.binary), "byteLength": len(data)}
        self.binary += data
        return self._add("bufferViews", view | ({"target": target} if target else {}))

    def _material(self, face: Face) -> int:
        name = material_name(face) if face.texture is None else self._named(material_name(face))
        if name not in self.materials:
            material: dict[str, Any] = {"name": name, "pbrMetallicRoughness": self._surface(face)}
            if face.texture is None and face.kind in OPACITY:
                material["alphaMode"] = "BLEND"
            self.materials[name] = self._add("materials", material)
        return self.materials[name]

    def _surface(self, face: Face) -> dict[str, Any]:
        surface: dict[str, Any] = {"metallicFactor": 0.0, "roughnessFactor": ROUGHNESS}
        if face.texture is None:
            colour = linear_rgb(NEUTRAL_COLOURS[face.kind]).round(6).tolist()
            return surface | {"baseColorFactor": [*colour, OPACITY.get(face.kind, 1.0)]}
        if "samplers" not in self.lists:
            filters = {"magFilter": LINEAR, "minFilter": LINEAR_MIPMAP_LINEAR}
            self._add("samplers", filters | {"wrapS": CLAMP_TO_EDGE, "wrapT": CLAMP_TO_EDGE})
        name = self._named(material_name(face))
        image = self._add("images", {"name": name} | self._picture(face))
        source = {"source": image}
        texture = {"extensions": {WEBP: source}} if self.options.texture_format == "webp" else source
        return surface | {"baseColorTexture": {"index": self._add("textures", {"name": name, "sampler": 0} | texture)}}

    def _picture(self, face: Face) -> dict[str, Any]:
        kind = self.options.texture_format
        if not self.embedded:
            return {"uri": quote(texture_path(face, self.part.textures, kind))}
        assert face.texture is not None
        return {"mimeType": MIME[kind], "bufferView": self._view(encode(face.texture, kind))}


def _downward(uv: Array) -> NDArray[np.float32]:
    """glTF's coordinates count down from the top of the picture."""
    return np.stack([uv[:, 0], 1 - uv[:, 1]], axis=1).astype("<f4")
