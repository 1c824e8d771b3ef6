"""What moved is told from what stayed, by the rays that passed its place at other times."""

from __future__ import annotations

import numpy as np
import pytest

from recon.geometry import Array
from recon.layout.evidence import free_space
from recon.layout.moving import stays
from recon.sequence.trajectory import Trajectory

LOW, HIGH = np.array([-3.0, -2.0]), np.array([3.0, 2.0])
POLE, POLE_RADIUS = np.array([1.2, 0.9]), 0.03
BODY = 0.2
"""m, radius of a person."""


def circle(starts: Array, ways: Array, centre: Array, radius: float) -> Array:
    """(N,) how far rays go to an upright cylinder, inf past it."""
    to = centre - starts
    along = np.einsum("ni,ni->n", to, ways)
    square = radius**2 - (np.einsum("ni,ni->n", to, to) - along**2)
    near = along - np.sqrt(np.maximum(square, 0.0))
    return np.where((square > 0) & (near > 0), near, np.inf)


def drive(noise: float, beams: int) -> tuple[Array, Array, Array, Array]:
    """Starts, ends (R, 2), times (R,) and what returned each ray: 0 a wall, 1 a pole, 2 a person who walks by.

    30 s in a room, five scans a second; the person crosses it and stands at five places on the way, for 5 s each.
    """
    rng = np.random.default_rng(3)
    rows = []
    for time in np.arange(0.0, 30.0, 0.2):
        start = np.array([-2.0 + 0.08 * time, -0.8 + 0.02 * time])
        bearings = np.linspace(-np.pi, np.pi, beams, endpoint=False) + 0.01 * time + 1e-3
        ways = np.stack([np.cos(bearings), np.sin(bearings)], axis=1)
        starts = np.broadcast_to(start, ways.shape)
        wall = np.min(np.where(ways > 0, HIGH - start, LOW - start) / ways, axis=1)
        person = np.array([2.0 - 0.9 * (time // 6 + max(time % 6 - 5, 0.0)), 0.3])
        ranges = np.stack([wall, circle(starts, ways, POLE, POLE_RADIUS), circle(starts, ways, person, BODY)], axis=1)
        reach = ranges.min(axis=1) + rng.normal(0.0, noise, beams)
        rows.append(
            np.column_stack([starts, starts + reach[:, None] * ways, np.full(beams, time), ranges.argmin(axis=1)])
        )
    table = np.concatenate(rows)
    return table[:, :2], table[:, 2:4], table[:, 4], table[:, 5]


@pytest.mark.parametrize(("noise", "beams"), [(0.005, 720), (0.02, 360), (0.04, 720)])
def test_people_move_and_walls_and_poles_stay(noise: float, beams: int) -> None:
    starts, ends, times, owner = drive(noise, beams)
    still = stays(starts, ends, times)
    assert still[owner == 0].mean() > 0.995
    assert still[owner == 1].mean() > 0.9
    assert np.count_nonzero(owner == 2) > 500 and still[owner == 2].mean() < 0.3


def test_where_a_person_stood_is_free_and_where_a_pole_stands_is_not() -> None:
    starts, ends, times, owner = drive(0.01, 720)
    path = Trajectory(np.unique(times), np.array([[*starts[times == t][0], 0.0] for t in np.unique(times)]))
    walked = ends[owner == 2]
    closed = free_space(path, starts, ends)
    found = free_space(path, starts, ends, stays(starts, ends, times))
    assert closed.is_free(walked).mean() < 0.75 and found.is_free(walked).mean() > 0.98
    assert not found.is_free(POLE[None]).any()


def test_without_rays_nothing_moved() -> None:
    assert stays(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0)).shape == (0,)
