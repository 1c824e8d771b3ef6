"""Openings in depth: how far back their sides go, and where they meet the other end of the way."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from recon.geometry import Array
from recon.holes import DECIMALS, Hole

THICKEST = 0.7
"""m: openings farther from one another are not two ends of one way through a wall ..."""
THINNEST = 0.02
"""... nor those that are nearer."""
BESIDE = 0.3
"""m along the wall between the middles of two such openings."""
FACING = -0.9
"""Product of the normals of their walls, at most."""
ASSUMED_DEPTH = 0.1
"""m that the sides of a hole go back where nothing says how thick the wall is."""
ASSUMED_LEAF = 0.05
"""m behind the wall's face where leaves and glass sit that nothing has measured."""


@dataclass(frozen=True)
class Niche:
    """A hole with its depth. front, back: the ground points (2,), m, below its left and right side.

    low, high: m above the floor, at the front and at the back. met: it ends where the one of the wall's other side
    does, halfway.
    """

    hole: Hole
    front: tuple[Array, Array]
    back: tuple[Array, Array]
    low: tuple[float, float]
    high: tuple[float, float]
    met: bool

    @property
    def depth(self) -> float:
        """m, in the middle."""
        behind = (self.front[0] + self.front[1] - self.back[0] - self.back[1]) / 2
        return float(behind @ self.hole.wall.normal)

    def corners(self) -> tuple[Array, Array]:
        """Of the front and of the back, each (4, 3), m: left and right below, right and left above."""
        (left, right), (left_back, right_back) = self.front, self.back
        ends = ((left, right, self.low[0], self.high[0]), (left_back, right_back, self.low[1], self.high[1]))
        front, back = (
            np.array([[*a, low], [*b, low], [*b, high], [*a, high]], dtype=np.float64) for a, b, low, high in ends
        )
        return front, back


def niches(holes: tuple[Hole, ...]) -> tuple[Niche, ...]:
    """Every hole with its depth.

    The two ends of a way through a wall meet halfway, corner to corner. The sides of other holes go back half of the
    wall's thickness, or ASSUMED_DEPTH; leaves and glass sit `Opening.depth` behind the wall, or ASSUMED_LEAF, and no
    deeper than half of a wall whose other side has an opening there, too.
    """
    ends = zip(holes, _other_ends(holes), strict=True)
    return tuple(_niche(hole, holes[k] if k >= 0 else None) for hole, k in ends)


def _niche(hole: Hole, behind: Hole | None) -> Niche:
    front = hole.ground(hole.left), hole.ground(hole.right)
    low, high = (hole.bottom, hole.bottom), (hole.top, hole.top)
    met = hole.opening.is_hole and behind is not None
    if met and behind is not None:
        beyond = behind.ground(behind.right), behind.ground(behind.left)
        left, right = (np.asarray(((a + b) / 2).round(DECIMALS)) for a, b in zip(front, beyond, strict=True))
        low, high = (low[0], (low[0] + behind.bottom) / 2), (high[0], (high[0] + behind.top) / 2)
    else:
        back = _depth(hole, behind) * hole.wall.normal
        left, right = (np.asarray((point - back).round(DECIMALS)) for point in front)
    return Niche(hole, front, (left, right), low, high, met)


def _depth(hole: Hole, behind: Hole | None) -> float:
    thickness = hole.wall.thickness
    if hole.opening.is_hole:
        return ASSUMED_DEPTH if thickness is None else thickness / 2
    depth = ASSUMED_LEAF if hole.opening.depth is None else max(hole.opening.depth, 0.0)
    if behind is not None:
        depth = min(depth, 0.45 * float((hole.middle - behind.middle) @ hole.wall.normal))
    return depth


def _other_ends(holes: tuple[Hole, ...]) -> list[int]:
    """Index of the hole straight behind each, in a wall that faces away; -1 unless the two are each other's nearest."""
    from scipy.spatial import cKDTree

    if not holes:
        return []
    middles = np.array([hole.middle for hole in holes])
    near = cKDTree(middles).query_ball_point(middles, np.hypot(THICKEST, BESIDE))
    nearest = [
        min(((_depth_to(hole, holes[k]), k) for k in ks), default=(np.inf, -1))
        for hole, ks in zip(holes, near, strict=True)
    ]
    ends = [k if np.isfinite(depth) else -1 for depth, k in nearest]
    return [k if k >= 0 and ends[k] == i else -1 for i, k in enumerate(ends)]


def _depth_to(hole: Hole, other: Hole) -> float:
    """m straight back to another hole that may be the other end of this one, else inf."""
    offset = other.middle - hole.middle
    depth = float(-offset @ hole.wall.normal)
    facing = other.wall.normal @ hole.wall.normal < FACING and abs(offset @ hole.wall.direction) <= BESIDE
    alike = other.opening.is_hole == hole.opening.is_hole
    return depth if facing and alike and THINNEST < depth <= THICKEST else np.inf
