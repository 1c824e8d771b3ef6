"""Furniture that a scanner takes for walls, told from them by images."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from layout_drive import cast, chain, drive, estimated, line, ring
from numpy.typing import NDArray

from recon.config import LayoutConfig
from recon.furniture import suspects
from recon.geometry import Array, Pose3
from recon.layout.build import build_layout
from recon.model import Layout, Room, Wall
from recon.segmentation.furniture import ends_below_the_ceiling, standing_furniture
from recon.segmentation.solid import STEP, SolidFit
from recon.sequence.camera import Camera
from recon.simulate.plan import Plan, PlanCamera, PlanDrive, PlanObject, PlanRoom
from recon.simulate.render import Exposure, Renderer
from recon.simulate.simulation import image_poses, run_simulation
from recon.simulate.truth import true_camera, true_extrinsics

ROOM = ((0.0, 0.0), (6.0, 0.0), (6.0, 4.0), (0.0, 4.0))
PIER = ((0.0, 0.0), (6.0, 0.0), (6.0, 4.0), (3.6, 4.0), (3.6, 3.3), (1.6, 3.3), (1.6, 4.0), (0.0, 4.0))
"""As `ROOM`, and where the sofa stands the wall comes forward."""
SOFA = PlanObject((2.6, 3.65), (2.0, 0.7), top=0.75, style="fabric")


@cache
def shot(with_sofa: bool) -> tuple[Camera, tuple[Pose3, ...], tuple[NDArray[np.uint8], ...]]:
    """A drive past the sofa, or past the wall that comes forward in its place."""
    plan = Plan(
        rooms=(PlanRoom(ROOM if with_sofa else PIER),),
        path=((1.0, 1.0), (3.0, 0.8), (5.0, 1.4), (4.0, 2.2)),
        objects=(SOFA,) if with_sofa else (),
        camera=PlanCamera(image_width=320, image_height=240, fx=230.0, fy=230.0, tilt_deg=3.0, yaw_deg=60.0, rate=1.5),
        drive=PlanDrive(corner_radius=0.2),
    )
    simulation = run_simulation(plan, 5)
    camera = true_camera(plan.camera)
    map_from_plan = Pose3.from_planar(simulation.map_from_plan)
    poses = [map_from_plan.inverse() @ p for p in image_poses(simulation, true_extrinsics(plan))]
    renderer = Renderer(simulation.building, camera, 5)
    images = tuple(renderer.render(pose, Exposure(1.0, 2.0, (i,)))[0] for i, pose in enumerate(poses))
    return camera, tuple(poses), images


def outline(*corners: tuple[float, float]) -> Layout:
    """One room and its walls."""
    ring = np.array(corners)
    pairs = zip(ring, np.roll(ring, -1, axis=0), strict=True)
    walls = tuple(Wall(i, a, b, 0.005, 0.002, "lidar", 50) for i, (a, b) in enumerate(pairs))
    return Layout(walls, (Room(0, "room", ring),), default_ceiling_height=2.6)


def test_a_wall_before_another_is_doubtful() -> None:
    """The front of what fills the pier: 2 m by 0.7 m, between the rooms' outline and the wall behind."""
    (thing,) = suspects(outline(*PIER))
    assert shapely.Polygon(thing.footprint).symmetric_difference(shapely.box(1.6, 3.3, 3.6, 4.0)).area < 1e-9
    assert shapely.Polygon(thing.footprint).exterior.is_ccw
    np.testing.assert_allclose(thing.normal, [0, -1], atol=1e-12)


def test_a_wall_with_a_room_behind_is_not_doubtful() -> None:
    layout = outline(*PIER)
    behind = Room(1, "behind", np.array([[1.7, 3.4], [3.5, 3.4], [3.5, 4.0], [1.7, 4.0]]))
    assert suspects(replace(layout, rooms=(*layout.rooms, behind))) == []


@given(st.floats(-0.16, 0.16), st.floats(0.3, 5.0), st.floats(-0.3, 1.5))
@settings(deadline=None, max_examples=60)
def test_footprints_are_sound(turn: float, length: float, depth: float) -> None:
    """Whatever stands before a wall, parallel or nearly so: simple, counter-clockwise, of that depth."""
    front = np.array([[3.0 + length, 4.0 - depth], [3.0, 4.0 - depth + length * np.sin(turn)]])
    walls = (Wall(0, np.array([2.9, 4.0]), np.array([0.0, 4.0]), 0.005, 0.002, "lidar", 50),)
    layout = Layout((*walls, Wall(1, front[0], front[1], 0.005, 0.002, "lidar", 50)), ())
    for thing in suspects(layout):
        assert thing.polygon.is_valid and thing.polygon.exterior.is_ccw
        assert 0.19 < thing.depth < 1.11
        assert not thing.owns(thing.footprint[2:]).any() and thing.owns(thing.footprint[:2]).all()


def test_a_plain_room_has_no_doubtful_walls() -> None:
    assert suspects(outline(*ROOM)) == []


@pytest.mark.parametrize("with_sofa", [True, False])
def test_images_tell_a_sofa_from_a_wall(with_sofa: bool) -> None:
    """The scanner sees the same of both."""
    camera, poses, images = shot(with_sofa)
    doubtful = suspects(outline(*PIER))
    found = standing_furniture(doubtful, outline(*ROOM), camera, poses, lambda i: images[i])
    assert len(found) == with_sofa


def test_images_that_do_not_show_it_change_nothing() -> None:
    camera, poses, images = shot(True)
    back = [pose @ Pose3(np.diag([-1.0, 1.0, -1.0]), np.zeros(3)) for pose in poses]
    doubtful = suspects(outline(*PIER))
    assert standing_furniture(doubtful, outline(*ROOM), camera, back, lambda i: images[i]) == []
    assert standing_furniture(doubtful, outline(*ROOM), camera, [None] * len(poses), lambda i: images[i]) == []
    assert standing_furniture(doubtful, outline(*ROOM), camera, poses, lambda i: None) == []


def profile(top: float, own: float, behind: float, seen: float) -> SolidFit:
    """Evidence `own` up to `top`, then `behind` up to `seen` m."""
    heights = (np.arange(round(2.6 / STEP)) + 0.5) * STEP
    return SolidFit((0.0, top), np.where(heights < top, own, np.where(heights < seen, behind, np.nan)))


def test_a_top_must_be_seen() -> None:
    """And lie below any ceiling, and what is above it look like what is behind."""
    assert ends_below_the_ceiling(profile(0.8, 3.5, -3.0, 2.0))
    assert not ends_below_the_ceiling(profile(0.8, 3.5, -3.0, 1.0))
    assert not ends_below_the_ceiling(profile(0.8, 3.5, -0.2, 2.0))
    assert not ends_below_the_ceiling(profile(0.8, 1.2, -3.0, 2.0))
    assert not ends_below_the_ceiling(profile(2.3, 3.5, -3.0, 2.6))
    assert not ends_below_the_ceiling(replace(profile(0.8, 3.5, -3.0, 2.0), span=(0.4, 0.8)))


def test_the_plan_goes_on_behind_known_furniture() -> None:
    """A sofa that fills a corner as an L does: the corner is closed, its walls hidden there, the sofa an object."""
    front, x0 = 3.3, 3.2
    solid = [*chain((6, 0), (6, front), (x0, front), (x0, 4), (0, 4), (0, 0), (6, 0))]
    walls = [
        line((0, 0), (6, 0)),
        line((6, 0), (6, front)),
        line((6, front), (x0, front)),
        line((x0, front), (x0, 4)),
        line((x0, 4), (0, 4)),
        line((0, 4), (0, 0)),
    ]
    poses = drive((1, 1), (5, 1), (3, 2), (1, 2.5))
    estimate, scans = estimated(walls, poses), cast(np.array(solid, float), poses, 12.0)
    taken = build_layout(estimate, scans, LayoutConfig())
    doubtful = suspects(taken)
    layout = build_layout(estimate, scans, LayoutConfig(), doubtful)
    assert area(taken.rooms) == pytest.approx(24 - 0.7 * (6 - x0), abs=0.05)
    assert area(layout.rooms) == pytest.approx(24.0, abs=0.05)
    footprint = shapely.box(x0, front, 6, 4)
    shares = [shapely.Polygon(o.footprint).intersection(footprint).area / footprint.area for o in layout.objects]
    assert max(shares) > 0.9
    assert all(w.source == "inferred" or np.ptp(w.unseen, axis=1).sum() > 0 for w in layout.walls if hidden(w, x0))


def test_the_room_goes_on_over_a_known_island() -> None:
    """A block of 2 by 1.6 m in the middle of a room: four walls to the scanner, an object once images tell."""
    x, y = (3.0, 5.0), (2.2, 3.8)
    block = [(x[0], y[0]), (x[0], y[1]), (x[1], y[1]), (x[1], y[0])]
    corners = [(0.0, 0.0), (8.0, 0.0), (8.0, 6.0), (0.0, 6.0)]
    solid = [*chain(*corners, corners[0]), *chain(*block, block[0])]
    poses = drive((1, 1), (7, 1), (7, 5), (1, 5), (1, 1))
    scans = cast(np.array(solid, float), poses, 12.0)
    estimate = estimated(ring(*corners) + ring(*block), poses)
    taken = build_layout(estimate, scans, LayoutConfig())
    (thing,) = suspects(taken)
    assert thing.island
    assert shapely.Polygon(thing.footprint).symmetric_difference(shapely.box(x[0], y[0], x[1], y[1])).area < 0.1
    layout = build_layout(estimate, scans, LayoutConfig(), [thing])
    assert area(taken.rooms) == pytest.approx(48 - 3.2, abs=0.1) and len(taken.walls) == 8
    assert area(layout.rooms) == pytest.approx(48.0, abs=0.1) and len(layout.walls) == 4
    assert len(layout.objects) == 1 and shapely.Polygon(layout.objects[0].footprint).area == pytest.approx(3.2, abs=0.1)


def area(rooms: tuple[Room, ...]) -> float:
    return sum(room.area for room in rooms)


def hidden(wall: Wall, x0: float) -> bool:
    """Whether most of a wall lies behind the sofa."""
    middle: Array = (wall.start + wall.end) / 2
    return bool(middle[1] > 3.95 and middle[0] > x0)
