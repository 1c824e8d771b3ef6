"""The sides of openings, against the simulator's own picture of a building."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from recon.faces import extrude
from recon.geometry import Pose3, inverse2
from recon.holes import holes_of
from recon.labels import CEILING, UNLABELLED, LabelRenderer
from recon.model import Face, Layout, Opening, Wall
from recon.niches import ASSUMED_DEPTH, ASSUMED_LEAF
from recon.reveals import reveals, with_side_colours
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
    bare = tuple(face for face in faces if face.opening is None)
    with_reveals, without = (LabelRenderer(f, camera) for f in (faces, bare))
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


def box(layout: Layout) -> dict[str, Face]:
    return {face.name: face for face in reveals(holes_of(layout))}


def test_faces_look_into_the_opening() -> None:
    """A wall along x with the room above it, 0.4 m thick: the opening from x = 1 to 2 is 0.2 m deep on its side."""
    layout = Layout((wall(7, (0, 0), (4, 0), 0.4),), (), (hole(0, 7, (1, 0), (2, 0)),), ceiling_height=2.5)
    faces = box(layout)
    kinds = {"reveal_000_left": "reveal", "reveal_000_right": "reveal", "reveal_000_head": "reveal"}
    assert {name: face.kind for name, face in faces.items()} == kinds | {"threshold_000": "threshold"}
    # Who looks at the wall from the room has larger x on the left.
    left, right, head, threshold = faces.values()
    for face, normal in ((left, [-1, 0, 0]), (right, [1, 0, 0]), (head, [0, 0, -1]), (threshold, [0, 0, 1])):
        np.testing.assert_allclose(face.normal, normal, atol=1e-12)
        assert face.ref == 7 and face.opening == 0
        assert face.vertices[:, 1].min() == pytest.approx(-0.2) and face.vertices[:, 1].max() == pytest.approx(0.0)
        plane, *_ = np.linalg.lstsq(np.column_stack([face.uv, np.ones(4)]), face.vertices, rcond=None)
        np.testing.assert_allclose(
            np.cross(plane[0], plane[1]), 0.2 * np.array(normal) * (2 if abs(normal[0]) else 1), atol=1e-12
        )
    assert left.vertices[0, 0] == 2.0 and right.vertices[0, 0] == 1.0
    assert (threshold.vertices[:, 2] == 0).all() and (head.vertices[:, 2] == 2.0).all()
    turned = replace(layout, openings=(hole(0, 7, (2, 0), (1, 0)),))
    for face, other in zip(box(turned).values(), faces.values(), strict=True):
        np.testing.assert_allclose(face.vertices, other.vertices)


def test_the_two_ends_of_a_way_meet_halfway() -> None:
    pair = wall(0, (0, 0), (4, 0), 0.5), wall(1, (4, -0.3), (0, -0.3))
    holes = hole(0, 0, (1, 0), (2, 0)), hole(1, 1, (2.1, -0.3), (0.96, -0.3))
    faces = box(Layout(pair, (), holes))
    assert len(faces) == 8
    for face in faces.values():
        assert float(np.ptp(face.vertices[:, 1])) == pytest.approx(0.15)
    sides = [{tuple(p) for f in faces.values() if f.opening == k for p in f.vertices if p[1] == -0.15} for k in (0, 1)]
    assert sides[0] == sides[1] == {(x, -0.15, z) for x in (0.98, 2.05) for z in (0.0, 2.0)}


@pytest.mark.parametrize(("measured", "depth"), [(0.09, 0.09), (None, ASSUMED_LEAF), (0.0, 0.0)])
def test_leaves_sit_where_they_were_measured(measured: float | None, depth: float) -> None:
    door = Opening(3, "door", 0, np.array([1.0, 0.0]), np.array([2.0, 0.0]), 0.0, 2.0, depth=measured)
    faces = box(Layout((wall(0, (0, 0), (4, 0)),), (), (door,)))
    leaf = faces["door_003"]
    np.testing.assert_allclose(leaf.normal, [0, 1, 0], atol=1e-12)
    np.testing.assert_allclose(leaf.vertices[:, 1], -depth)
    assert len(faces) == (5 if depth > 0 else 1)


def test_leaves_stay_on_their_side_of_the_wall() -> None:
    pair = wall(0, (0, 0), (4, 0)), wall(1, (4, -0.1), (0, -0.1))
    doors = tuple(
        Opening(k, "door", k, np.array([1.0, y]), np.array([2.0, y]), 0.0, 2.0, depth=0.09)
        for k, y in enumerate((0.0, -0.1))
    )
    faces = box(Layout(pair, (), doors))
    assert faces["door_000"].vertices[0, 1] == pytest.approx(-0.045)
    assert faces["door_001"].vertices[0, 1] == pytest.approx(-0.055)


def test_nothing_says_how_thick_the_wall_is() -> None:
    faces = box(Layout((wall(0, (0, 0), (4, 0)),), (), (hole(0, 0, (1, 0), (2, 0)),)))
    for face in faces.values():
        assert float(np.ptp(face.vertices[:, 1])) == pytest.approx(ASSUMED_DEPTH)


def test_sides_that_nobody_saw_are_painted_like_those_of_their_opening() -> None:
    holes = hole(0, 0, (0.5, 0), (1.5, 0)), hole(1, 0, (2, 0), (3, 0))
    faces = tuple(box(Layout((wall(0, (0, 0), (4, 0)),), (), holes)).values())
    blue = np.tile(np.array([10, 20, 200], np.uint8), (6, 3, 1))
    blue[0] = 255  # a light, which is not the usual colour
    taken = tuple(replace(f, texture=blue, seen_fraction=1.0) if f.name == "reveal_000_left" else f for f in faces)
    painted = {face.name: face for face in with_side_colours(taken)}
    assert painted["reveal_000_left"] is taken[0]
    for name in ("reveal_000_right", "reveal_000_head"):
        texture, filled = painted[name].texture, painted[name].filled
        assert texture is not None and (texture == [10, 20, 200]).all()
        assert painted[name].seen_fraction == 0.0 and filled is not None and filled.all()
    assert painted["threshold_000"].texture is None, "the floor is another matter"
    assert all(face.texture is None for name, face in painted.items() if "_001" in name)
    assert with_side_colours(faces) == faces
