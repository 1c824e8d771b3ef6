"""The sides of openings that one looks through: jambs, lintel and threshold, where the wall's thickness is known."""

from __future__ import annotations

import numpy as np

from recon.geometry import Array
from recon.model import Face, FaceKind, Layout, Opening, Wall

THICKEST = 0.7
"""m: openings farther from one another are not two ends of one way through a wall."""
BESIDE = 0.3
"""m along the wall between the middles of two such openings."""
QUAD = np.array([[0, 1, 2], [0, 2, 3]])


def reveals(layout: Layout) -> tuple[Face, ...]:
    """Four faces for every hole in a wall of known thickness: left jamb, right jamb, lintel, threshold; map frame.

    Each wall has the half on its side: `ref` of jambs and lintel is the wall, the threshold is floor. The thickness is
    the distance to the hole in the other face of the wall where there is one, else `Wall.thickness`.
    """
    holes = [(opening, layout.wall(opening.wall)) for opening in layout.openings if opening.is_hole]
    faces: list[Face] = []
    for opening, wall in holes:
        depth = _thickness(opening, wall, holes)
        if depth is not None:
            faces += _sides(opening, wall, depth / 2)
    return tuple(faces)


def _thickness(opening: Opening, wall: Wall, holes: list[tuple[Opening, Wall]]) -> float | None:
    middle = (opening.start + opening.end) / 2
    best: float | None = None
    for other, behind in holes:
        offset = (other.start + other.end) / 2 - middle
        depth = float(-offset @ wall.normal)
        facing = behind.normal @ wall.normal < -0.9 and abs(offset @ wall.direction) <= BESIDE
        if facing and 0.0 < depth <= THICKEST and (best is None or depth < best):
            best = depth
    return wall.thickness if best is None else best


def _sides(opening: Opening, wall: Wall, depth: float) -> list[Face]:
    """Faces turned to the inside of the opening, `depth` m deep."""
    start, end = sorted((opening.start, opening.end), key=lambda p: float((p - wall.start) @ wall.direction))
    back = -depth * wall.normal
    low, high = opening.bottom, opening.top
    ring = [start, end, end + back, start + back]  # seen from above clockwise, as the free space is to the left
    name = f"reveal_{opening.id:03d}"
    faces = [
        _quad(name, "wall", wall.id, [(ring[0], low), (ring[0], high), (ring[3], high), (ring[3], low)]),
        _quad(name, "wall", wall.id, [(ring[1], low), (ring[2], low), (ring[2], high), (ring[1], high)]),
        _quad(name, "wall", wall.id, [(point, high) for point in ring]),
    ]
    kind: FaceKind = "floor" if low <= 0.0 else "wall"
    return [*faces, _quad(name, kind, wall.id, [(point, low) for point in ring[::-1]])]


def _quad(name: str, kind: FaceKind, ref: int, corners: list[tuple[Array, float]]) -> Face:
    vertices = np.array([[x, y, z] for (x, y), z in corners])
    return Face(name, kind, ref, vertices, QUAD, np.zeros((4, 2)))
