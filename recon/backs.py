"""What a building has beyond the faces that are seen from its rooms: backs, ends and tops of walls, roof, underside."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from recon.body import building_body
from recon.faces import triangulate
from recon.facing import rooms_before
from recon.geometry import Array, plane_axes
from recon.holes import room_height
from recon.model import Face, FaceKind, Layout
from recon.polygons import areas
from recon.solids import wall_solids

LEVEL = 3e-3
"""m: a face this near to the plane of the body's side lies in it."""
SLIVER = 1e-3
"""m: half the width of leftovers that are left out."""
SMALLEST = 1e-3
"""m^2 of a back, at least."""
NEAR = 0.01
"""m before and behind a back, where it is asked what is there."""
UP_OF_LEVEL = (0.0, 1.0, 0.0)
"""What is up on a roof's picture."""
PARALLEL = float(np.cos(np.radians(1.0)))


def back_faces(layout: Layout, faces: tuple[Face, ...], outside: bool, ceiling: bool = True) -> tuple[Face, ...]:
    """Faces without textures that close the building's body (`recon.body`) where `faces` leave it open, map frame.

    Always: those that are seen from a room (the other side of a wall that stands in it) and those of walls that face
    no room. outside: all others, too. ceiling: as in the body. `back_000` are upright, `roof_000` look up (tops of
    walls, too), `underside_000` down; none belongs to a wall or room (`ref` is -1).
    """
    vertices, triangles = building_body(layout, ceiling)
    sides = _Sides(faces)
    seen = _Seen(layout, outside)
    out: list[Face] = []
    count = {"back": 0, "roof": 0, "underside": 0}
    for side in _flat_sides(vertices, triangles):
        for flat, corners, (axes, level) in sides.uncovered(vertices[side]):
            points = flat @ axes[:2] + level * axes[2]
            if not seen(points[corners].mean(axis=1), axes[2]):
                continue
            kind, name = _kind(axes[2])
            size = np.maximum(np.ptp(flat, axis=0), 1e-9)
            uv = (flat - flat.min(axis=0)) / size
            out.append(Face(f"{name}_{count[name]:03d}", kind, -1, points.round(6) + 0.0, corners, uv))
            count[name] += 1
    return tuple(out)


def _kind(normal: Array) -> tuple[FaceKind, str]:
    if abs(normal[2]) < 0.5:
        return "wall", "back"
    return ("ceiling", "roof") if normal[2] > 0 else ("floor", "underside")


def _flat_sides(vertices: Array, triangles: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    """Triangles (n, 3) of every flat side of a closed mesh."""
    import trimesh

    if len(triangles) == 0:
        return []
    mesh = trimesh.Trimesh(vertices, triangles, process=False)
    groups = [np.sort(group) for group in mesh.facets]
    single = np.setdiff1d(np.arange(len(triangles)), np.concatenate([np.zeros(0, np.int64), *groups]))
    groups += [np.array([k]) for k in single]
    return [triangles[group] for group in sorted(groups, key=lambda group: int(group[0]))]


class _Sides:
    """Faces by their planes."""

    def __init__(self, faces: tuple[Face, ...]) -> None:
        self._faces = [face for face in faces if len(face.triangles)]
        self._normals = np.array([face.normal for face in self._faces]).reshape(-1, 3)
        self._low = np.array([face.vertices.min(axis=0) for face in self._faces]).reshape(-1, 3)
        self._high = np.array([face.vertices.max(axis=0) for face in self._faces]).reshape(-1, 3)

    def uncovered(self, corners: Array) -> list[tuple[Array, NDArray[np.int64], tuple[Array, float]]]:
        """Parts of a flat side (n, 3, 3) with no face on them: vertices (V, 2), triangles, axes (3, 3) and level, m.

        The axes are right, up and normal; a vertex is `flat @ axes[:2] + level * axes[2]`.
        """
        import shapely

        cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]).sum(axis=0)
        if np.linalg.norm(cross) < SMALLEST:
            return []
        axes = plane_axes(cross / np.linalg.norm(cross), UP_OF_LEVEL)
        level = float(np.mean(corners.reshape(-1, 3) @ axes[2]))
        side = shapely.union_all(shapely.make_valid(shapely.polygons(corners @ axes[:2].T)), grid_size=1e-6)
        covered = [self._outline(k, axes) for k in self._on(corners.reshape(-1, 3), axes[2], level)]
        rest = shapely.difference(side, shapely.union_all(covered), grid_size=1e-6) if covered else side
        rest = areas(rest).buffer(-SLIVER, join_style="mitre").buffer(SLIVER, join_style="mitre")
        parts = shapely.get_parts(areas(shapely.intersection(rest, side, grid_size=1e-6)))
        return [(*triangulate(part), (axes, level)) for part in parts if part.area >= SMALLEST]

    def _on(self, corners: Array, normal: Array, level: float) -> list[int]:
        """Faces that look the same way and lie in the plane, where the corners (n, 3) of the side are."""
        low, high = corners.min(axis=0) - LEVEL, corners.max(axis=0) + LEVEL
        near = (self._normals @ normal > PARALLEL) & (self._low <= high).all(axis=1) & (self._high >= low).all(axis=1)
        found = np.flatnonzero(near).tolist()
        return [k for k in found if float(np.abs(self._faces[k].vertices @ normal - level).max()) < LEVEL]

    def _outline(self, k: int, axes: Array) -> Any:
        import shapely

        face = self._faces[k]
        flat = face.vertices @ axes[:2].T
        return shapely.union_all(shapely.polygons(flat[face.triangles]), grid_size=1e-6).buffer(SLIVER / 2)


class _Seen:
    """Which parts of the body are wanted."""

    def __init__(self, layout: Layout, outside: bool) -> None:
        import shapely

        before, solids = rooms_before(layout), wall_solids(layout)
        alone = [s.footprint for s in solids if all(before[wall.id] is None for wall in s.faces)]
        self._rooms = shapely.STRtree([shapely.make_valid(shapely.Polygon(room.polygon)) for room in layout.rooms])
        self._heights = np.array([room_height(layout, room) for room in layout.rooms])
        self._alone, self._thin = shapely.STRtree(alone), shapely.STRtree([s.footprint for s in solids if s.flat])
        self._outside = outside

    def __call__(self, points: Array, normal: Array) -> bool:
        """Whether a part is: points (n, 3) on it, and its normal. Walls without thickness have two faces, no backs."""
        import shapely

        ahead, behind = points + NEAR * normal, shapely.points((points - NEAR / 2 * normal)[:, :2])
        if abs(normal[2]) < 0.5 and len(self._thin.query(behind, predicate="within")[0]):
            return False
        if self._outside:
            return True
        k, room = self._rooms.query(shapely.points(ahead[:, :2]), predicate="within")
        if bool(((ahead[k, 2] > 0) & (ahead[k, 2] < self._heights[room])).any()):
            return True
        return bool(len(self._alone.query(behind, predicate="within")[0]))
