"""Poses over time."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from recon.sequence.trajectory import Trajectory


@given(st.sets(st.integers(0, 60), min_size=1, max_size=12), st.lists(st.floats(-20, 80), min_size=1, max_size=8))
def test_nearest_is_nearer_than_every_other_pose(stamps: set[int], times: list[float]) -> None:
    trajectory = Trajectory(np.array(sorted(stamps), dtype=np.float64), np.zeros((len(stamps), 3)))
    found = trajectory.nearest(times)
    distance = np.abs(np.array(times)[:, None] - trajectory.timestamps)
    assert np.array_equal(distance[np.arange(len(times)), found], distance.min(axis=1))
