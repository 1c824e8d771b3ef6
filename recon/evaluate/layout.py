"""Everything that a true layout says of an estimated one but the walls' completeness (`walls.py`)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from recon.evaluate.heights import HeightErrors, height_errors
from recon.evaluate.openings import OpeningScores, opening_scores
from recon.evaluate.rooms import RoomScores, room_scores
from recon.evaluate.score import Score
from recon.evaluate.sigmas import Calibration, SigmaScores, sigma_scores
from recon.model import Layout


@dataclass(frozen=True)
class LayoutScores:
    """Rooms, openings, heights and sigmas; both layouts in the map frame, as they are."""

    rooms: RoomScores
    openings: OpeningScores
    heights: HeightErrors
    sigmas: SigmaScores

    def to_json(self) -> dict[str, Any]:
        """Plain values; lengths in m, angles in rad."""
        rest = {"openings": self.openings.to_json(), "heights": self.heights.to_json()}
        return self.rooms.to_json() | rest | {"sigmas": self.sigmas.to_json()}

    def rows(self) -> list[tuple[str, str]]:
        """Name and value of every line for a terminal."""
        return self._room_rows() + self._opening_rows() + self._sigma_rows()

    def _room_rows(self) -> list[tuple[str, str]]:
        r = self.rooms
        area = f"{r.area_error:.2%} in the median room, {r.total_area_error:+.2%} in all"
        rows = [("rooms", f"{_score(r.rooms)}, IoU {r.iou:.3f}"), ("area", area)]
        for c in r.corners:
            rows.append((f"corners within {c.threshold:.2f} m", _score(c.corners)))
            rows.append((f"angles within {c.threshold:.2f} m", _score(c.angles)))
        return rows

    def _opening_rows(self) -> list[tuple[str, str]]:
        o, h = self.openings, self.heights
        rows = [(f"{name}s", _score(score)) for name, score in o.by_type.items() if score.found or score.true]
        if o.any_type.right:
            errors = f", middle {o.middle * 100:.1f} cm, width {o.width * 100:.1f} cm in the median"
            rows.append(("openings of any type", _score(o.any_type) + errors))
        ceilings = ("ceilings", h.ceilings, h.unknown_ceilings)
        for name, values, unknown in (ceilings, ("heads of doors and passages", h.tops, h.unknown_tops)):
            if values:
                size = np.abs(values) * 100
                more = f", {unknown} unknown" if unknown else ""
                value = f"{np.median(size):.1f} cm in the median of {len(size)}, {size.max():.1f} cm worst{more}"
                rows.append((name, value))
        return rows

    def _sigma_rows(self) -> list[tuple[str, str]]:
        parts = {"offset": self.sigmas.offset, "angle": self.sigmas.angle, "dimension": self.sigmas.dimension}
        return [(f"walls' sigma of the {name}", _shares(part)) for name, part in parts.items() if len(part.ratios)]


def layout_scores(estimate: Layout, truth: Layout) -> LayoutScores | None:
    """Compare two layouts in one frame; None where the truth has no rooms."""
    if not truth.rooms:
        return None
    return LayoutScores(
        room_scores(estimate.rooms, truth.rooms),
        opening_scores(estimate, truth),
        height_errors(estimate, truth),
        sigma_scores(estimate, truth),
    )


def _score(s: Score) -> str:
    return f"precision {s.precision:.3f}, recall {s.recall:.3f}, F1 {s.f1:.3f} ({s.found} found of {s.true})"


def _shares(c: Calibration) -> str:
    one, two = c.within(1.0), c.within(2.0)
    return f"{one:.0%} within 1, {two:.0%} within 2 (honest: 68 %, 95 %), {len(c.ratios)} walls"
