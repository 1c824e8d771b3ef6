"""Which pixels of every image show objects."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Pose3
from recon.model import Face, Layout
from recon.ordered import ordered_map
from recon.raycast import RayScene
from recon.segmentation.labelling import ObjectFinder
from recon.sequence.camera import Camera

Load = Callable[[int], "NDArray[np.uint8] | None"]
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class ObjectPixels:
    """Masks of n images of one shape (height, width), a bit a pixel; None where an image shows no object."""

    shape: tuple[int, int]
    packed: tuple[NDArray[np.uint8] | None, ...] = ()

    @staticmethod
    def find(
        layout: Layout,
        faces: tuple[Face, ...],
        camera: Camera,
        map_from_camera: Sequence[Pose3 | None],
        load: Load,
        workers: int = 1,
    ) -> ObjectPixels:
        """Of every image that has a pose; layout as `measure_objects` gives it, faces as `extrude` does.

        load(i): image i, raw, uint8 BGR, or None when it is corrupt. The same whatever the number of workers.
        """
        finder = ObjectFinder(layout, camera, RayScene(faces))

        def look(i: int) -> NDArray[np.uint8] | None:
            pose = map_from_camera[i]
            image = None if pose is None or not finder.may_find(pose) else load(i)
            if pose is None or image is None:
                return None
            mask = finder.find(image, pose)
            return np.packbits(mask) if mask.any() else None

        masks = tuple(ordered_map(look, range(len(map_from_camera)), workers))
        return ObjectPixels((camera.height, camera.width), masks)

    def of(self, index: int) -> Mask | None:
        """Mask (height, width) of image `index`; None where it shows no object."""
        packed = self.packed[index] if index < len(self.packed) else None
        if packed is None:
            return None
        return np.unpackbits(packed, count=self.shape[0] * self.shape[1]).reshape(self.shape).astype(np.bool_)


NO_OBJECTS = ObjectPixels((0, 0))
