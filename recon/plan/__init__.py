"""Plans: the layout from above, and the one drawing that every writer of plans renders."""

from __future__ import annotations

from recon.plan.walls import (
    DRAWN_THICKNESS,
    dominant_angle,
    label_spot,
    opening_ends,
    opening_span,
    room_area,
    solid_pieces,
    unseen_bodies,
    unseen_pieces,
    wall_bodies,
)

__all__ = [
    "DRAWN_THICKNESS",
    "dominant_angle",
    "label_spot",
    "opening_ends",
    "opening_span",
    "room_area",
    "solid_pieces",
    "unseen_bodies",
    "unseen_pieces",
    "wall_bodies",
]
