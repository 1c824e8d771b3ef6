"""What readers of logs share: one grid of bearings, stamps that increase, echoes."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
from bag_drive import (
    SCAN_PERIOD,
)
from hypothesis import given, settings
from hypothesis import strategies as st

from recon.sequence.open import open_sequence
from recon.sequence.scan_grid import Sweep, common_grid
from recon.sequence.stamps import increasing

# scanners whose beams wander


@given(seed=st.integers(0, 10**6), jitter=st.sampled_from([0.0, 0.01, 0.5]), counts=st.booleans())
@settings(max_examples=40, deadline=None)
def test_a_common_grid_keeps_bearings(seed: int, jitter: float, counts: bool) -> None:
    """Every beam's range is found at its bearing, to an eighth of a step."""
    rng = np.random.default_rng(seed)
    step = 2 * np.pi / 400
    sweeps = []
    for _ in range(12):
        beams = 400 - int(rng.integers(0, 8)) if counts else 400
        own = 2 * np.pi / beams if counts and jitter == 0.5 else step
        start = -np.pi + jitter * step * rng.uniform(-1, 1)
        sweeps.append(Sweep(start, own, rng.uniform(1, 9, beams).astype(np.float32)))
    grid = common_grid(sweeps)
    assert grid.kept.all()
    fine = len(grid.ranges[0]) > 500
    assert fine == (jitter == 0.5)
    for sweep, row in zip(sweeps, grid.ranges, strict=True):
        seen = np.flatnonzero(np.isfinite(row))
        assert len(seen) >= 0.97 * len(sweep.ranges)
        bearings = grid.start + grid.step * seen
        beam = np.rint((bearings - sweep.start) / sweep.step).astype(int)
        np.testing.assert_array_equal(row[seen], sweep.ranges[beam])
        off = bearings - (sweep.start + sweep.step * beam)
        assert np.abs(off).max() < step * (0.13 if fine else 0.25)


def test_first_echo_of_several(tmp_path: Path) -> None:
    from rosbags.rosbag2 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    echo, kind = store.types["sensor_msgs/msg/LaserEcho"], "sensor_msgs/msg/MultiEchoLaserScan"
    with Writer(tmp_path / "drive", version=9) as writer:
        connection = writer.add_connection("/echoes", kind, typestore=store)
        for i in range(3):
            stamp = store.types["builtin_interfaces/msg/Time"](sec=100, nanosec=i * SCAN_PERIOD)
            echoes = [echo(echoes=np.array(v, np.float32)) for v in ([2.0, 5.0], [], [3.0])]
            message = store.types[kind](
                store.types["std_msgs/msg/Header"](stamp, "laser"), -0.1, 0.1, 0.1, 0.0, 0.1, 0.05, 30.0, echoes, []
            )
            writer.write(connection, 10**11 + i, store.serialize_cdr(message, kind))
    ranges = open_sequence(tmp_path / "drive").scans.ranges
    np.testing.assert_array_equal(ranges, np.tile(np.array([2, np.inf, 3], np.float32), (3, 1)))


@given(st.lists(st.one_of(st.integers(0, 30).map(float), st.just(np.nan)), max_size=14))
def test_as_many_records_as_can_be_are_kept(times: list[float]) -> None:
    """Against trying every choice."""
    keep = increasing(times)
    kept = [t for t, ok in zip(times, keep, strict=True) if ok]
    assert all(a < b for a, b in pairwise(kept))
    longest: list[int] = []
    for i, t in enumerate(times):
        before = [longest[j] for j in range(i) if times[j] < t]
        longest.append(0 if np.isnan(t) else 1 + max(before, default=0))
    assert len(kept) == max(longest, default=0)
