"""Leaves of doors that stand open."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from recon.layout.evidence import FreeSpace
from recon.layout.swing import Swings
from recon.model import Wall

LOW, HIGH = 1.5, 2.5


def _room(things: list[np.ndarray], turn: float) -> tuple[Wall, Swings]:
    """A wall 5 m long with a gap from LOW to HIGH, with straight things (2, 2) m; long ones are walls."""
    axis = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    resolution, origin = 0.05, np.array([-8.0, -8.0])
    blocked = np.zeros((320, 320), np.bool_)
    pieces = [np.array([[0.0, 0.0], [LOW, 0.0]]), np.array([[HIGH, 0.0], [5.0, 0.0]]), *things]
    for start, end in pieces:
        along = np.linspace(0, 1, 400)[:, None]
        cell = np.floor(((start + along * (end - start)) @ axis.T - origin) / resolution).astype(int)
        blocked[cell[:, 1], cell[:, 0]] = True
    space = FreeSpace(origin, resolution, ~blocked, blocked, blocked)
    ends = np.array([[0.0, 0.0], [5.0, 0.0]]) @ axis.T
    wall = Wall(0, ends[0], ends[1], 0.01, 0.01, "lidar", 9)
    long = [
        Wall(1, a, b, 0.01, 0.01, "lidar", 9)
        for a, b in (piece @ axis.T for piece in things)
        if np.linalg.norm(b - a) > 1.5
    ]
    return wall, Swings([wall, *long], space)


def _swung(hinge: float, degrees: float, length: float) -> np.ndarray:
    angle = np.radians(degrees)
    return np.array([[hinge, 0.0], [hinge + length * np.cos(angle), length * np.sin(angle)]])


@settings(max_examples=40, deadline=None)
@given(st.floats(45, 135), st.booleans(), st.sampled_from([-1, 1]), st.floats(0, 6.28))
def test_a_leaf_at_either_end_on_either_side_is_found(degrees: float, at_end: bool, side: int, turn: float) -> None:
    wall, swings = _room([_swung(HIGH if at_end else LOW, side * degrees, HIGH - LOW)], turn)
    assert swings.has_leaf(wall, LOW, HIGH)


@settings(max_examples=40, deadline=None)
@given(st.floats(45, 135), st.booleans(), st.sampled_from([0.0, 0.4, 2.5]), st.floats(0, 6.28))
def test_nothing_short_stubs_and_long_walls_are_no_leaves(
    degrees: float, at_end: bool, size: float, turn: float
) -> None:
    wall, swings = _room([_swung(HIGH if at_end else LOW, degrees, size * (HIGH - LOW))], turn)
    assert not swings.has_leaf(wall, LOW, HIGH)


def test_a_leaf_that_hangs_in_the_far_face_is_found() -> None:
    leaf = _swung(LOW, -90, HIGH - LOW) + np.array([0.0, -0.2])
    wall, swings = _room([leaf], 0.3)
    assert swings.has_leaf(wall, LOW, HIGH)
