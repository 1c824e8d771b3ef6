"""The whole building as a doll's house: seen from above at an angle, ceilings off, walls that face away cut down."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import TYPE_CHECKING

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.faces import triangulate
from recon.geometry import Array
from recon.model import Face, Layout, Model
from recon.occlusion import ambient_shades
from recon.plan import dominant_angle, room_area, wall_bodies
from recon.polygons import polygons
from recon.render import TexturedScene

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

ELEVATION = np.radians(52.0)
TURN = np.radians(28.0)
"""Of the view away from the walls' main direction: both directions of walls are seen, one better."""
CURB = 0.1  # m, what is left of walls that would stand in the way
BASE = 0.12  # m, board under the floor
MARGIN = 0.06  # of the picture, on each side
CUT_COLOUR, SIDE_COLOUR, BASE_COLOUR = (62, 66, 74), (196, 193, 187), (226, 224, 220)


def render_dollhouse(model: Model, size: tuple[int, int] = (1600, 1000)) -> NDArray[np.uint8]:
    """The model from above at an angle, on white, with soft shadows: size is (width, height) in pixels; (H, W, 3) RGB.

    Parallel projection. Faces that look away from the viewer are left out, so one looks into every room; the bodies of
    walls are drawn DRAWN_THICKNESS thick (`recon.plan`), which is not measured.
    """
    view = _best_view(model)
    visible = _toward(model, view)
    solids = _solids(model, {f.ref for f in visible if f.kind == "wall"}, view)
    faces = (*visible, *solids)
    right, up = _image_axes(view)
    if not faces:
        return np.full((size[1], size[0], 3), 255, np.uint8)
    points = np.concatenate([f.vertices for f in faces])
    on_image = points @ np.stack([right, up], axis=1)
    low, high = on_image.min(axis=0), on_image.max(axis=0)
    pixel = float(np.max((high - low) / (np.array(size) * (1 - 2 * MARGIN))))
    centre, far = (low + high) / 2, float(np.ptp(points @ view)) + 1

    def rays(pixels: Array) -> tuple[Array, Array]:
        offsets = (pixels - (np.array(size) - 1) / 2) * [pixel, -pixel] + centre
        origins = offsets @ np.stack([right, up]) + (float((points @ view).min()) - far) * view
        return origins, np.broadcast_to(view, origins.shape)

    def pixels_of(spots: Array) -> Array:
        return (spots @ np.stack([right, up], axis=1) - centre) / [pixel, -pixel] + (np.array(size) - 1) / 2

    closed = tuple(f for f in model.faces if f.kind != "ceiling")
    ambient = [*ambient_shades(tuple(visible), closed), *[_open_air] * len(solids)]
    shades = [_lit(shade, face) for shade, face in zip(ambient, faces, strict=True)]
    canvas = _shadowed_ground(model.layout, size, pixels_of, pixel)
    picture = TexturedScene(faces, pixel_size=pixel, shades=shades, edge_samples=2).render(rays, canvas)
    return np.clip(np.rint(picture), 0, 255).astype(np.uint8)


def _toward(model: Model, view: Array) -> list[Face]:
    """Faces turned to the viewer but for ceilings; of openings only those in walls that are turned so."""
    turned = [f for f in model.faces if f.kind != "ceiling" and f.normal @ view < -1e-6]
    walls = {f.ref for f in turned if f.kind == "wall"}
    return [f for f in turned if f.opening is None or f.kind == "threshold" or f.ref in walls]


def _best_view(model: Model) -> Array:
    """Direction (3,) of view, downwards: of eight, the one that shows most wall that images saw."""
    main = dominant_angle(model.layout)
    angles = [main + quarter * np.pi / 2 + side * TURN for quarter in range(4) for side in (-1, 1)]
    views = [
        np.array([np.cos(a) * np.cos(ELEVATION), np.sin(a) * np.cos(ELEVATION), -np.sin(ELEVATION)]) for a in angles
    ]
    return max(views, key=lambda view: _shown(model, view))


def _shown(model: Model, view: Array) -> float:
    """Wall that the view shows, m2 as it appears; seen texture counts fully, the rest a tenth."""
    total = 0.0
    for wall in (f for f in model.faces if f.kind == "wall"):
        a, b, c = np.moveaxis(wall.vertices[wall.triangles], 1, 0)
        toward = float(-np.cross(b - a, c - a).sum(axis=0) @ view) / 2
        total += max(toward, 0.0) * (0.1 + (wall.seen_fraction if wall.texture is not None else 0.0))
    # A wide picture rather than a tall one, where all else is equal.
    points = np.concatenate([f.vertices for f in model.faces]) if model.faces else np.zeros((1, 3))
    width, height = (np.ptp(points @ axis) for axis in _image_axes(view))
    return total * (1 + 0.3 * float(width / max(width + height, 1e-9)))


def _image_axes(view: Array) -> tuple[Array, Array]:
    """Unit vectors (3,) to the right and up in the picture."""
    right = np.cross(view, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    return right, np.cross(right, view)


def _solids(model: Model, shown: set[int], view: Array) -> list[Face]:
    """Bodies behind the walls that are shown, curbs of the others, and the board under everything."""
    import shapely

    layout = model.layout
    tops = {f.ref: float(f.vertices[:, 2].max()) for f in model.faces if f.kind == "wall"}
    standing = tuple(w for w in layout.walls if w.id in shown)
    lines = shapely.MultiLineString([np.stack([w.start, w.end]) for w in standing])
    solids: list[Face] = []
    for top in sorted({tops[w.id] for w in standing}):
        walls = tuple(w for w in standing if tops[w.id] == top)
        solids += _extruded(wall_bodies(layout, walls, cut=False), 0.0, top, CUT_COLOUR, view, lines)
    low = tuple(w for w in layout.walls if w.id not in shown)
    curbs = wall_bodies(layout, low).difference(wall_bodies(layout, standing, cut=False))
    solids += _extruded(curbs, 0.0, CURB, CUT_COLOUR, view, lines)
    board = room_area(layout).union(wall_bodies(layout, cut=False))
    return solids + _extruded(board, -BASE, -0.005, BASE_COLOUR, view, shapely.MultiLineString())


def _extruded(
    area: BaseGeometry, bottom: float, top: float, colour: tuple[int, int, int], view: Array, walls: BaseGeometry
) -> list[Face]:
    """A prism over `area`: its top in `colour`, its sides toward the viewer but none on the lines `walls`."""
    import shapely

    faces: list[Face] = []
    for polygon in polygons(area, 1e-6):
        corners, triangles = triangulate(polygon)
        faces.append(_plain(np.column_stack([corners, np.full(len(corners), top)]), triangles, colour))
        oriented = shapely.orient_polygons(polygon)
        for ring in (oriented.exterior, *oriented.interiors):
            ends = np.array(ring.coords)
            faces += [_side(a, b, bottom, top) for a, b in pairwise(ends) if _is_shown(a, b, view, walls)]
    return faces


def _is_shown(a: Array, b: Array, view: Array, walls: BaseGeometry) -> bool:
    """Whether a side a-b, the solid on its left, faces the viewer and does not lie on the lines `walls`."""
    import shapely

    outward = np.array([b[1] - a[1], a[0] - b[0]])
    if np.linalg.norm(outward) < 1e-6 or outward @ view[:2] >= 0:
        return False
    return walls.distance(shapely.Point((a + b) / 2)) > 2e-3 or walls.is_empty


def _side(a: Array, b: Array, bottom: float, top: float) -> Face:
    vertices = np.array([[*a, bottom], [*b, bottom], [*b, top], [*a, top]])
    return _plain(vertices, np.array([[0, 1, 2], [0, 2, 3]]), SIDE_COLOUR)


def _plain(vertices: Array, triangles: NDArray[np.int64], colour: tuple[int, int, int]) -> Face:
    texture = np.array([[colour]], np.uint8)
    return Face("solid", "wall", -1, vertices, triangles, np.full((len(vertices), 2), 0.5), texture)


def _open_air(points: Array) -> Array:
    return np.ones(len(points))


def _lit(shade: Callable[[Array], Array], face: Face) -> Callable[[Array], Array]:
    """Ambient shade times a little sun from the left: walls of the two directions differ."""
    sun = 1.0 + 0.12 * float(face.normal @ np.array([0.35, -0.5, 0.79]))
    return lambda points: shade(points) * sun


def _shadowed_ground(
    layout: Layout, size: tuple[int, int], pixels_of: Callable[[Array], Array], pixel: float
) -> NDArray[np.float32]:
    """White, with the soft shadow of the board on it."""
    import shapely

    mask = np.zeros((size[1], size[0]), np.float32)
    footprint = room_area(layout).union(wall_bodies(layout, cut=False)).buffer(0.1)
    for polygon in polygons(footprint):
        rings = [shapely.get_coordinates(ring) for ring in (polygon.exterior, *polygon.interiors)]
        outlines = [pixels_of(np.column_stack([ring, np.full(len(ring), -3 * BASE)])) for ring in rings]
        cv2.fillPoly(mask, [np.rint(outline).astype(np.int32) for outline in outlines], 1.0)  # courts stay open
    mask = np.asarray(cv2.GaussianBlur(mask, (0, 0), max(0.3 / pixel, 1.0)))
    return np.asarray(255 * (1 - 0.28 * mask[..., None] * np.ones(3)), dtype=np.float32)
