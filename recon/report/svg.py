"""Pictures of lines and areas within the page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape
from typing import TYPE_CHECKING

import numpy as np

from recon.geometry import Array
from recon.polygons import polygons

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

MARGIN = 0.03
"""Of the width, on every side."""


@dataclass(frozen=True)
class Frame:
    """A map in a picture. low: (2,) m, its lower left corner after `turn`; scale: units of the picture a metre.

    width, height: units. turn: (2, 2) rotation from the map to the picture's axes.
    """

    low: Array
    scale: float
    width: float
    height: float
    turn: Array = field(default_factory=lambda: np.eye(2))

    @classmethod
    def around(cls, points: Array, width: float, turn: Array | None = None) -> Frame:
        """All of `points` (N, 2), already turned, and a margin."""
        low, extent = points.min(axis=0), np.maximum(np.ptp(points, axis=0), 0.1)
        scale = width * (1 - 2 * MARGIN) / extent[0]
        margin = MARGIN * width / scale
        return cls(low - margin, scale, width, (extent[1] + 2 * margin) * scale, np.eye(2) if turn is None else turn)

    def place(self, points: Array) -> Array:
        """Points (N, 2) of the map, m, in the picture, y downwards."""
        there = (np.asarray(points) @ self.turn.T - self.low) * self.scale
        return np.column_stack([there[:, 0], self.height - there[:, 1]])

    def line(self, points: Array, closed: bool = False) -> str:
        """Path through points (N, 2) of the map, m."""
        places = self.place(points)
        return "M" + " ".join(f"{x:.1f},{y:.1f}" for x, y in places) + ("Z" if closed else "")

    def area(self, shape: BaseGeometry) -> str:
        """Path around a shape of the map; holes stay open with the rule evenodd."""
        import shapely

        rings = [ring for p in polygons(shape) for ring in (p.exterior, *p.interiors)]
        return "".join(self.line(shapely.get_coordinates(ring)[:-1], closed=True) for ring in rings)

    def svg(self, kind: str, words: str, parts: Sequence[str]) -> str:
        """The picture; words: what it shows, for who cannot see it."""
        body = "\n".join(part for part in parts if part)
        size = f"0 0 {self.width:.0f} {self.height:.0f}"
        return f'<svg class="{kind}" viewBox="{size}" role="img" aria-label="{escape(words)}">\n{body}\n</svg>'
