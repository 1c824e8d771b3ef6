"""Piers between doors."""

import numpy as np
import pytest

from recon.layout.evidence import FreeSpace
from recon.layout.line import PlanLine
from recon.layout.piers import with_piers
from recon.layout.returns import Returns

EVERYWHERE = FreeSpace(np.array([-10.0, -10.0]), 0.05, *np.stack([np.ones((600, 600)), *np.zeros((2, 600, 600))]) > 0)


def _line(start: tuple[float, float], direction: tuple[float, float], *stretches: tuple[float, float]) -> PlanLine:
    seen = np.array(stretches)
    return PlanLine(np.array(start), np.array(direction), seen, np.zeros((0, 2)), 0.01, 0.01, "lidar", 9)


def _returns(low: float, high: float) -> Returns:
    """Of a thing on the x axis from `low` to `high`, seen from above."""
    x = np.linspace(low, high, 200)
    ends = np.stack([x, np.zeros_like(x)], axis=1)
    return Returns(ends + np.array([0.0, 2.0]), ends)


@pytest.mark.parametrize(
    ("low", "high", "is_pier"),
    [(4.4, 4.7, True), (4.42, 4.46, False), (4.0, 5.0, False), (3.1, 3.4, False)],
    ids=["pier", "table leg", "leaf", "too far from the other end"],
)
def test_a_pier_between_two_doors_supports_the_wall(low: float, high: float, is_pier: bool) -> None:
    wall = _line((0.0, 0.0), (1.0, 0.0), (0.0, 3.0), (6.0, 9.0))
    (found,) = with_piers([wall], _returns(low, high), EVERYWHERE)
    assert len(found.front) == 2 + is_pier and len(found.back) == 0
    if is_pier:
        assert found.front[1] == pytest.approx([low, high], abs=0.06)


@pytest.mark.parametrize("meets", [True, False])
def test_a_pier_after_the_last_stretch_must_lead_to_another_wall(meets: bool) -> None:
    wall = _line((0.0, 0.0), (1.0, 0.0), (0.0, 3.0))
    across = _line((5.5 if meets else 9.0, -3.0), (0.0, 1.0), (0.0, 6.0))
    found = with_piers([wall, across], _returns(4.1, 4.4), EVERYWHERE)[0]
    assert len(found.front) == 1 + meets


def test_what_stands_in_unseen_space_is_no_pier() -> None:
    wall = _line((0.0, 0.0), (1.0, 0.0), (0.0, 3.0), (6.0, 9.0))
    nothing = np.zeros((600, 600), np.bool_)
    unseen = FreeSpace(EVERYWHERE.origin, 0.05, nothing, nothing, nothing)
    (found,) = with_piers([wall], _returns(4.4, 4.7), unseen)
    assert len(found.front) == 2
