"""Faces of a model as the mesh formats want them: by room, with what is known of each."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from recon.facing import rooms_before
from recon.geometry import Array
from recon.model import Face, Model, Opening, Room, Wall

ROOMLESS = "other"
"""Name of the group of faces that lie in no room."""


@dataclass(frozen=True)
class Group:
    """Faces of one room, or of none. name: `room_000` or ROOMLESS.

    parts: the faces of every opening in the room's walls, by a name like `opening_003`, and of every face that is cut
    into tiles, by its name.
    """

    name: str
    room: Room | None
    faces: tuple[Face, ...]
    parts: dict[str, tuple[Face, ...]]

    @property
    def all_faces(self) -> tuple[Face, ...]:
        """Floor, ceiling, walls and then what comes in parts."""
        return self.faces + tuple(face for faces in self.parts.values() for face in faces)


class Structure:
    """Rooms of a model and the faces in each; a wall belongs to the room before it, an opening to its wall's room."""

    def __init__(self, model: Model) -> None:
        self.model = model
        self._before = rooms_before(model.layout)
        self._walls = {wall.id: wall for wall in model.layout.walls}
        self._rooms = {room.id: room for room in model.layout.rooms}
        self._openings = {opening.id: opening for opening in model.layout.openings}

    @cached_property
    def groups(self) -> tuple[Group, ...]:
        """Rooms in the order of the layout, then what lies in none; groups without a face are left out."""
        by_room: dict[int | None, list[Face]] = {room.id: [] for room in self.model.layout.rooms} | {None: []}
        for face in self.model.faces:
            room = self.room(face)
            by_room[None if room is None else room.id].append(face)
        return tuple(self._group(number, faces) for number, faces in by_room.items() if faces)

    def faces(self) -> list[Face]:
        """All faces, group by group."""
        return [face for group in self.groups for face in group.all_faces]

    def room(self, face: Face) -> Room | None:
        """The room that a face is seen from."""
        if face.kind in ("floor", "ceiling"):
            return self._rooms.get(face.ref)
        return self._before.get(face.ref)

    def facts(self, face: Face) -> dict[str, Any]:
        """What is known of a face beyond its shape, for formats that carry such values; numbers are finite."""
        facts: dict[str, Any] = {"kind": face.kind, "id": int(face.ref if face.opening is None else face.opening)}
        room = self.room(face)
        if room is not None:
            facts |= {"room": room.name, "room_id": int(room.id)}
        if face.texture is not None:
            facts |= {"metres_per_texel": float(face.metres_per_texel), "seen_fraction": float(face.seen_fraction)}
        if face.kind not in ("floor", "ceiling") and face.ref in self._walls:
            facts |= _wall_facts(self._walls[face.ref])
        if face.opening in self._openings:
            facts |= _opening_facts(self._openings[face.opening])
        return facts

    def _group(self, number: int | None, faces: list[Face]) -> Group:
        parts: dict[str, tuple[Face, ...]] = {}
        plain: list[Face] = []
        for face in faces:
            name = face.tile_of if face.opening is None else f"opening_{face.opening:03d}"
            if name is None:
                plain.append(face)
            else:
                parts[name] = (*parts.get(name, ()), face)
        order = {"floor": 0, "ceiling": 1}
        plain.sort(key=lambda f: order.get(f.kind, 2))
        if number is None:
            return Group(ROOMLESS, None, tuple(plain), parts)
        return Group(f"room_{number:03d}", self._rooms[number], tuple(plain), parts)


def room_facts(room: Room) -> dict[str, Any]:
    """What is known of a room, as `Structure.facts`."""
    facts = {"kind": "room", "id": int(room.id), "room": room.name, "area": round(room.area, 6)}
    height = {"ceiling_height": room.ceiling_height, "sigma_ceiling": room.sigma_ceiling}
    return facts | {name: float(value) for name, value in height.items() if value is not None}


def face_normal(face: Face) -> Array:
    """Unit normal (3,) into the free space, from all triangles by area: one thin triangle does no harm."""
    a, b, c = np.moveaxis(face.vertices[face.triangles], 1, 0)
    n = np.cross(b - a, c - a).sum(axis=0)
    return np.asarray(n / max(float(np.linalg.norm(n)), 1e-300))


def y_up(points: Array) -> Array:
    """Map coordinates (..., 3), z up, with y up: x, z, -y. A turn about x, so right-handed still."""
    return np.stack([points[..., 0], points[..., 2], -points[..., 1]], axis=-1)


def _wall_facts(wall: Wall) -> dict[str, Any]:
    facts = {"sigma_offset": wall.sigma_offset, "sigma_angle": wall.sigma_angle, "thickness": wall.thickness}
    known = {k: float(v) for k, v in facts.items() if v is not None and np.isfinite(v)}
    return {"wall": int(wall.id)} | known | {"source": wall.source, "observations": int(wall.observations)}


def _opening_facts(opening: Opening) -> dict[str, Any]:
    facts = {"top": opening.top, "sigma_top": opening.sigma_top, "depth": opening.depth}
    known = {k: float(v) for k, v in facts.items() if v is not None and np.isfinite(v)}
    return {"opening": opening.type, "open": int(opening.is_hole)} | known
