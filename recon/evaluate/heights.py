"""Ceilings and the heads of doors and passages against the true layout."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from recon.evaluate.openings import matched_openings
from recon.evaluate.rooms import matched_rooms
from recon.model import Layout, Room


@dataclass(frozen=True)
class HeightErrors:
    """Estimate minus truth, m: ceilings of matched rooms, heads of right doors and passages.

    unknown_ceilings: matched rooms whose ceiling the estimate leaves open though the truth knows it; unknown_tops:
    right doors and passages whose head no image showed, so that `top` is a default.
    """

    ceilings: tuple[float, ...]
    unknown_ceilings: int
    tops: tuple[float, ...]
    unknown_tops: int

    def to_json(self) -> dict[str, Any]:
        """Medians of the absolute values and the largest; None where nothing was compared."""
        ceilings, tops = _summary(self.ceilings), _summary(self.tops)
        return {
            "ceilings": ceilings | {"unknown": self.unknown_ceilings},
            "tops": tops | {"unknown": self.unknown_tops},
        }


def height_errors(estimate: Layout, truth: Layout) -> HeightErrors:
    """Rooms as `matched_rooms` pairs them, openings as `matched_openings` does."""
    ceilings, unknown = [], 0
    for i, j in matched_rooms(estimate.rooms, truth.rooms):
        mine, true = _ceiling(estimate, estimate.rooms[i]), _ceiling(truth, truth.rooms[j])
        if mine is not None and true is not None:
            ceilings.append(mine - true)
        unknown += mine is None and true is not None
    mine_openings, theirs = ([o for o in layout.openings if o.type != "window"] for layout in (estimate, truth))
    pairs = matched_openings(estimate, mine_openings, truth, theirs)
    tops = [float(a.top - b.top) for a, b in pairs if a.sigma_top is not None]
    return HeightErrors(tuple(ceilings), unknown, tuple(tops), len(pairs) - len(tops))


def _ceiling(layout: Layout, room: Room) -> float | None:
    return layout.ceiling_height if room.ceiling_height is None else room.ceiling_height


def _summary(values: tuple[float, ...]) -> dict[str, float | int | None]:
    size = np.abs(values)
    known = len(size) > 0
    return {
        "compared": len(size),
        "median": float(np.median(size)) if known else None,
        "worst": float(size.max()) if known else None,
    }
