"""Things in images: how high they are and which pixels show them, against simulated rooms."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from recon.faces import extrude
from recon.geometry import Array, Pose3
from recon.labels import CEILING, OBJECT, UNLABELLED, LabelRenderer
from recon.layout_json import layout_from_json, layout_to_json
from recon.model import FloorObject, Layout
from recon.raycast import RayScene
from recon.segmentation.column import Column
from recon.segmentation.heights import measure_objects
from recon.segmentation.labelling import ObjectFinder
from recon.segmentation.pixels import NO_OBJECTS, ObjectPixels
from recon.segmentation.thing import join_legs
from recon.sequence.camera import Camera
from recon.sequence.groundtruth import read_groundtruth
from recon.sequence.images import read_image_list
from recon.sequence.intrinsics import read_camera
from recon.simulate.plan import Plan, PlanCamera, PlanDrive, PlanObject, PlanRoom
from recon.simulate.render import Exposure, Renderer
from recon.simulate.simulation import image_poses, run_simulation
from recon.simulate.truth import true_camera, true_extrinsics

CARTON, BIN, CABINET = 0.52, 0.61, 1.26
TABLE, TOP = (3.4, 1.0), 0.74
LEGS = [(TABLE[0] + x, TABLE[1] + y) for x in (-0.5, 0.5) for y in (-0.3, 0.3)]
THINGS = (
    PlanObject((5.3, 1.9), (0.5, 0.4), yaw_deg=20.0, top=CARTON, style="carton"),
    PlanObject((5.3, 3.6), (0.35, 0.35), "cylinder", top=BIN, style="plastic"),
    PlanObject((4.0, 3.75), (0.9, 0.4), top=CABINET, style="metal"),
    *(PlanObject(leg, (0.05, 0.05), top=0.70, style="metal") for leg in LEGS),
    PlanObject(TABLE, (1.1, 0.7), bottom=0.70, top=TOP, style="wood"),
)
PLAN = Plan(
    rooms=(PlanRoom(((0.0, 0.0), (6.0, 0.0), (6.0, 4.0), (0.0, 4.0))),),
    path=((0.6, 2.2), (2.2, 2.3), (3.4, 2.5)),
    objects=THINGS,
    camera=PlanCamera(image_width=320, image_height=240, fx=250.0, fy=250.0, rate=3.2, exposure_sigma=0.1),
    drive=PlanDrive(corner_radius=0.2),
)


@dataclass(frozen=True)
class Scene:
    """What a drive through a room photographed, and the truth. layout: as a LiDAR sees it, without heights."""

    layout: Layout
    camera: Camera
    poses: tuple[Pose3, ...]
    images: tuple[NDArray[np.uint8], ...]
    labels: tuple[NDArray[np.uint16], ...]

    def load(self, index: int) -> NDArray[np.uint8]:
        return self.images[index]


@cache
def scene() -> Scene:
    simulation = run_simulation(PLAN, 3)
    camera, extrinsics = true_camera(PLAN.camera), true_extrinsics(PLAN)
    renderer = Renderer(simulation.building, camera, 3)
    poses = tuple(image_poses(simulation, extrinsics))
    plan_from_map = Pose3.from_planar(simulation.map_from_plan).inverse()
    gains = np.random.default_rng(5).uniform(0.9, 1.1, len(poses))
    shots = [renderer.render(plan_from_map @ p, Exposure(gains[i], 2.0, (i,))) for i, p in enumerate(poses)]
    low = simulation.layout.objects[: 3 + len(LEGS)]  # the scanner does not meet the table's top
    layout = replace(simulation.layout, objects=low)
    return Scene(layout, camera, poses, tuple(s[0] for s in shots), tuple(s[1] for s in shots))


@cache
def measured() -> tuple[FloorObject, ...]:
    s = scene()
    return measure_objects(s.layout, extrude(s.layout), s.camera, s.poses, s.load)


def test_heights() -> None:
    carton, waste_bin, cabinet, table = measured()
    assert carton.top == pytest.approx(CARTON, abs=0.05)
    assert waste_bin.top == pytest.approx(BIN, abs=0.05)
    assert cabinet.top == pytest.approx(CABINET, abs=0.05)
    assert table.top == pytest.approx(TOP, abs=0.05)
    assert all(o.bottom == 0.0 for o in measured())
    assert len(table.legs) == len(LEGS)
    assert shapely.Polygon(table.footprint).area == pytest.approx(1.05 * 0.65, rel=0.02)


def test_pixels() -> None:
    s = scene()
    finder = ObjectFinder(replace(s.layout, objects=measured()), s.camera, RayScene(extrude(s.layout)))
    found = np.stack([finder.find(image, pose) for image, pose in zip(s.images, s.poses, strict=True)])
    true = np.stack(s.labels) == OBJECT
    right = np.count_nonzero(found & true)
    assert right / np.count_nonzero(found | true) > 0.9, "intersection over union"
    assert right / np.count_nonzero(found) > 0.96, "walls and floor are left alone"
    poses = (None, *s.poses[1:])
    layout = replace(s.layout, objects=measured())
    kept = [ObjectPixels.find(layout, extrude(layout), s.camera, poses, s.load, workers) for workers in (1, 3)]
    for i in range(1, len(poses)):
        for pixels in kept:
            mask = pixels.of(i)
            assert np.array_equal(found[i], np.zeros_like(found[i]) if mask is None else mask)
    assert kept[0].of(0) is None and kept[0].of(len(poses)) is None and NO_OBJECTS.of(0) is None
    grey = np.asarray(s.images[0].mean(axis=2), np.uint8)
    assert finder.find(grey, s.poses[0]).shape == grey.shape


def test_nothing_where_nothing_stands() -> None:
    """Footprints where the pictures show wall and floor alone get no height and no pixel."""
    s = scene()
    empty = np.array([[5.2, 2.7], [5.5, 2.7], [5.5, 3.0], [5.2, 3.0]])
    map_from_plan = run_simulation(PLAN, 3).map_from_plan
    footprint = Pose3.from_planar(map_from_plan).apply(np.column_stack([empty, np.zeros(4)]))[:, :2]
    layout = replace(s.layout, objects=(*s.layout.objects, FloorObject(99, footprint)))
    found = measure_objects(layout, extrude(layout), s.camera, s.poses, s.load)
    assert len(found) == 5 and np.array_equal(found[-1].footprint, footprint) and found[-1].top is None


def test_without_pictures_no_height() -> None:
    s = scene()
    faces = extrude(s.layout)
    for poses, load in (((None,) * len(s.poses), s.load), (s.poses, lambda _: None)):
        found = measure_objects(s.layout, faces, s.camera, poses, load)
        assert [o.top for o in found] == [None] * 4
    finder = ObjectFinder(replace(s.layout, objects=found), s.camera, RayScene(faces))
    assert not finder.find(s.images[0], s.poses[0]).any()
    assert measure_objects(replace(s.layout, objects=()), faces, s.camera, s.poses, s.load) == ()


SEEN_IN_CORRIDOR = (
    (12.09, -1.57, 12.40, -1.27),
    (10.72, -1.56, 11.04, -1.45),
    *((x, y, x + 0.05, y + 0.05) for x, y in ((5.68, -1.24), (6.15, -0.89), (5.73, -0.84))),
    (11.02, 6.42, 11.43, 6.96),
)
"""Boxes, m, about what the scanner met: a bin, an extinguisher, three legs of a chair, cartons."""


def test_corridor_with_its_true_walls(shared_data: Callable[[str], Path]) -> None:
    folder = shared_data("corridor")
    truth, camera = read_groundtruth(folder), read_camera(folder / "camera.yaml")
    assert truth.layout is not None and truth.camera_trajectory is not None
    names, poses = read_image_list(folder / "images.txt").names, truth.camera_trajectory.poses
    images = [np.asarray(cv2.imread(str(folder / name)), dtype=np.uint8) for name in names]
    faces = extrude(truth.layout)
    outlines = [np.array([[a, b], [c, b], [c, d], [a, d]]) for a, b, c, d in SEEN_IN_CORRIDOR]
    layout = replace(truth.layout, objects=tuple(FloorObject(i, outline) for i, outline in enumerate(outlines)))
    layout = replace(layout, objects=measure_objects(layout, faces, camera, poses, lambda i: images[i]))
    renderer = LabelRenderer(faces, camera)
    finder = ObjectFinder(layout, camera, renderer.scene)
    true = np.stack([np.asarray(cv2.imread(str(truth.label_path(n)), cv2.IMREAD_UNCHANGED)) for n in names])
    labels = np.stack([renderer.render(pose) for pose in poses])
    plain = labels.copy()
    labels[np.stack([finder.find(image, pose) for image, pose in zip(images, poses, strict=True)])] = OBJECT
    scored = ~np.isin(true, [UNLABELLED, CEILING])
    accuracy, without = (float((found == true)[scored].mean()) for found in (labels, plain))
    assert without < 0.98 < 0.984 < accuracy < 0.998, "doors are recessed and baseboards stand out"
    right = np.count_nonzero((labels == OBJECT) & (true == OBJECT))
    assert right / np.count_nonzero((labels == OBJECT) & scored) > 0.8
    assert right / np.count_nonzero(true == OBJECT) > 0.78


def test_a_camera_inside_a_thing_sees_nothing_of_it() -> None:
    """Things that move, or what is under a table: the platform was there."""
    s = scene()
    around = s.poses[2].translation[:2] + 0.8 * (square(0.0, 0.0, 1.0) - 0.5)
    layout = replace(s.layout, objects=(FloorObject(0, around, top=1.0),))
    finder = ObjectFinder(layout, s.camera, RayScene(extrude(layout)))
    assert not finder.find(s.images[2], s.poses[2]).any()


def square(x: float, y: float, size: float) -> Array:
    return np.array([x, y]) + size * np.array([[0, 0], [1, 0], [1, 1], [0, 1]])


def test_legs_are_joined() -> None:
    legs = [square(x, y, 0.05) for x, y in ((0, 0), (0.5, 0), (0.5, 0.5), (0, 0.5))]
    far, big = square(5, 5, 0.05), square(0.7, 0, 0.6)
    objects = tuple(FloorObject(i, f) for i, f in enumerate([legs[0], far, legs[1], big, legs[2], legs[3]]))
    joined = join_legs(objects)
    assert [o.id for o in joined] == [0, 1, 2]
    assert [len(o.legs) for o in joined] == [4, 0, 0]
    assert joined[0].footprint.min() == 0 and joined[0].footprint.max() == pytest.approx(0.55)
    assert np.array_equal(joined[1].footprint, far) and np.array_equal(joined[2].footprint, big)
    assert join_legs(()) == ()
    layout = Layout((), (), objects=tuple(replace(o, top=0.8) for o in joined))
    again = layout_from_json(layout_to_json(layout), "layout.json").objects
    assert [o.top for o in again] == [0.8] * 3
    assert all(
        np.allclose(a, b) for o, p in zip(joined, again, strict=True) for a, b in zip(o.legs, p.legs, strict=True)
    )


@given(st.floats(0, 6.28), st.floats(-1.2, 1.2), st.floats(0.2, 2.5), st.floats(1.0, 4.0), st.floats(0.05, 2.0))
def test_what_hides_the_background(turn: float, pitch: float, eye: float, away: float, height: float) -> None:
    """A ray meets a prism on the column exactly when the prism is higher than the ray's lowest height in it."""
    column = Column(square(0.0, 0.0, 0.5))
    origin = np.array([0.25, 0.25, eye]) - away * np.array([np.cos(turn), np.sin(turn), 0])
    ray = np.array([np.cos(turn + 0.05), np.sin(turn + 0.05), np.tan(pitch)])
    lowest, _ = column.meet(origin, ray)
    assert column.holds(origin[:2]) == bool(np.abs(origin[:2] - 0.25).max() <= 0.25)
    points = origin + np.linspace(0, 2 * away + 1, 20001)[:, None] * ray
    over = np.all((points[:, :2] >= 0) & (points[:, :2] <= 0.5), axis=1) & (points[:, 2] >= 0)
    assert bool(np.any(over & (points[:, 2] <= height - 2e-3))) <= bool(lowest < height)
    assert bool(lowest < height - 2e-3) <= bool(np.any(over & (points[:, 2] <= height)))
