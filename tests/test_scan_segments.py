"""Segments of a drive in one table are those of its scans one by one."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recon.lidar.segment import ScanSegments, Segments


def segments(seed: int, count: int) -> Segments:
    rng = np.random.default_rng(seed)
    return Segments(
        rng.normal(size=(count, 2, 2)),
        rng.normal(size=(count, 2, 2)),
        rng.integers(3, 90, size=count),
        rng.integers(0, 360, size=(count, 2)),
    )


@settings(deadline=None)
@given(st.lists(st.integers(0, 4), max_size=6))
def test_table_holds_every_scan(counts: list[int]) -> None:
    scans = [segments(seed, count) for seed, count in enumerate(counts)]
    packed = ScanSegments.pack(scans)
    assert len(packed) == len(scans)
    for one, other in zip(packed, scans, strict=True):
        for name in ("endpoints", "covariance", "counts", "beams"):
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    assert packed.scan.tolist() == [i for i, count in enumerate(counts) for _ in range(count)]
    assert len(packed.table) == sum(counts)


def test_scans_are_taken_as_from_a_list() -> None:
    packed = ScanSegments.pack([segments(0, 2), segments(1, 0), segments(2, 3)])
    assert [len(s) for s in packed[1:]] == [0, 3]
    assert len(packed[-1]) == 3
    assert packed[0].endpoints.base is packed.table.endpoints  # a view: nothing is copied
    with pytest.raises(IndexError):
        packed[3]
