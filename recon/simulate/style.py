"""Colours and materials of a simulated building, drawn from a seed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from recon.simulate.canvas import Colour
from recon.simulate.plan import FloorStyle, PlanLook

WALL_COLOURS: tuple[Colour, ...] = (
    (0.86, 0.84, 0.79), (0.90, 0.89, 0.86), (0.80, 0.83, 0.82), (0.85, 0.80, 0.70), (0.78, 0.80, 0.86),
)  # fmt: skip
ACCENTS: tuple[Colour, ...] = (
    (0.36, 0.52, 0.57), (0.66, 0.45, 0.36), (0.45, 0.55, 0.42), (0.72, 0.62, 0.38), (0.45, 0.47, 0.60),
)  # fmt: skip
TRIMS: tuple[Colour, ...] = ((0.30, 0.28, 0.27), (0.42, 0.32, 0.24), (0.93, 0.92, 0.90), (0.45, 0.46, 0.48))
DOORS: tuple[Colour, ...] = ((0.52, 0.34, 0.20), (0.64, 0.47, 0.30), (0.30, 0.42, 0.55), (0.80, 0.79, 0.76))
FLOORS: dict[FloorStyle, tuple[tuple[Colour, Colour], ...]] = {
    "tiles": (((0.70, 0.68, 0.64), (0.48, 0.46, 0.44)), ((0.60, 0.56, 0.50), (0.38, 0.36, 0.33))),
    "checker": (((0.78, 0.75, 0.68), (0.42, 0.37, 0.33)), ((0.74, 0.74, 0.72), (0.34, 0.40, 0.42))),
    "planks": (((0.62, 0.46, 0.31), (0.28, 0.20, 0.13)), ((0.70, 0.58, 0.43), (0.35, 0.28, 0.20))),
    "carpet": (((0.42, 0.44, 0.47), (0.36, 0.38, 0.41)), ((0.50, 0.42, 0.38), (0.44, 0.36, 0.33))),
}


@dataclass(frozen=True)
class RoomStyle:
    """What one room looks like. accent_wall: which of its walls has the accent colour, -1 none. tile: m.

    band: height of a darker lower part of the walls, m, 0 none. border: whether a dark strip runs round the floor.
    """

    wall: Colour
    accent: Colour
    accent_wall: int
    band: float
    trim: Colour
    frame: Colour
    door: Colour
    floor: FloorStyle
    floor_colours: tuple[Colour, Colour]
    tile: float
    border: bool
    panels: bool


def room_styles(look: PlanLook, walls: list[int], seed: int) -> list[RoomStyle]:
    """One style a room (`walls`: its number of walls); trim and frames are the whole building's."""
    rng = np.random.default_rng([seed, 11])
    trim, frame, door = (group[rng.integers(len(group))] for group in (TRIMS, TRIMS, DOORS))
    if np.ptp(np.subtract(door, frame)) < 0.1:
        frame = TRIMS[0]
    return [_room_style(look, count, (trim, frame, door), rng) for count in walls]


def _room_style(
    look: PlanLook, walls: int, building: tuple[Colour, Colour, Colour], rng: np.random.Generator
) -> RoomStyle:
    kinds: list[FloorStyle] = list(FLOORS)
    drawn = kinds[rng.integers(len(kinds))]
    floor = drawn if look.floor is None else look.floor
    choices = FLOORS[floor]
    return RoomStyle(
        wall=WALL_COLOURS[rng.integers(len(WALL_COLOURS))],
        accent=ACCENTS[rng.integers(len(ACCENTS))],
        accent_wall=int(rng.integers(walls)) if rng.random() < 0.6 else -1,
        band=float(rng.uniform(0.9, 1.2)) if rng.random() < 0.25 else 0.0,
        trim=building[0], frame=building[1], door=building[2],
        floor=floor,
        floor_colours=choices[rng.integers(len(choices))],
        tile=float(rng.choice([0.3, 0.4, 0.5, 0.6])),
        border=bool(rng.random() < 0.3),
        panels=bool(rng.random() < 0.7),
    )  # fmt: skip
