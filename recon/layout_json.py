"""The layout as JSON: layout.json of FORMAT.md, read and written."""

from __future__ import annotations

import math
from typing import Any, get_args

import numpy as np

from recon.errors import InputError
from recon.geometry import Array
from recon.model import DEFAULT_CEILING_HEIGHT, Dimension, FloorObject, Layout, Opening, OpeningType, Room, Source, Wall

VERSION = 1
_DECIMALS = 6  # micrometres: far below any accuracy here, and stable text


def layout_to_json(layout: Layout) -> dict[str, Any]:
    """The layout as plain JSON values in the schema of FORMAT.md (metres, radians, map frame).

    Lengths are rounded to a micrometre. A standard deviation that is not finite is written as null (unknown). Beyond
    FORMAT.md there are `sigma_ceiling` and `default_ceiling_height`, so that reading back loses nothing.
    """
    return {
        "version": VERSION,
        "frame": "map",
        "units": "m",
        "ceiling_height": _rounded(layout.ceiling_height),
        "sigma_ceiling": _rounded(layout.sigma_ceiling),
        "default_ceiling_height": _rounded(layout.default_ceiling_height),
        "walls": [_wall_to_json(w) for w in layout.walls],
        "rooms": [_room_to_json(r) for r in layout.rooms],
        "openings": [_opening_to_json(o) for o in layout.openings],
        "objects": [_object_to_json(o) for o in layout.objects],
        "dimensions": [_dimension_to_json(d) for d in layout.dimensions],
    } | ({"spans": [_dimension_to_json(d) for d in layout.spans]} if layout.spans else {})


def layout_from_json(data: Any, where: str) -> Layout:
    """The layout in parsed JSON `data`; `where` (the file) starts the text of errors.

    Standard deviations, source and observation counts, which a true layout does not carry, are 0, "lidar" and 0 when
    absent. Unknown keys are ignored. Raises InputError when a value is missing, of the wrong kind or not finite, when
    an id appears twice, or an opening names a wall that is not there.
    """
    reader = _Reader(where)
    top = reader.mapping(data, "layout")
    version = top.get("version")
    if version != VERSION:
        raise InputError(f"{where}: version is {version!r}, expected {VERSION}")
    if top.get("units", "m") != "m":
        raise InputError(f"{where}: units is {top['units']!r}, expected 'm'")
    walls = tuple(reader.wall(w, f"walls[{i}]") for i, w in enumerate(reader.items(top, "walls")))
    layout = Layout(
        walls=walls,
        rooms=tuple(reader.room(r, f"rooms[{i}]") for i, r in enumerate(reader.items(top, "rooms"))),
        openings=tuple(reader.opening(o, f"openings[{i}]") for i, o in enumerate(reader.items(top, "openings"))),
        objects=tuple(reader.object(o, f"objects[{i}]") for i, o in enumerate(reader.items(top, "objects"))),
        ceiling_height=reader.optional(top, "ceiling_height", "layout"),
        sigma_ceiling=reader.optional(top, "sigma_ceiling", "layout"),
        default_ceiling_height=reader.number(top, "default_ceiling_height", "layout", DEFAULT_CEILING_HEIGHT),
        dimensions=tuple(
            reader.dimension(d, f"dimensions[{i}]") for i, d in enumerate(reader.items(top, "dimensions"))
        ),
        spans=tuple(reader.dimension(d, f"spans[{i}]") for i, d in enumerate(reader.items(top, "spans"))),
    )
    _check_ids(layout, where)
    return layout


def _rounded(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else round(float(value), _DECIMALS) + 0.0


def _points(points: Array) -> list[list[float]]:
    return [[round(float(v), _DECIMALS) + 0.0 for v in point] for point in points]


def _wall_to_json(wall: Wall) -> dict[str, Any]:
    start, end = _points(np.stack([wall.start, wall.end]))
    sigmas = {"sigma_offset": _rounded(wall.sigma_offset), "sigma_angle": _rounded(wall.sigma_angle)}
    known: dict[str, Any] = {"source": wall.source, "observations": int(wall.observations)}
    if wall.thickness is not None:
        known["thickness"] = _rounded(wall.thickness)
    if len(wall.unseen):
        known["unseen"] = _points(wall.unseen)
    return {"id": int(wall.id), "start": start, "end": end, **sigmas, **known}


def _room_to_json(room: Room) -> dict[str, Any]:
    out: dict[str, Any] = {"id": int(room.id), "name": room.name, "polygon": _points(room.polygon)}
    if room.ceiling_height is not None:
        out |= {"ceiling_height": _rounded(room.ceiling_height), "sigma_ceiling": _rounded(room.sigma_ceiling)}
    out |= {"area": _rounded(room.area), "perimeter": _rounded(room.perimeter)}
    if room.corner_covariances is not None:
        out["corner_covariances"] = _covariances_to_json(room.corner_covariances)
    return out


def _covariances_to_json(covariances: Array) -> list[list[float] | None]:
    """xx, xy and yy of each (n, 2, 2), in m^2 to a square micrometre."""
    entries = [(c[0, 0], c[0, 1], c[1, 1]) if np.isfinite(c).all() else None for c in covariances]
    return [entry and [round(float(v), 2 * _DECIMALS) + 0.0 for v in entry] for entry in entries]


def _dimension_to_json(dimension: Dimension) -> dict[str, Any]:
    start, end = _points(np.stack([dimension.start, dimension.end]))
    room = int(dimension.room) if dimension.room >= 0 else None
    between = {"room": room, "walls": [int(w) for w in dimension.walls], "start": start, "end": end}
    return between | {"distance": _rounded(dimension.distance), "sigma": _rounded(dimension.sigma)}


def _opening_to_json(opening: Opening) -> dict[str, Any]:
    start, end = _points(np.stack([opening.start, opening.end]))
    extent = {"start": start, "end": end, "bottom": _rounded(opening.bottom), "top": _rounded(opening.top)}
    more = {"sigma_top": _rounded(opening.sigma_top)} | ({"open": True} if opening.open else {})
    more |= {} if opening.depth is None else {"depth": _rounded(opening.depth)}
    more |= {} if opening.sigma_jambs is None else {"sigma_jambs": _rounded(opening.sigma_jambs)}
    return {"id": int(opening.id), "type": opening.type, "wall": int(opening.wall), **extent, **more}


def _object_to_json(thing: FloorObject) -> dict[str, Any]:
    out: dict[str, Any] = {"id": int(thing.id), "footprint": _points(thing.footprint)}
    if thing.top is not None:
        out |= {"bottom": _rounded(thing.bottom), "top": _rounded(thing.top)}
    if thing.legs:
        out["legs"] = [_points(leg) for leg in thing.legs]
    return out


def _check_ids(layout: Layout, where: str) -> None:
    for kind in ("walls", "rooms", "openings", "objects"):
        seen: set[int] = set()
        for item in getattr(layout, kind):
            if item.id in seen:
                raise InputError(f"{where}: {kind} hold the id {item.id} twice, expected each id once")
            seen.add(item.id)
    walls = {w.id for w in layout.walls}
    for opening in layout.openings:
        if opening.wall not in walls:
            raise InputError(f"{where}: opening {opening.id} is in wall {opening.wall}, which is not in walls")


class _Reader:
    """Checked access to JSON values; every error names the file and the place in it."""

    def __init__(self, where: str) -> None:
        self.where = where

    def fail(self, place: str, value: Any, expected: str) -> InputError:
        return InputError(f"{self.where}: {place} is {value!r}, expected {expected}")

    def mapping(self, value: Any, place: str) -> dict[str, Any]:
        if not isinstance(value, dict):
            raise self.fail(place, value, "an object")
        return value

    def items(self, data: dict[str, Any], key: str) -> list[Any]:
        value = data.get(key, [])
        if not isinstance(value, list):
            raise self.fail(key, value, "a list")
        return value

    def number(self, data: dict[str, Any], key: str, place: str, default: float | None = None) -> float:
        value = data.get(key, default)
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
            raise self.fail(f"{place}.{key}", value, "a number")
        return float(value)

    def optional(self, data: dict[str, Any], key: str, place: str) -> float | None:
        return None if data.get(key) is None else self.number(data, key, place)

    def sigma(self, data: dict[str, Any], key: str, place: str) -> float:
        return math.inf if data.get(key, 0.0) is None else self.number(data, key, place, 0.0)

    def integer(self, data: dict[str, Any], key: str, place: str, default: int | None = None) -> int:
        value = data.get(key, default)
        if isinstance(value, bool) or not isinstance(value, int) or value < 0:
            raise self.fail(f"{place}.{key}", value, "a whole number from 0")
        return value

    def flag(self, data: dict[str, Any], key: str, place: str) -> bool:
        value = data.get(key, False)
        if not isinstance(value, bool):
            raise self.fail(f"{place}.{key}", value, "true or false")
        return value

    def text(self, data: dict[str, Any], key: str, place: str, default: str, allowed: tuple[str, ...] = ()) -> str:
        value = data.get(key, default)
        if not isinstance(value, str) or (allowed and value not in allowed):
            raise self.fail(f"{place}.{key}", value, "one of " + ", ".join(allowed) if allowed else "a text")
        return value

    def point(self, value: Any, place: str) -> Array:
        if not isinstance(value, list) or len(value) != 2:
            raise self.fail(place, value, "[x, y]")
        pair = {"x": value[0], "y": value[1]}
        return np.array([self.number(pair, "x", place), self.number(pair, "y", place)])

    def polygon(self, value: Any, place: str) -> Array:
        if not isinstance(value, list) or len(value) < 3:
            raise self.fail(place, value, "a list of at least three points")
        return self.points(value, place)

    def points(self, values: list[Any], place: str) -> Array:
        return np.array([self.point(p, f"{place}[{i}]") for i, p in enumerate(values)]).reshape(-1, 2)

    def wall(self, value: Any, place: str) -> Wall:
        data = self.mapping(value, place)
        source: Source = self.text(data, "source", place, "lidar", get_args(Source))  # type: ignore[assignment]
        return Wall(
            id=self.integer(data, "id", place),
            start=self.point(data.get("start"), f"{place}.start"),
            end=self.point(data.get("end"), f"{place}.end"),
            sigma_offset=self.sigma(data, "sigma_offset", place),
            sigma_angle=self.sigma(data, "sigma_angle", place),
            source=source,
            observations=self.integer(data, "observations", place, 0),
            thickness=self.optional(data, "thickness", place),
            unseen=self.points(self.items(data, "unseen"), f"{place}.unseen"),
        )

    def room(self, value: Any, place: str) -> Room:
        data = self.mapping(value, place)
        room_id = self.integer(data, "id", place)
        polygon = self.polygon(data.get("polygon"), f"{place}.polygon")
        height = self.optional(data, "ceiling_height", place)
        sigma = self.optional(data, "sigma_ceiling", place)
        name = self.text(data, "name", place, f"room {room_id}")
        corners = data.get("corner_covariances")
        if corners is not None:
            corners = self.covariances(corners, len(polygon), f"{place}.corner_covariances")
        return Room(room_id, name, polygon, height, sigma, corners)

    def covariances(self, value: Any, count: int, place: str) -> Array:
        if not isinstance(value, list) or len(value) != count:
            raise self.fail(place, value, f"{count} entries, one for each corner")
        out = np.full((count, 2, 2), np.nan)
        for i, entry in enumerate(value):
            if entry is not None:
                if not isinstance(entry, list) or len(entry) != 3:
                    raise self.fail(f"{place}[{i}]", entry, "[xx, xy, yy] or null")
                named = dict(zip(("xx", "xy", "yy"), entry, strict=True))
                xx, xy, yy = (self.number(named, key, f"{place}[{i}]") for key in named)
                out[i] = [[xx, xy], [xy, yy]]
        return out

    def dimension(self, value: Any, place: str) -> Dimension:
        data = self.mapping(value, place)
        walls = self.items(data, "walls")
        if len(walls) != 2:
            raise self.fail(f"{place}.walls", walls, "the ids of two walls")
        named = {"first": walls[0], "second": walls[1]}
        return Dimension(
            room=-1 if data.get("room") is None else self.integer(data, "room", place),
            walls=(self.integer(named, "first", f"{place}.walls"), self.integer(named, "second", f"{place}.walls")),
            start=self.point(data.get("start"), f"{place}.start"),
            end=self.point(data.get("end"), f"{place}.end"),
            sigma=self.sigma(data, "sigma", place),
        )

    def opening(self, value: Any, place: str) -> Opening:
        data = self.mapping(value, place)
        kind: OpeningType = self.text(data, "type", place, "", get_args(OpeningType))  # type: ignore[assignment]
        return Opening(
            id=self.integer(data, "id", place),
            type=kind,
            wall=self.integer(data, "wall", place),
            start=self.point(data.get("start"), f"{place}.start"),
            end=self.point(data.get("end"), f"{place}.end"),
            bottom=self.number(data, "bottom", place, 0.0),
            top=self.number(data, "top", place),
            open=self.flag(data, "open", place),
            sigma_top=self.optional(data, "sigma_top", place),
            depth=self.optional(data, "depth", place),
            sigma_jambs=self.optional(data, "sigma_jambs", place),
        )

    def object(self, value: Any, place: str) -> FloorObject:
        data = self.mapping(value, place)
        return FloorObject(
            id=self.integer(data, "id", place),
            footprint=self.polygon(data.get("footprint"), f"{place}.footprint"),
            bottom=self.number(data, "bottom", place, 0.0),
            top=self.optional(data, "top", place),
            legs=tuple(self.polygon(leg, f"{place}.legs[{i}]") for i, leg in enumerate(self.items(data, "legs"))),
        )
