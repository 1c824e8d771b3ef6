"""How high the layout's objects are, from the images that show them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from recon.geometry import Pose3
from recon.model import Face, FloorObject, Layout
from recon.prisms import measure_objects as measure_by_parallax
from recon.raycast import RayScene
from recon.segmentation.carving import legged_span
from recon.segmentation.crop import Crop, Eye
from recon.segmentation.solid import solid_span
from recon.segmentation.thing import Thing, join_legs
from recon.sequence.camera import Camera

TALLEST = 2.3
"""m"""
FARTHEST = 8.0
"""m from the camera to a thing."""
VIEWS = 12
"""Images that are looked at for one thing, at most, and ..."""
FEWEST = 2
"""... at least."""
TRIED = 60
"""Images near a thing that are tried."""

Load = Callable[[int], "NDArray[np.uint8] | None"]


def measure_objects(
    layout: Layout, faces: tuple[Face, ...], camera: Camera, map_from_camera: Sequence[Pose3 | None], load: Load
) -> tuple[FloorObject, ...]:
    """The layout's objects, legs of one thing joined, with `bottom` and `top`, m, where images show them.

    faces: of the layout (`extrude`). map_from_camera: pose of every image, None to leave it out. load(i): image i, raw,
    uint8 BGR, or None when it is corrupt. `top` stays None for objects that neither stand out by their colours from
    what is around and behind them nor move against it from image to image.
    """
    objects = join_legs(layout.objects)
    things = [Thing.of(item, layout.walls) for item in objects]
    top = min(TALLEST, layout.extrusion_height)
    eye = Eye(camera, RayScene(faces))
    measured = []
    for item, thing in zip(objects, things, strict=True):
        seen = views(thing, near(thing, things), eye, map_from_camera, load, top)
        span = None
        if len(seen) >= FEWEST:
            crops, poses = [crop for crop, _ in seen], [pose for _, pose in seen]
            span = solid_span(crops, top) if thing.solid else legged_span(thing, crops, poses, camera, top)
        measured.append(item if span is None else replace(item, bottom=round(span[0], 3), top=round(span[1], 3)))
    return _by_parallax(replace(layout, objects=tuple(measured)), faces, camera, map_from_camera, load)


def _by_parallax(
    layout: Layout, faces: tuple[Face, ...], camera: Camera, poses: Sequence[Pose3 | None], load: Load
) -> tuple[FloorObject, ...]:
    """The objects, those that look like what is around them measured by how images differ (`recon.prisms`)."""
    left = tuple(o for o in layout.objects if o.top is None)
    found = {o.id: o for o in measure_by_parallax(replace(layout, objects=left), faces, camera, poses, load)}
    return tuple(found.get(o.id, o) for o in layout.objects)


def near(thing: Thing, things: list[Thing]) -> list[Thing]:
    """The other things that may be in the same part of an image."""
    reach = thing.reach
    gaps = [np.linalg.norm(t.reach.centre - reach.centre) - t.reach.radius - reach.radius for t in things]
    return [t for t, gap in zip(things, gaps, strict=True) if t is not thing and gap < FARTHEST]


def views(
    thing: Thing, others: list[Thing], eye: Eye, poses: Sequence[Pose3 | None], load: Load, top: float
) -> list[tuple[Crop, Pose3]]:
    """The nearest images that show a thing."""
    posed = [i for i, pose in enumerate(poses) if pose is not None]
    places = np.array([pose.translation[:2] for pose in poses if pose is not None]).reshape(-1, 2)
    gaps = np.linalg.norm(places - thing.reach.centre, axis=1) - thing.reach.radius
    found: list[tuple[Crop, Pose3]] = []
    for k in np.argsort(gaps, kind="stable")[:TRIED]:
        i, pose = posed[k], poses[posed[k]]
        if pose is None or gaps[k] > FARTHEST or len(found) == VIEWS:
            break
        if eye.frame(thing.reach, pose, top) is None or (image := load(i)) is None:
            continue
        crop = eye.crop(thing, others, image, pose, top)
        if crop is not None:
            found.append((crop, pose))
    return found
