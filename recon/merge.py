"""Models moved in plan, and several on one floor made one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from recon.geometry import Array, apply2
from recon.model import Dimension, Face, FloorObject, Layout, Model, Opening, Room, Wall


def moved(model: Model, target_from_map: ArrayLike) -> Model:
    """The model in another frame of the plan: target_from_map (3,) is x, y (m) and yaw (rad). Heights stay.

    Trajectory and occupancy, which belong to one drive, are left out.
    """
    pose = np.asarray(target_from_map, dtype=np.float64)
    layout = model.layout
    walls = tuple(replace(w, start=apply2(pose, w.start), end=apply2(pose, w.end)) for w in layout.walls)
    openings = tuple(replace(o, start=apply2(pose, o.start), end=apply2(pose, o.end)) for o in layout.openings)
    dimensions, spans = (
        tuple(replace(d, start=apply2(pose, d.start), end=apply2(pose, d.end)) for d in some)
        for some in (layout.dimensions, layout.spans)
    )
    layout = replace(
        layout,
        walls=walls,
        rooms=tuple(_moved_room(room, pose) for room in layout.rooms),
        openings=openings,
        objects=tuple(_moved_object(thing, pose) for thing in layout.objects),
        dimensions=dimensions,
        spans=spans,
    )
    faces = tuple(replace(f, vertices=np.column_stack([apply2(pose, f.vertices[:, :2]), f.vertices[:, 2]]))
                  for f in model.faces)  # fmt: skip
    return Model(model.name, layout, faces, model.notes, model.metadata, picture_notes=model.picture_notes)


def _moved_room(room: Room, pose: Array) -> Room:
    c, s = np.cos(pose[2]), np.sin(pose[2])
    turn = np.array([[c, -s], [s, c]])
    corners = room.corner_covariances
    turned = None if corners is None else turn @ corners @ turn.T
    return replace(room, polygon=apply2(pose, room.polygon), corner_covariances=turned)


def _moved_object(thing: FloorObject, pose: Array) -> FloorObject:
    legs = tuple(apply2(pose, leg) for leg in thing.legs)
    return replace(thing, footprint=apply2(pose, thing.footprint), legs=legs)


def merged(models: Sequence[Model]) -> Model:
    """Models of one frame and floor as one: ids and the names of faces are numbered on from model to model.

    Heights of the first that knows one hold for the whole; rooms keep the height of their own model.
    """
    layouts: list[Layout] = []
    faces: list[Face] = []
    walls = rooms = openings = objects = 0
    for model in models:
        layout = _numbered(model.layout, walls, rooms, openings, objects)
        layouts.append(layout)
        faces += [_numbered_face(face, walls, rooms, openings) for face in model.faces]
        walls, rooms = _next(layout.walls, walls), _next(layout.rooms, rooms)
        openings, objects = _next(layout.openings, openings), _next(layout.objects, objects)
    known = next((part for part in layouts if part.ceiling_height is not None), layouts[0])
    layout = replace(
        known,
        walls=tuple(w for part in layouts for w in part.walls),
        rooms=tuple(_own_height(r, part) for part in layouts for r in part.rooms),
        openings=tuple(o for part in layouts for o in part.openings),
        objects=tuple(o for part in layouts for o in part.objects),
        dimensions=tuple(d for part in layouts for d in part.dimensions),
        spans=tuple(d for part in layouts for d in part.spans),
    )
    notes = tuple(dict.fromkeys(note for model in models for note in model.notes))
    pictures = tuple(dict.fromkeys(note for model in models for note in model.picture_notes))
    name = " + ".join(dict.fromkeys(m.name for m in models))
    return Model(name, layout, tuple(faces), notes, picture_notes=pictures)


def _next(items: Sequence[Wall | Room | Opening | FloorObject], least: int) -> int:
    return max((item.id + 1 for item in items), default=least)


def _own_height(room: Room, layout: Layout) -> Room:
    if room.ceiling_height is not None or layout.ceiling_height is None:
        return room
    return replace(room, ceiling_height=layout.ceiling_height, sigma_ceiling=layout.sigma_ceiling)


def _numbered(layout: Layout, walls: int, rooms: int, openings: int, objects: int) -> Layout:
    def numbered(dimension: Dimension) -> Dimension:
        first, second = dimension.walls
        room = dimension.room + rooms if dimension.room >= 0 else dimension.room
        return replace(dimension, room=room, walls=(first + walls, second + walls))

    return replace(
        layout,
        walls=tuple(replace(w, id=w.id + walls) for w in layout.walls),
        rooms=tuple(replace(r, id=r.id + rooms) for r in layout.rooms),
        openings=tuple(replace(o, id=o.id + openings, wall=o.wall + walls) for o in layout.openings),
        objects=tuple(replace(o, id=o.id + objects) for o in layout.objects),
        dimensions=tuple(numbered(d) for d in layout.dimensions),
        spans=tuple(numbered(d) for d in layout.spans),
    )


def _numbered_face(face: Face, walls: int, rooms: int, openings: int) -> Face:
    of_wall = face.kind not in ("floor", "ceiling")
    ref = face.ref + (walls if of_wall else rooms)
    if face.opening is not None:
        name = face.name.replace(f"_{face.opening:03d}", f"_{face.opening + openings:03d}")
        return replace(face, ref=ref, name=name, opening=face.opening + openings)
    return replace(face, ref=ref, name=face.name.replace(f"_{face.ref:03d}", f"_{ref:03d}"))
