"""Which surface every pixel of an image shows (the paper's Fig. 1c; `labels/` of FORMAT.md)."""

from __future__ import annotations

import colorsys

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.faces import extrude
from recon.geometry import Array, Pose3
from recon.model import Face, FloorObject, Layout
from recon.prisms import prism
from recon.raycast import RayScene
from recon.sequence.camera import Camera

Labels = NDArray[np.uint16]

UNLABELLED, FLOOR, CEILING, OBJECT, FIRST_WALL = 0, 1, 2, 3, 10
"""Label values; wall k is FIRST_WALL + k."""
CELL = 4
"""Pixels: rays are cast at the corners of such cells first, and at every pixel only where the corners differ."""
PLAIN_COLOURS = {FLOOR: (90, 160, 90), CEILING: (215, 215, 215), OBJECT: (60, 60, 230)}
"""BGR."""
OPACITY = 0.45
SMALLEST_WRITTEN = 12.0
"""Pixels from the boundary: smaller regions get no number."""


class LabelRenderer:
    """Labels of many images of one camera in one model."""

    def __init__(self, faces: tuple[Face, ...], camera: Camera, objects: tuple[FloorObject, ...] = ()) -> None:
        """faces: as `extrude` gives them; objects: the layout's, shown as prisms where their height is known."""
        prisms = tuple(prism(o.footprint, o.bottom, o.top, o.id) for o in objects if o.top is not None)
        self.scene = RayScene(faces + prisms)
        self._rays = camera.rays()
        self._values = np.array([*map(_value, faces), *[OBJECT] * len(prisms), UNLABELLED], dtype=np.uint16)
        self._rows = _ticks(camera.height)
        self._columns = _ticks(camera.width)

    def render(self, map_from_camera: Pose3) -> Labels:
        """Labels (height, width) of the raw image taken there: lens distortion included.

        0 where a ray meets no surface from its front, 1 floor, 2 ceiling, 3 object, 10 + k wall k.
        """
        nodes = self._cast(self._rays[np.ix_(self._rows, self._columns)], map_from_camera)
        same = (nodes[:-1, :-1] == nodes[1:, :-1]) & (nodes[:-1, 1:] == nodes[1:, 1:])
        same &= nodes[:-1, :-1] == nodes[:-1, 1:]
        rows, columns = (_owners(ticks) for ticks in (self._rows, self._columns))
        labels = nodes[:-1, :-1][np.ix_(rows, columns)]
        open_pixels = ~same[np.ix_(rows, columns)]
        labels[open_pixels] = self._cast(self._rays[open_pixels], map_from_camera)
        return labels

    def _cast(self, rays: Array, map_from_camera: Pose3) -> Labels:
        directions = rays @ map_from_camera.rotation.T
        _, face = self.scene.cast_front(map_from_camera.translation, directions)
        return np.asarray(self._values[face], dtype=np.uint16)


def render_labels(layout: Layout, camera: Camera, map_from_camera: Pose3) -> Labels:
    """Labels (height, width) of one raw image, as `LabelRenderer.render`, which is faster for many."""
    return LabelRenderer(extrude(layout), camera, layout.objects).render(map_from_camera)


def draw_labels(image: NDArray[np.uint8], labels: Labels) -> NDArray[np.uint8]:
    """The image (H, W, 3) BGR, or (H, W) grey, under translucent label colours, walls numbered, boundaries drawn."""
    base = cv2.cvtColor(image, cv2.COLOR_GRAY2BGR) if image.ndim == 2 else image
    values, inverse = np.unique(labels, return_inverse=True)
    colours = np.array([label_colour(int(value)) for value in values], dtype=np.float32)
    tint = colours[inverse.reshape(labels.shape)]
    opacity = np.where(labels == UNLABELLED, 0.0, OPACITY).astype(np.float32)[..., None]
    out = np.ascontiguousarray((base * (1 - opacity) + tint * opacity).round().astype(np.uint8))
    out[_boundaries(labels)] = 255
    for value in values[values >= FIRST_WALL]:
        _write(out, labels == value, str(int(value) - FIRST_WALL))
    return out


def label_colour(value: int) -> tuple[int, int, int]:
    """BGR of a label: hues of consecutive walls are far apart (golden angle)."""
    if value < FIRST_WALL:
        return PLAIN_COLOURS.get(value, (0, 0, 0))
    r, g, b = colorsys.hsv_to_rgb((0.58 + (value - FIRST_WALL) * 0.618034) % 1.0, 0.75, 1.0)
    return round(255 * b), round(255 * g), round(255 * r)


def _value(face: Face) -> int:
    return {"floor": FLOOR, "threshold": FLOOR, "ceiling": CEILING}.get(face.kind, FIRST_WALL + face.ref)


def _ticks(size: int) -> NDArray[np.int64]:
    """Pixels 0, CELL, 2 CELL ... and the last one."""
    return np.unique(np.append(np.arange(0, size, CELL), size - 1))


def _owners(ticks: NDArray[np.int64]) -> NDArray[np.int64]:
    """The cell of every pixel."""
    pixels = np.arange(ticks[-1] + 1)
    return np.clip(np.searchsorted(ticks, pixels, side="right") - 1, 0, max(len(ticks) - 2, 0))


def _boundaries(labels: Labels) -> NDArray[np.bool_]:
    """Pixels whose right or lower neighbour has another label."""
    edge = np.zeros(labels.shape, dtype=bool)
    edge[:, :-1] |= labels[:, 1:] != labels[:, :-1]
    edge[:-1] |= labels[1:] != labels[:-1]
    return edge


def _write(image: NDArray[np.uint8], region: NDArray[np.bool_], text: str) -> None:
    """`text` where the region is widest, unless it is small."""
    depth = cv2.distanceTransform(np.pad(region.astype(np.uint8), 1), cv2.DIST_L2, 3)[1:-1, 1:-1]
    radius = float(depth.max())
    if radius < SMALLEST_WRITTEN:
        return
    row, column = np.unravel_index(int(depth.argmax()), depth.shape)
    font, scale = cv2.FONT_HERSHEY_SIMPLEX, min(radius / 30, 1.6)
    (width, height), _ = cv2.getTextSize(text, font, scale, 2)
    place = (int(column) - width // 2, int(row) + height // 2)
    cv2.putText(image, text, place, font, scale, (0, 0, 0), 5, cv2.LINE_AA)
    cv2.putText(image, text, place, font, scale, (255, 255, 255), 2, cv2.LINE_AA)
