"""The sides of openings, against the simulator's own picture of a building."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

from recon.faces import extrude
from recon.geometry import Pose3, inverse2
from recon.labels import CEILING, UNLABELLED, LabelRenderer
from recon.model import Layout, Opening, Wall
from recon.reveals import reveals
from recon.simulate import Plan, run_simulation
from recon.simulate.render import Exposure, Renderer
from recon.simulate.simulation import image_poses
from recon.simulate.truth import true_camera, true_extrinsics

PLAN = {
    "rooms": [{"polygon": [[0, 0], [4, 0], [4, 4], [0, 4]]}, {"polygon": [[4.3, 0], [8, 0], [8, 4], [4.3, 4]]}],
    "openings": [{"type": "passage", "room": 0, "wall": 1, "offset": 1.5, "width": 1.1}],
    "path": [[1, 1], [2.5, 2.05], [6, 2.05]],
    "camera": {"image_width": 320, "image_height": 240, "fx": 240, "fy": 240, "distortion": [0.0] * 5, "rate": 1.5},
}


def test_views_through_a_passage() -> None:
    """With the reveals nearly every pixel of the true layout's labels is right; without them many are not."""
    simulation = run_simulation(Plan.from_dict(PLAN), 0)
    plan = simulation.building.plan
    camera, poses = true_camera(plan.camera), image_poses(simulation, true_extrinsics(plan))
    renderer = Renderer(simulation.building, camera, 0)
    plan_from_map = Pose3.from_planar(inverse2(simulation.map_from_plan))
    faces = extrude(simulation.layout)
    wrong = {}
    with_reveals, without = (LabelRenderer(f, camera) for f in (faces + reveals(simulation.layout), faces))
    for name, labels in (("with", with_reveals), ("without", without)):
        count = scored = 0
        for i, pose in enumerate(poses):
            _, true = renderer.render(plan_from_map @ pose, Exposure(1.0, 0.0, (0, 0, i)))
            plain = (true != UNLABELLED) & (true != CEILING)
            count += int(np.count_nonzero(plain & (labels.render(pose) != true)))
            scored += int(np.count_nonzero(plain))
        wrong[name] = count / scored
    assert wrong["with"] < 0.002
    assert wrong["without"] > 0.01


def hole(number: int, wall: int, start: tuple[float, float], end: tuple[float, float]) -> Opening:
    return Opening(number, "passage", wall, np.array(start), np.array(end), 0.0, 2.0)


def wall(number: int, start: tuple[float, float], end: tuple[float, float], thickness: float | None = None) -> Wall:
    return Wall(number, np.array(start), np.array(end), 0.01, 0.001, "lidar", 9, thickness=thickness)


def test_faces_look_into_the_opening() -> None:
    """A wall along x with the room above it, 0.4 m thick: the opening from x = 1 to 2 is 0.2 m deep on its side."""
    layout = Layout((wall(7, (0, 0), (4, 0), 0.4),), (), (hole(0, 7, (1, 0), (2, 0)),), ceiling_height=2.5)
    left, right, lintel, threshold = reveals(layout)
    assert [face.kind for face in (left, right, lintel, threshold)] == ["wall", "wall", "wall", "floor"]
    assert {face.ref for face in (left, right, lintel)} == {7}
    for face, normal in ((left, [1, 0, 0]), (right, [-1, 0, 0]), (lintel, [0, 0, -1]), (threshold, [0, 0, 1])):
        np.testing.assert_allclose(face.normal, normal, atol=1e-12)
        assert face.vertices[:, 1].min() == pytest.approx(-0.2) and face.vertices[:, 1].max() == pytest.approx(0.0)
    assert shapely.MultiPoint(threshold.vertices[:, :2]).convex_hull.area == pytest.approx(0.2)
    assert (threshold.vertices[:, 2] == 0).all() and (lintel.vertices[:, 2] == 2.0).all()
    turned = replace(layout, openings=(hole(0, 7, (2, 0), (1, 0)),))
    for face, other in zip(reveals(turned), reveals(layout), strict=True):
        np.testing.assert_allclose(face.vertices, other.vertices)


def test_thickness_is_the_way_to_the_hole_behind() -> None:
    pair = wall(0, (0, 0), (4, 0), 0.5), wall(1, (4, -0.3), (0, -0.3))
    holes = hole(0, 0, (1, 0), (2, 0)), hole(1, 1, (2, -0.3), (1, -0.3))
    faces = reveals(Layout(pair, (), holes))
    depths = [float(np.ptp(face.vertices[:, 1])) for face in faces]
    np.testing.assert_allclose(depths, 0.15)
    assert faces[0].vertices[:, 1].min() == pytest.approx(faces[4].vertices[:, 1].max()), "the halves meet"
    alone = reveals(Layout((pair[1],), (), (holes[1],)))
    assert alone == (), "nothing says how thick the wall is"
    closed = Opening(0, "door", 0, np.array([1.0, 0.0]), np.array([2.0, 0.0]), 0.0, 2.0)
    assert reveals(Layout(pair, (), (closed,))) == (), "one does not look through a closed door"
