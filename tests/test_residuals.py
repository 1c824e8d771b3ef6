"""Residuals by kind and scan by scan, and walls that are one wall seen twice."""

from __future__ import annotations

import numpy as np
import pytest
from graph_drive import drive, polygon, simulate

from recon.config import GraphConfig
from recon.graph.estimate import WallLine
from recon.graph.result import unshadowed
from recon.graph.solve import solve_graph

ROOM = polygon([(-1, -1.5), (7, -1.5), (7, 2.5), (3, 2.5), (3, 4.5), (-1, 4.5)])


def test_residuals_of_known_noise_are_one() -> None:
    """Segments and motions with the covariances that they have; the scans' squares add up to the whole's."""
    run = simulate(ROOM, drive([(0, 0), (5, 0), (1, 2.5)]), 4)
    estimate = solve_graph(run.start, run.motion, run.observations, None, GraphConfig(manhattan=False))
    assert set(estimate.residuals) == set(estimate.scan_residuals) == {"lidar", "motion"}
    assert 0.7 < estimate.residuals["lidar"] < 1.3
    by_scan = estimate.scan_residuals
    assert len(by_scan["lidar"]) == len(by_scan["motion"]) == len(run.truth)
    assert np.isnan(by_scan["motion"][0]) and np.isfinite(by_scan["motion"][1:]).all()
    whole = np.sqrt(np.mean(by_scan["motion"][1:] ** 2))
    assert whole == pytest.approx(estimate.residuals["motion"], rel=1e-9)
    assert 0.5 < np.nanmedian(by_scan["lidar"]) < 1.5


def test_a_scan_that_slipped_stands_out() -> None:
    run = simulate(ROOM, drive([(0, 0), (5, 0), (1, 2.5)]), 5)
    run.motion.relative[11] += [0.15, 0.0, 0.0]
    estimate = solve_graph(run.start, run.motion, run.observations, None, GraphConfig(manhattan=False))
    assert int(np.nanargmax(estimate.scan_residuals["motion"])) == 12


def wall(x: float, y: float, degrees: float, seen: int) -> WallLine:
    pose = np.array([x, y, np.radians(degrees)])
    return WallLine(pose, np.array([[-2.0, 2.0]]), 0.003, 0.001, "lidar", seen)


@pytest.mark.parametrize(
    ("other", "kept"),
    [
        (wall(0.2, 0.02, 0.8, 90), [100]),  # the same, seen with the scanner's own errors
        (wall(0.2, 0.08, 0.8, 90), [100, 90]),  # a panel before the wall
        (wall(0.2, 0.08, 0.8, 30), [100]),  # hardly seen
        (wall(0.2, 0.02, 180.8, 90), [100, 90]),  # its other side
        (wall(3.0, 0.02, 0.8, 90), [100, 90]),  # farther along
    ],
)
def test_walls_that_coincide_are_one(other: WallLine, kept: list[int]) -> None:
    found = unshadowed([wall(0, 0, 0, 100), other])
    assert [w.observations for w in found] == kept
