"""Faces with pictures."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import cv2
import numpy as np

from recon.config import TextureConfig
from recon.geometry import Pose3
from recon.model import Face
from recon.ordered import ordered_map
from recon.progress import SILENT, Progress
from recon.raycast import RayScene
from recon.sequence.camera import Camera
from recon.texture.cache import ImageCache
from recon.texture.candidates import Candidates
from recon.texture.canvas import Canvas
from recon.texture.consensus import agree, clutter_cost, correct
from recon.texture.gains import Exposure
from recon.texture.labelling import choose_views
from recon.texture.render import Shot, best_level, render
from recon.texture.survey import Mask, Rig, best_resolution, probe, survey, useful_images
from recon.texture.view import Image, Lens

CACHE_BYTES = 96 << 20
"""Decoded images held at a time."""
LEAST_SEEN = 0.02
"""A face of which less was seen gets no picture: a filled one would be made up."""


def texture_faces(
    faces: tuple[Face, ...],
    camera: Camera,
    map_from_camera: Sequence[Pose3 | None],
    load: Callable[[int], Image | None],
    config: TextureConfig | None = None,
    workers: int = 1,
    progress: Progress = SILENT,
    objects: Callable[[int], Mask | None] | None = None,
) -> tuple[Face, ...]:
    """The same faces with a rectified picture each from the images that see them, and which image each texel is from.

    map_from_camera: pose of every image, None to leave it out. load(i): image i, raw, uint8 BGR (height, width, 3), or
    None when it is corrupt; called from several threads. A face that (almost) no image sees keeps `texture` None.
    objects(i): mask (height, width) of the pixels that show objects before the faces, never used; None where none.
    The result does not depend on `workers`.

    Every block of a face takes its colours from one image, the sharpest that sees it (Lempitsky and Ivanov 2007:
    seamless mosaicing as labelling), unless most images say that something stands in front there.
    """
    config = TextureConfig() if config is None else config
    rig = Rig(Lens.of(camera), list(map_from_camera), RayScene(faces))
    images = useful_images(map_from_camera)
    seen = [probe(rig, face, images) for face in faces]
    canvases = [
        Canvas.of(face, max(config.metres_per_texel, finest), config.max_texture_size)
        for face, finest in zip(faces, map(best_resolution, seen), strict=True)
        if finest is not None
    ]
    with progress.stage("views of faces", total=len(images), unit="images") as stage:
        candidates, samples = survey(rig, canvases, images, load, objects, workers, stage)
    exposure = samples.solve(len(map_from_camera))
    fixed = samples.fixed(exposure)
    if fixed is not None:
        with progress.stage("views beside shadows", total=len(images), unit="images") as stage:
            candidates, samples = survey(rig, canvases, images, load, objects, workers, stage, fixed)
        exposure = replace(samples.solve(len(map_from_camera)), fixed=fixed)
    cached = ImageCache(load, CACHE_BYTES)
    textured: dict[str, Face] = {}
    work = list(zip(canvases, candidates, strict=True))
    with progress.stage("textures", total=len(work), unit="faces") as stage:
        for face in ordered_map(lambda w: _paint(*w, exposure, rig, cached), work, workers):
            textured[face.name] = face
            stage.advance()
    return tuple(textured.get(face.name, face) for face in faces)


def _paint(
    canvas: Canvas, candidates: Candidates, exposure: Exposure, rig: Rig, load: Callable[[int], Image | None]
) -> Face:
    shape = canvas.blocks
    consensus = agree(candidates, exposure)
    cost = candidates.cost + clutter_cost(candidates, consensus, shape)
    choice = choose_views(cost, candidates.view, consensus.deviation, shape)
    if np.count_nonzero(choice >= 0) < LEAST_SEEN * np.count_nonzero(canvas.block_points[1]):
        return canvas.face
    points = canvas.block_points[0].reshape(-1, 3)
    shots = {}
    for view, seen in candidates.by_view().items():
        used = np.flatnonzero(choice.ravel() == view)
        pose = rig.poses[view]
        if len(used) and pose is not None:
            correction = correct(candidates, consensus, exposure, view, seen, shape)
            depth = pose.inverse().apply(points[used])[:, 2]
            focal = float(np.sqrt(rig.lens.camera.matrix[0, 0] * rig.lens.camera.matrix[1, 1]))
            shots[view] = Shot(pose, exposure, view, correction, best_level(focal * canvas.texel / depth))
    picture, sources = render(canvas, choice, shots, rig.lens, load)
    inside = canvas.inside()
    share = float((inside & (sources >= 0)).sum() / max(int(inside.sum()), 1))
    texture = cv2.cvtColor(picture, cv2.COLOR_BGR2RGB)
    return replace(canvas.face, texture=texture, metres_per_texel=canvas.texel, seen_fraction=share, sources=sources)
