"""Labels say which surface every raw pixel shows."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from box_room import FISHEYE, RATIONAL, SIZE, WIDE, box_layout, camera_at

from recon.faces import extrude
from recon.geometry import Pose3
from recon.labels import (
    CEILING,
    FIRST_WALL,
    FLOOR,
    OBJECT,
    UNLABELLED,
    LabelRenderer,
    Labels,
    draw_labels,
    render_labels,
)
from recon.model import Layout, Room, Wall
from recon.raycast import RayScene
from recon.sequence.camera import Camera
from recon.sequence.groundtruth import read_groundtruth
from recon.sequence.images import read_image_list
from recon.sequence.intrinsics import read_camera

FACES_OF_BOX = {(0, False): 13, (0, True): 11, (1, False): 10, (1, True): 12, (2, False): FLOOR, (2, True): CEILING}
"""Label by axis and whether the ray meets the far side: walls go counter-clockwise from y = 0."""


def box_labels(camera: Camera, pose: Pose3) -> Labels:
    """By plain arithmetic: the first side of the box that each pixel's ray meets."""
    rays = camera.rays().reshape(-1, 3) @ pose.rotation.T
    with np.errstate(divide="ignore"):
        reach = np.where(rays > 0, SIZE - pose.translation, pose.translation) / np.abs(rays)
    axis = reach.argmin(axis=1)
    far = rays[np.arange(len(rays)), axis] > 0
    labels = [FACES_OF_BOX[int(a), bool(f)] for a, f in zip(axis, far, strict=True)]
    return np.array(labels, dtype=np.uint16).reshape(camera.height, camera.width)


@pytest.mark.parametrize("camera", [WIDE, FISHEYE, RATIONAL], ids=["plumb_bob", "equidistant", "rational_polynomial"])
def test_labels_of_a_box(camera: Camera) -> None:
    renderer = LabelRenderer(extrude(box_layout()), camera)
    seen = set()
    for x, y, yaw, pitch in [(1.0, 1.0, 0.3, 0.2), (4.0, 2.0, 2.2, -0.3), (2.5, 0.5, 4.0, 0.0), (3.0, 3.0, -1.2, 0.9)]:
        pose = camera_at(x, y, yaw, pitch)
        labels, truth = renderer.render(pose), box_labels(camera, pose)
        assert labels.shape == (camera.height, camera.width) and labels.dtype == np.uint16
        assert float((labels != truth).mean()) < 0.001, "float32 rays may fall on the other side of an edge"
        seen |= set(np.unique(labels))
    assert seen == {FLOOR, CEILING, 10, 11, 12, 13}


def test_open_space_and_backs_of_walls_are_unlabelled() -> None:
    wall = Wall(7, np.array([2.0, -1.0]), np.array([2.0, 1.0]), 0.01, 0.001, "lidar", 3)
    layout = Layout((wall,), (), ceiling_height=2.4)
    front = render_labels(layout, WIDE, camera_at(0.0, 0.0, 0.0))
    assert set(np.unique(front)) == {UNLABELLED, FIRST_WALL + 7}, "free space on its left: seen from smaller x"
    behind = render_labels(layout, WIDE, camera_at(4.0, 0.0, np.pi))
    assert set(np.unique(behind)) == {UNLABELLED}
    assert set(np.unique(render_labels(Layout((), ()), WIDE, camera_at(0, 0, 0)))) == {UNLABELLED}


def test_one_sees_through_walls_from_behind() -> None:
    """Faces towards the camera count, also where another lies in the same plane, back to back."""
    away = Wall(0, np.array([2.0, 1.0]), np.array([2.0, -1.0]), 0.01, 0.001, "lidar", 3)
    same_plane = Wall(1, np.array([2.0, -1.0]), np.array([2.0, 0.0]), 0.01, 0.001, "lidar", 3)
    beyond = Wall(2, np.array([3.0, -3.0]), np.array([3.0, 3.0]), 0.01, 0.001, "lidar", 3)
    pose = camera_at(0.0, 0.0, 0.0)
    seen = render_labels(Layout((away, same_plane, beyond), (), ceiling_height=2.4), WIDE, pose)
    alone = render_labels(Layout((same_plane, beyond), (), ceiling_height=2.4), WIDE, pose)
    assert np.array_equal(seen, alone)
    assert {FIRST_WALL + 1, FIRST_WALL + 2} <= set(np.unique(seen))
    faces = extrude(Layout((away, beyond), (), ceiling_height=2.4))
    reach, face = RayScene(faces).cast_front(np.zeros(3), np.array([[1.0, 0, 0.3], [1.0, 0.1, 0.3], [-1.0, 0, 0]]))
    assert reach[:2] == pytest.approx(3.0, abs=1e-3) and np.isinf(reach[2])
    assert face.tolist() == [1, 1, -1]


def test_a_narrow_wall_between_grid_points_is_exact_at_its_edges() -> None:
    """Rays are cast on a grid first: edges must be as if every pixel had been cast."""
    polygon = np.array([[0, 0], [6, 0], [6, 2], [3, 2], [3, 3], [0, 3]], dtype=np.float64)
    ends = np.roll(polygon, -1, axis=0)
    walls = tuple(Wall(i, a, b, 0.01, 0.001, "lidar", 9) for i, (a, b) in enumerate(zip(polygon, ends, strict=True)))
    layout = Layout(walls, (Room(0, "L", polygon),), ceiling_height=2.4)
    faces = extrude(layout)
    values = np.array([FIRST_WALL + w.id for w in walls] + [FLOOR, CEILING])
    for pose in (camera_at(1.0, 1.5, 0.1), camera_at(1.0, 2.5, -0.4, 0.2), camera_at(5.0, 1.0, 2.9)):
        _, hit = RayScene(faces).cast(pose.translation, WIDE.rays() @ pose.rotation.T)
        labels = LabelRenderer(faces, WIDE).render(pose)
        assert np.array_equal(labels, values[hit])
        assert len(np.unique(labels)) >= 5


def test_corridor_with_its_true_layout(shared_data: Callable[[str], Path]) -> None:
    folder = shared_data("corridor")
    truth, camera = read_groundtruth(folder), read_camera(folder / "camera.yaml")
    assert truth.layout is not None and truth.camera_trajectory is not None
    renderer = LabelRenderer(extrude(truth.layout), camera)
    counts = np.zeros(4)
    for name, pose in zip(read_image_list(folder / "images.txt").names, truth.camera_trajectory.poses, strict=True):
        labels = renderer.render(pose)
        true = np.asarray(cv2.imread(str(truth.label_path(name)), cv2.IMREAD_UNCHANGED))
        same, scored = np.equal(labels, true), ~np.isin(true, [UNLABELLED, CEILING])
        plain = scored & ~np.equal(true, OBJECT)
        counts += [np.count_nonzero(m) for m in (scored, scored & same, plain, plain & same)]
    scored_all, right, plain_all, right_plain = counts
    assert right / scored_all > 0.97, "the layout knows no objects: their pixels are wrong"
    assert 0.99 < right_plain / plain_all < 0.999, "baseboards and recessed doors are not in the layout"


def test_overlay_for_people() -> None:
    pose = camera_at(1.0, 1.0, 0.3, 0.2)
    labels = render_labels(box_layout(), WIDE, pose)
    labels[:40, :40] = UNLABELLED
    image = np.full((WIDE.height, WIDE.width, 3), 100, np.uint8)
    before = image.copy()
    drawn = draw_labels(image, labels)
    assert drawn.shape == image.shape and drawn.dtype == np.uint8 and np.array_equal(image, before)
    assert np.all(drawn[:38, :38] == 100), "unlabelled pixels are left alone"
    colours = {}
    for value in np.unique(labels[labels != UNLABELLED]):
        inside = cv2.erode((labels == value).astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
        colours[int(value)] = tuple(np.median(drawn[inside], axis=0))
    assert len(set(colours.values())) == len(colours) >= 4, "every surface has its colour"
    edge = labels[:, 1:] != labels[:, :-1]
    assert np.all(drawn[:, :-1][edge].max(axis=1) >= 200), "boundaries are drawn"
    assert np.array_equal(draw_labels(image[..., 0], labels), drawn), "grey images too"


def test_label_values_are_those_of_the_format() -> None:
    assert (UNLABELLED, FLOOR, CEILING, OBJECT, FIRST_WALL) == (0, 1, 2, 3, 10)
