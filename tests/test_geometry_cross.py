"""Vector products, by an independent computation."""

from __future__ import annotations

import numpy as np
import pytest

from recon.geometry import cross


@pytest.mark.parametrize("shapes", [((3,), (3,)), ((5, 3), (3,)), ((3,), (5, 3)), ((4, 1, 3), (5, 3)), ((0, 3), (3,))])
def test_cross_is_that_of_numpy_to_the_bit(shapes: tuple[tuple[int, ...], tuple[int, ...]]) -> None:
    rng = np.random.default_rng(4)
    a, b = (rng.normal(size=shape) for shape in shapes)
    np.testing.assert_array_equal(cross(a, b), np.cross(a, b))
