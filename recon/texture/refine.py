"""Camera poses refined on the faces that several images see."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from recon.geometry import Array, Pose3
from recon.model import Face
from recon.ordered import ordered_map
from recon.progress import SILENT, Progress
from recon.raycast import RayScene
from recon.sequence.camera import Camera
from recon.texture.alignment import align
from recon.texture.cache import ImageCache
from recon.texture.matches import Matcher, Matches, contrast
from recon.texture.partners import partners
from recon.texture.survey import Rig, probe, useful_images
from recon.texture.view import Image, Lens

SMALL_BYTES = 32 << 20
"""Small grey images held at a time."""
PARTNERS = 3
"""Earlier images that each image is aligned with."""


def camera_sigmas(platform: Array) -> Array:
    """As `refine_poses` takes them, (N, 2), of platform poses' standard deviations (N, 3) of x, y (m) and yaw (rad)."""
    return np.column_stack([np.hypot(platform[:, 0], platform[:, 1]), platform[:, 2]])


def refine_poses(
    faces: tuple[Face, ...],
    camera: Camera,
    map_from_camera: Sequence[Pose3 | None],
    load: Callable[[int], Image | None],
    sigmas: ArrayLike = (0.0, 0.0),
    workers: int = 1,
    progress: Progress = SILENT,
) -> tuple[Pose3 | None, ...]:
    """The poses, moved a little so that images agree on the faces: within what is known of them, seams do not show.

    map_from_camera: pose of every image, None to leave it out. load(i): image i, raw, uint8 BGR (height, width, 3), or
    None when it is corrupt; called from several threads. sigmas: (N, 2) or (2,), one standard deviation of the poses'
    places (m) and directions (rad). Images taken where the one before was move with it. The result does not depend on
    `workers`.
    """
    rig = Rig(Lens.of(camera), list(map_from_camera), RayScene(faces))
    images = useful_images(map_from_camera)
    if not faces or not images:
        return tuple(map_from_camera)
    seen = [probe(rig, face, images) for face in faces]

    def small(i: int) -> Image | None:
        image = load(i)
        return None if image is None else contrast(image)

    matcher = Matcher(rig.lens, rig.scene, rig.poses, ImageCache(small, SMALL_BYTES))
    groups = [(images[k], [images[n] for n in others]) for k, others in partners(seen, PARTNERS)]
    matches: list[Matches] = []
    with progress.stage("aligning images", total=len(groups), unit="images") as stage:
        for found in ordered_map(lambda group: matcher.match(*group), groups, workers):
            matches += found
            stage.advance()
    known = np.broadcast_to(np.asarray(sigmas, np.float64), (len(map_from_camera), 2))
    moved = align(rig.poses, matches, faces, camera, known)
    return _carried(map_from_camera, moved, images)


def _carried(
    before: Sequence[Pose3 | None], after: Sequence[Pose3 | None], images: list[int]
) -> tuple[Pose3 | None, ...]:
    """Images that were not aligned are moved as the last one before them that was."""
    out = list(after)
    last: int | None = None
    aligned = set(images)
    for i, pose in enumerate(before):
        if i in aligned:
            last = i
        elif pose is not None and last is not None:
            old, new = before[last], after[last]
            if old is not None and new is not None:
                out[i] = new @ old.inverse() @ pose
    return tuple(out)
