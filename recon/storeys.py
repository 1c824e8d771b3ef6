"""Several results in one building: storeys one above the other, drives side by side."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

from recon.errors import InputError
from recon.holes import room_height
from recon.merge import merged
from recon.model import Model, Room
from recon.polygons import areas

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry


@dataclass(frozen=True)
class Storey:
    """One level of a building. elevation: m from the building's zero to this floor.

    model: x and y are the building's, z counts from this floor (its floors lie at z = 0, as in every model).
    """

    name: str
    elevation: float
    model: Model


@dataclass(frozen=True)
class Building:
    """Storeys from the lowest up, their names all different. notes: what is odd about how they lie, for people."""

    name: str
    storeys: tuple[Storey, ...]
    notes: tuple[str, ...] = ()


DEFAULT_STOREY = "Ground"
GRID = 1e-6
"""m: to which rooms are compared."""
SHARED = 0.1
"""m^2: rooms of two storeys that share less do not lie one over the other."""


def one_storey(model: Model) -> Building:
    """A building of a single model: its floor at elevation 0."""
    return Building(model.name, (Storey(DEFAULT_STOREY, 0.0, model),))


def stack(name: str, storeys: Sequence[Storey]) -> Building:
    """A building from storeys in any order; those of the same name are drives on one floor and become one storey.

    Raises InputError when two of the same name differ in elevation, two of different names share one, or a name is
    empty or an elevation no number.
    """
    by_name: dict[str, list[Storey]] = {}
    for storey in storeys:
        if not storey.name.strip():
            raise InputError(f"storey at {storey.elevation:g} m: has no name, expected one such as {DEFAULT_STOREY}")
        if not math.isfinite(storey.elevation):
            raise InputError(f"storey {storey.name!r}: elevation {storey.elevation} m, expected a number")
        by_name.setdefault(storey.name, []).append(storey)
    floors: list[Storey] = []
    for title, parts in by_name.items():
        heights = sorted({part.elevation for part in parts})
        if len(heights) > 1:
            raise InputError(f"storey {title!r}: elevations {heights[0]:g} and {heights[1]:g} m, expected one a name")
        model = parts[0].model if len(parts) == 1 else merged([part.model for part in parts])
        floors.append(Storey(title, heights[0], model))
    floors.sort(key=lambda floor: floor.elevation)
    for below, above in pairwise(floors):
        if below.elevation == above.elevation:
            names = f"storeys {below.name!r} and {above.name!r}"
            raise InputError(f"{names}: both at elevation {above.elevation:g} m, expected one name a level")
    notes = (_clash(below, above) for below, above in pairwise(floors))
    return Building(name, tuple(floors), tuple(note for note in notes if note is not None))


def headroom(below: Storey, above: Storey) -> float | None:
    """m from the highest ceiling of a storey to the floor above it, where rooms lie over rooms; None where none do."""
    import shapely

    over = shapely.union_all([_ground(room) for room in above.model.layout.rooms])
    layout = below.model.layout
    under = [room for room in layout.rooms if shapely.intersection(_ground(room), over, grid_size=GRID).area > SHARED]
    if not under:
        return None
    return above.elevation - below.elevation - max(room_height(layout, room) for room in under)


def _ground(room: Room) -> BaseGeometry:
    import shapely

    return areas(shapely.make_valid(shapely.Polygon(room.polygon)))


def _clash(below: Storey, above: Storey) -> str | None:
    """A line for people where a floor lies below the ceiling under it."""
    left = headroom(below, above)
    if left is None or left >= 0:
        return None
    floor, ceiling = above.elevation, above.elevation - left
    return (
        f"The floor of storey {above.name!r} ({floor:.2f} m) lies below ceilings of {below.name!r} ({ceiling:.2f} m)."
    )
