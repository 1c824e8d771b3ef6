"""Jambs of doors, passages and windows: placed by the beams beside them, against a wall cast exactly."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recon.geometry import Array
from recon.layout.jambs import with_jambs
from recon.model import Opening, OpeningType, Wall
from recon.sequence.sequence import Scans
from recon.sequence.trajectory import Trajectory

BEAMS = 720
ROOM_BEHIND = 2.5
"""m from the face."""
CASING = 0.06
"""m, its width."""
WALL = Wall(0, np.array([0.0, 0.0]), np.array([4.0, 0.0]), 0.001, 0.0005, "lidar", 100)


def cast(place: Array, angles: Array, low: float, high: float, depth: float, behind: float, proud: float) -> Array:
    """Ranges (B,) m from `place` to the line y = 0 with a hole from low to high m, reveals `depth` m deep, a casing
    that stands `proud` m before the face, and a surface `behind` m behind it; inf upwards. Beam by beam."""
    ranges = np.full(len(angles), np.inf)
    for k, angle in enumerate(angles):
        dx, dy = np.cos(angle), np.sin(angle)
        if dy > -1e-3:
            continue
        x = place[0] - (place[1] - proud) / dy * dx
        if not low < x < high:
            on_casing = low - CASING < x < high + CASING
            ranges[k] = -(place[1] - (proud if on_casing else 0.0)) / dy
            continue
        far = place[0] - (place[1] + behind) / dy * dx
        side = low if dx < 0 else high
        y = place[1] + (side - place[0]) / dx * dy if abs(dx) > 1e-9 else -np.inf
        hits_reveal = not low < far < high and -depth <= y <= proud
        ranges[k] = (side - place[0]) / dx if hits_reveal else -(place[1] + behind) / dy
    return ranges


def drive(
    low: float, high: float, depth: float, behind: float, seed: int, proud: float = 0.0
) -> tuple[Trajectory, Scans]:
    """60 scans past a wall, 1.5 m from it, 1 cm of noise, poses 0.5 mm off."""
    rng = np.random.default_rng(seed)
    times = np.arange(60) / 8.0
    poses = np.column_stack([np.linspace(0.2, 3.8, 60), np.full(60, 1.5), np.full(60, -np.pi / 2)])
    step = np.radians(270.0) / (BEAMS - 1)
    bearings = -np.radians(135.0) + step * np.arange(BEAMS)
    turned = poses + rng.normal(0.0, [0.0005, 0.0005, 0.0002], poses.shape)
    ranges = np.array([cast(p[:2], p[2] + bearings, low, high, depth, behind, proud) for p in turned])
    ranges += rng.normal(0.0, 0.01, ranges.shape)
    stray = rng.random(ranges.shape) < 0.01
    ranges[stray] *= rng.random(int(stray.sum()))
    return Trajectory(times, poses), Scans(
        times, ranges.astype(np.float32), float(bearings[0]), float(step), 0.1, 12.0, 0.0
    )  # fmt: skip


def opening(kind: OpeningType, low: float, high: float) -> Opening:
    return Opening(0, kind, 0, np.array([low, 0.0]), np.array([high, 0.0]), 0.0, 2.0)


@settings(deadline=None, max_examples=8)
@given(
    kind=st.sampled_from(["passage", "door", "window"]),
    low=st.floats(0.6, 1.6),
    width=st.floats(0.7, 1.6),
    wrong=st.tuples(st.floats(-0.1, 0.1), st.floats(-0.1, 0.1)),
    depth=st.sampled_from([0.07, 0.11, 0.24]),
    seed=st.integers(0, 1000),
)
def test_jambs_are_where_the_wall_ends_wherever_they_were_sought(
    kind: OpeningType, low: float, width: float, wrong: tuple[float, float], depth: float, seed: int
) -> None:
    high = low + width
    behind = {"door": 0.06, "passage": ROOM_BEHIND, "window": 100.0}[kind]  # beyond the range: lost
    trajectory, scans = drive(low, high, 0.06 if kind == "door" else depth, behind, seed)
    (found,) = with_jambs([opening(kind, low + wrong[0], high + wrong[1])], [WALL], trajectory, scans)
    assert (found.start[0], found.end[0]) == pytest.approx((low, high), abs=0.005)
    assert found.sigma_jambs is not None and 0.0005 < found.sigma_jambs < 0.006


def test_openings_are_neither_too_narrow_nor_too_wide_and_sigmas_are_honest() -> None:
    narrow, ratios = [], []
    for seed in range(12):
        low, high = 1.0 + 0.037 * seed, 2.0 + 0.041 * seed
        trajectory, scans = drive(low, high, 0.12, ROOM_BEHIND, seed)
        (found,) = with_jambs([opening("passage", low + 0.011, high - 0.011)], [WALL], trajectory, scans)
        errors = np.array([found.start[0] - low, high - found.end[0]])
        assert found.sigma_jambs is not None
        narrow += errors.tolist()
        ratios += (np.abs(errors) / found.sigma_jambs).tolist()
    assert abs(np.median(narrow)) < 0.001  # returns' outermost ones gave 11 mm
    assert np.mean(np.array(ratios) < 1) > 0.5
    assert np.mean(np.array(ratios) < 2) > 0.85
    assert np.median(ratios) > 0.2  # nor are they far too large


def test_casings_that_stand_before_the_face_make_no_opening_narrower() -> None:
    narrow = []
    for seed in range(6):
        low, high = 1.2 + 0.037 * seed, 2.2 + 0.041 * seed
        trajectory, scans = drive(low, high, 0.08, 0.08, seed, proud=0.02)
        aside = trajectory.poses[:, 0] < 0.9  # from there the casing hides the leaf next to the first jamb
        part = dataclasses.replace(scans, timestamps=scans.timestamps[aside], ranges=scans.ranges[aside])
        (found,) = with_jambs([opening("door", low + 0.011, high - 0.011)], [WALL], trajectory, part)
        narrow.append(found.start[0] - low)
    assert abs(np.median(narrow)) < 0.002
    assert np.abs(narrow).max() < 0.006


def test_a_jamb_that_is_seen_on_its_reveal_only_is_where_the_reveal_is() -> None:
    trajectory, scans = drive(1.5, 2.5, 0.2, ROOM_BEHIND, 3)
    before = trajectory.poses[:, 0] < 1.2  # from there the first jamb's reveal is hidden, the second's is all there is
    part = dataclasses.replace(scans, timestamps=scans.timestamps[before], ranges=scans.ranges[before])
    (found,) = with_jambs([opening("passage", 1.52, 2.47)], [WALL], trajectory, part)
    assert (found.start[0], found.end[0]) == pytest.approx((1.5, 2.5), abs=0.005)


def test_what_too_few_beams_saw_stays_and_has_no_sigma() -> None:
    trajectory, scans = drive(1.0, 2.0, 0.1, ROOM_BEHIND, 0)
    few = dataclasses.replace(scans, ranges=np.full_like(scans.ranges, np.nan))
    (found,) = with_jambs([opening("passage", 1.02, 1.97)], [WALL], trajectory, few)
    assert (found.start[0], found.end[0]) == pytest.approx((1.02, 1.97))
    assert found.sigma_jambs is None
    backwards = dataclasses.replace(
        opening("passage", 1.02, 1.97), start=np.array([1.97, 0.0]), end=np.array([1.02, 0])
    )
    (found,) = with_jambs([backwards], [WALL], trajectory, scans)
    assert (found.start[0], found.end[0]) == pytest.approx((2.0, 1.0), abs=0.005)  # in the order that it had
