"""Pixels that show objects."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.geometry import Array, Pose3
from recon.model import Layout
from recon.raycast import RayScene
from recon.segmentation.crop import Crop, Eye
from recon.segmentation.heights import near
from recon.segmentation.thing import Thing
from recon.sequence.camera import Camera

FARTHEST = 12.0
"""m: farther things are small, and the poses of images too inexact for them."""
ABOVE = 0.3
"""m above a thing that is looked at too."""
LEAST_PIXELS = 12
MARGIN = 0.05
"""m by which a thing's outline may differ from the scanner's: full belief in and disbelief outside it start there."""
OVERHANG = 2.5
"""Margins beyond which nothing of a thing is expected."""
INSIDE, OUTSIDE, FALLOFF = 1.0, -1.0, 4.0
"""Log odds in a solid core, at one margin outside, and what is lost with each further margin."""
BETWEEN = -1.5
"""Log odds in the reach of a thing but not in its core."""
CORE = 0.4
"""m of height of legs, from which the colours of the thing are first learned."""
SMOOTHNESS, LEAST_SMOOTHNESS = 4.5, 0.1
"""Cost of parting equal neighbours, and any neighbours."""
NEVER = -100.0
LEAST_CONTRAST = 5.0
"""Levels: noise."""
ROUNDS = 3


class ObjectFinder:
    """Finds the objects of a layout in the images of one camera."""

    def __init__(self, layout: Layout, camera: Camera, scene: RayScene) -> None:
        """layout: as `measure_objects` gives it; objects without `top` are not looked for. scene: of its faces."""
        self._eye = Eye(camera, scene)
        self._shape = camera.height, camera.width
        things = [Thing.of(item, layout.walls) for item in layout.objects]
        wanted = [(thing, item.top) for thing, item in zip(things, layout.objects, strict=True)]
        self._wanted = [(thing, top, near(thing, things)) for thing, top in wanted if top is not None]

    def may_find(self, map_from_camera: Pose3) -> bool:
        """Whether anything is near enough: no is sure."""
        return bool(self._near(map_from_camera))

    def _near(self, map_from_camera: Pose3) -> list[tuple[Thing, float, list[Thing]]]:
        place = map_from_camera.translation[:2]
        return [w for w in self._wanted if np.linalg.norm(w[0].reach.centre - place) <= FARTHEST + w[0].reach.radius]

    def find(self, image: NDArray[np.uint8], map_from_camera: Pose3) -> NDArray[np.bool_]:
        """Pixels (H, W) of a raw image, BGR (H, W, 3) or grey (H, W), that show an object."""
        picture = cv2.cvtColor(image, cv2.COLOR_GRAY2BGR) if image.ndim == 2 else image
        out = np.zeros(self._shape, np.bool_)
        for thing, top, others in self._near(map_from_camera):
            crop = self._eye.crop(thing, others, picture, map_from_camera, top + ABOVE)
            if crop is None:
                continue
            mask = segment(crop, top, thing.solid, self._eye.focal)
            rows, columns = (slice(int(i[0]), int(i[-1]) + 1) for i in (crop.rows, crop.columns))
            view = out[rows, columns]
            view |= cv2.resize(mask.astype(np.float32), view.shape[::-1], interpolation=cv2.INTER_LINEAR) > 0.5
        return out


def segment(crop: Crop, height: float, solid: bool, focal: float) -> NDArray[np.bool_]:
    """Pixels (h, w) of a crop that show its thing, `height` m high: least cut by colour, outline and contrast.

    Boykov and Jolly 2001, the colours learned in turns with the pixels (Rother et al. 2004). focal: pixels.
    """
    inside = crop.reach < height
    nothing = np.zeros(inside.shape, np.bool_)
    if np.count_nonzero(inside) < LEAST_PIXELS:
        return nothing
    margin = max(1.5, focal * MARGIN / float(np.median(crop.distance[inside])) / crop.step)
    odds = _odds(crop, inside, height, solid, margin)
    weight = (crop.lowest < (height if solid else min(height, CORE))).astype(np.float64)
    for _ in range(ROUNDS):
        if not weight.any():
            return nothing
        evidence = crop.evidence(crop.colours(weight)) + odds
        weight = 1 / (1 + np.exp(-evidence)) if solid else (evidence > 1).astype(np.float64)
    mask = _least_cut(evidence, crop.image.astype(np.float32))
    return _standing(mask, crop.lowest < height)


def _standing(mask: NDArray[np.bool_], core: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The connected parts of a mask (h, w) that reach into the core; others are of other things."""
    count, part = cv2.connectedComponents(mask.astype(np.uint8), connectivity=4)
    kept = np.isin(np.arange(count), part[core & mask])
    return np.asarray(kept[part] & mask, dtype=np.bool_)


def _odds(crop: Crop, inside: NDArray[np.bool_], height: float, solid: bool, margin: float) -> Array:
    """Log odds (h, w) that a pixel shows the thing, before its colour is looked at; margin in pixels."""
    beyond = cv2.distanceTransform((~inside).astype(np.uint8), cv2.DIST_L2, 5) / margin
    odds = np.where(inside, BETWEEN, OUTSIDE * np.minimum(beyond, 1) - FALLOFF * np.maximum(beyond - 1, 0))
    if solid:
        core = crop.lowest < height
        deep = cv2.distanceTransform(core.astype(np.uint8), cv2.DIST_L2, 5) / margin
        odds = np.where(core, INSIDE * np.minimum(deep, 1), odds)
    odds[beyond > OVERHANG] = NEVER
    return np.asarray(odds, dtype=np.float64)


def _least_cut(odds: Array, image: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Pixels (h, w) with positive odds, parted where neighbours in image (h, w, 3) differ."""
    import maxflow

    right = ((image[:, 1:] - image[:, :-1]) ** 2).sum(axis=2)
    down = ((image[1:] - image[:-1]) ** 2).sum(axis=2)
    contrast = max(float(np.mean(right)) + float(np.mean(down)), 2 * LEAST_CONTRAST**2)
    graph = maxflow.Graph[float]()
    nodes = graph.add_grid_nodes(odds.shape)
    for difference, neighbour in ((right, (1, 2)), (down, (2, 1))):
        weight = np.zeros(odds.shape)
        rows, columns = difference.shape
        weight[:rows, :columns] = SMOOTHNESS * np.exp(-difference / contrast) + LEAST_SMOOTHNESS
        structure = np.zeros((3, 3), np.int64)
        structure[neighbour] = 1
        graph.add_grid_edges(nodes, weight, structure=structure, symmetric=True)
    graph.add_grid_tedges(nodes, np.maximum(odds, 0), np.maximum(-odds, 0))
    graph.maxflow()
    return np.asarray(~graph.get_grid_segments(nodes), dtype=np.bool_)
