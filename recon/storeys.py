"""Several results in one building: storeys one above the other, drives side by side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from recon.errors import InputError
from recon.merge import merged
from recon.model import Model


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
    """Storeys from the lowest up, their names all different."""

    name: str
    storeys: tuple[Storey, ...]


DEFAULT_STOREY = "Ground"


def one_storey(model: Model) -> Building:
    """A building of a single model: its floor at elevation 0."""
    return Building(model.name, (Storey(DEFAULT_STOREY, 0.0, model),))


def stack(name: str, storeys: Sequence[Storey]) -> Building:
    """A building from storeys in any order; those of the same name are drives on one floor and become one storey.

    Raises InputError when two of the same name differ in elevation, or two of different names share one.
    """
    by_name: dict[str, list[Storey]] = {}
    for storey in storeys:
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
    return Building(name, tuple(floors))
