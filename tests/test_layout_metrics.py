"""The field's layout metrics on plans whose scores can be worked out by hand."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recon.evaluate.heights import height_errors
from recon.evaluate.layout import layout_scores
from recon.evaluate.openings import opening_scores
from recon.evaluate.rooms import RoomScores, corners_of, room_scores
from recon.evaluate.score import Score, match, total
from recon.evaluate.sigmas import sigma_scores
from recon.geometry import apply2
from recon.model import Layout, Opening, OpeningType, Room, Wall

Points = list[tuple[float, float]]


def box(x: float, y: float, width: float, depth: float) -> Points:
    return [(x, y), (x + width, y), (x + width, y + depth), (x, y + depth)]


def rooms(*polygons: Points) -> tuple[Room, ...]:
    return tuple(Room(i, f"room {i}", np.array(p, dtype=float)) for i, p in enumerate(polygons))


def walls(*polygons: Points, sigma: float = 0.004) -> tuple[Wall, ...]:
    rings = [np.array(p, dtype=float) for p in polygons]
    edges = [(a, b) for ring in rings for a, b in zip(ring, np.roll(ring, -1, axis=0), strict=True)]
    return tuple(Wall(i, a, b, sigma, sigma / 2, "lidar", 9) for i, (a, b) in enumerate(edges))


def counts(scores: RoomScores, kind: str) -> list[tuple[int, int, int]]:
    parts = [getattr(c, kind) for c in scores.corners]
    return [(s.found, s.true, s.right) for s in parts]


def test_precision_recall_f1() -> None:
    score = Score(found=4, true=8, right=3)
    assert (score.precision, score.recall, score.f1) == (0.75, 0.375, 0.5)
    assert Score(0, 0, 0).to_json() == {"found": 0, "true": 0, "right": 0, "precision": 1.0, "recall": 1.0, "f1": 1.0}
    assert (Score(2, 0, 0).precision, Score(2, 0, 0).recall, Score(2, 0, 0).f1) == (0.0, 0.0, 0.0)
    assert (Score(0, 2, 0).precision, Score(0, 2, 0).recall, Score(0, 2, 0).f1) == (0.0, 0.0, 0.0)
    assert total([score, Score(1, 2, 1)]) == Score(5, 10, 4)


def test_matching_prefers_more_pairs_over_nearer_ones() -> None:
    """A greedy match of the nearest pair would leave the second row alone."""
    cost = np.array([[0.01, 0.09], [0.05, 0.5]])
    assert [part.tolist() for part in match(cost, 0.1)] == [[0, 1], [1, 0]]
    assert [part.tolist() for part in match(cost, 0.02)] == [[0], [0]]
    assert [len(part) for part in match(np.zeros((0, 3)), 1.0)] == [0, 0]


def test_a_shifted_square() -> None:
    """15 cm along x: intersection 3.85 x 4 of a union of 4.15 x 4; every corner is 15 cm off, every angle right."""
    scores = room_scores(rooms(box(0.15, 0, 4, 4)), rooms(box(0, 0, 4, 4)))
    assert scores.rooms == Score(1, 1, 1)
    assert scores.iou == pytest.approx(3.85 / 4.15)
    assert scores.area_error == pytest.approx(0.0) and scores.total_area_error == pytest.approx(0.0)
    assert counts(scores, "corners") == [(4, 4, 0), (4, 4, 4), (4, 4, 4)]
    assert scores.corners[2].threshold == pytest.approx(4.8 * 10 / 256), "10 pixels of 256, of a plan 4.8 m wide"
    assert counts(scores, "angles")[1] == (4, 4, 4)


def test_a_square_too_large() -> None:
    scores = room_scores(rooms(box(0, 0, 4.2, 4)), rooms(box(0, 0, 4, 4)))
    assert scores.area_error == pytest.approx(0.05) and scores.total_area_error == pytest.approx(0.05)
    assert counts(scores, "corners")[0] == (4, 4, 2)


def test_a_split_room() -> None:
    """3 m and 1 m of a room 4 m wide: the larger part stands for it; two of its corners are right, of eight found."""
    scores = room_scores(rooms(box(0, 0, 3, 4), box(3, 0, 1, 4)), rooms(box(0, 0, 4, 4)))
    assert scores.rooms == Score(2, 1, 1) and scores.rooms.f1 == pytest.approx(2 / 3)
    assert scores.iou == pytest.approx(0.75) and scores.area_error == pytest.approx(0.25)
    assert scores.total_area_error == pytest.approx(0.0)
    assert counts(scores, "corners")[0] == (8, 4, 2)


def test_two_halves_are_no_room() -> None:
    """An intersection over union of exactly one half does not count, as in the field."""
    scores = room_scores(rooms(box(0, 0, 2, 4), box(2, 0, 2, 4)), rooms(box(0, 0, 4, 4)))
    assert scores.rooms == Score(2, 1, 0)
    assert counts(scores, "corners")[0] == counts(scores, "angles")[0] == (8, 4, 0)
    assert np.isnan(scores.iou) and scores.to_json()["rooms"]["iou"] is None


def test_merged_and_missing_rooms() -> None:
    truth = rooms(box(0, 0, 4, 4), box(4.1, 0, 1, 4), box(10, 0, 2, 2))
    merged = room_scores(rooms(box(0, 0, 5.1, 4)), truth)
    assert merged.rooms == Score(1, 3, 1) and merged.rooms.recall == pytest.approx(1 / 3)
    assert counts(merged, "corners")[0] == (4, 12, 2)
    assert merged.total_area_error == pytest.approx(20.4 / 24 - 1)
    nothing = room_scores((), truth)
    assert nothing.rooms == Score(0, 3, 0) and nothing.total_area_error == -1.0


def test_rooms_that_overlap_are_both_wrong() -> None:
    truth = rooms(box(0, 0, 4, 4), box(4, 0, 4, 4))
    apart = room_scores(rooms(box(0, 0, 4.05, 4), box(4, 0, 4, 4)), truth)
    assert apart.rooms == Score(2, 2, 2), "5 cm are within the tolerance"
    over = room_scores(rooms(box(0, 0, 4.3, 4), box(4, 0, 4, 4)), truth)
    assert over.rooms == Score(2, 2, 0)


def test_angles_are_scored_beside_corners() -> None:
    """One corner of a 1 m square moved 15 cm: two angles are off by atan 0.15 = 8.5 degrees."""
    moved = [(0.0, 0.0), (1.0, 0.0), (1.15, 1.0), (0.0, 1.0)]
    scores = room_scores(rooms(moved), rooms(box(0, 0, 1, 1)))
    assert counts(scores, "corners")[:2] == [(4, 4, 3), (4, 4, 4)]
    assert counts(scores, "angles")[:2] == [(4, 4, 2), (4, 4, 2)]


def test_an_invented_corner_costs_precision_only() -> None:
    """A notch of 30 cm in one corner: its three corners are none of the true ones, and the true one is missed."""
    notched = [(0.0, 0.0), (4.0, 0.0), (4.0, 3.7), (3.7, 3.7), (3.7, 4.0), (0.0, 4.0)]
    scores = room_scores(rooms(notched), rooms(box(0, 0, 4, 4)))
    assert counts(scores, "corners")[0] == (6, 4, 3)
    assert scores.corners[0].corners.precision == 0.5 and scores.corners[0].corners.recall == 0.75


def test_vertices_on_a_straight_line_are_no_corners() -> None:
    ring = np.array([(0, 0), (1, 0), (2, 0.0004), (4, 0), (4, 3), (0, 3), (0, 1)], dtype=float)
    corners, angles = corners_of(ring)
    assert corners.tolist() == [[0, 0], [4, 0], [4, 3], [0, 3]]
    np.testing.assert_allclose(angles, 90.0)
    _, angles = corners_of(np.array([(0, 0), (4, 0), (4, 4), (2, 4), (2, 2), (0, 2)], dtype=float))
    np.testing.assert_allclose(angles, [90, 90, 90, 90, 270, 90])


def opening(number: int, kind: OpeningType, wall: int, low: float, width: float = 0.9, top: float = 2.0) -> Opening:
    """In wall 0 (from (0, 0) along x) or wall 2 (from (4, 4) back) of a 4 m square, `low` m after its start."""
    a, b = ((low, 0.0), (low + width, 0.0)) if wall == 0 else ((4 - low, 4.0), (4 - low - width, 4.0))
    return Opening(number, kind, wall, np.array(a), np.array(b), 0.0, top, sigma_top=0.01)


SQUARE = Layout(walls(box(0, 0, 4, 4)), rooms(box(0, 0, 4, 4)), ceiling_height=2.5)


def with_openings(*openings: Opening) -> Layout:
    return replace(SQUARE, openings=openings)


def test_openings_by_type() -> None:
    truth = with_openings(
        opening(0, "door", 0, 0.5, top=2.1),
        opening(1, "door", 0, 2.5),
        opening(2, "passage", 2, 1.0),
        opening(3, "window", 2, 3.0),
    )
    estimate = with_openings(
        opening(0, "door", 0, 0.7, 1.0),  # middle 0.25 m off, 10 cm too wide, head 10 cm too low
        opening(1, "passage", 0, 2.5),  # of the wrong type
        opening(2, "passage", 2, 1.35),  # 35 cm off; the window is missing
    )
    scores = opening_scores(estimate, truth)
    assert scores.by_type == {"door": Score(1, 2, 1), "passage": Score(2, 1, 0), "window": Score(0, 1, 0)}
    assert scores.any_type == Score(3, 4, 2)
    assert scores.middle == pytest.approx(0.125) and scores.width == pytest.approx(0.05)
    heights = height_errors(replace(estimate, ceiling_height=2.46), truth)
    np.testing.assert_allclose(sorted(heights.tops), [-0.1, 0.0], atol=1e-9)
    np.testing.assert_allclose(heights.ceilings, [-0.04])
    unseen = tuple(replace(o, sigma_top=None) for o in estimate.openings[:1])
    heights = height_errors(replace(estimate, openings=unseen), truth)
    assert heights.tops == () and heights.unknown_tops == 1, "a default is no measurement"


def test_the_two_faces_of_a_thin_wall_have_openings_of_their_own() -> None:
    """A door found in one of two rooms' faces, 10 cm apart, is one of two."""
    pair = walls(box(0, 0, 4, 4), box(0, -3.1, 4, 3))
    near = Opening(0, "door", 0, np.array([1.0, 0.0]), np.array([1.9, 0.0]), 0.0, 2.0)
    far = Opening(1, "door", 6, np.array([1.9, -0.1]), np.array([1.0, -0.1]), 0.0, 2.0)
    truth = replace(SQUARE, walls=pair, openings=(near, far))
    assert opening_scores(replace(truth, openings=(near,)), truth).any_type == Score(1, 2, 1)
    twice = replace(truth, openings=(near, replace(near, id=1)))
    assert opening_scores(twice, truth).any_type == Score(2, 2, 1)


def test_heights_of_rooms() -> None:
    truth = replace(SQUARE, rooms=(replace(SQUARE.rooms[0], ceiling_height=3.0), *rooms(box(5, 0, 4, 4))))
    found = replace(truth, rooms=(replace(truth.rooms[0], ceiling_height=3.02), truth.rooms[1]), ceiling_height=None)
    errors = height_errors(found, truth)
    assert errors.ceilings == pytest.approx((0.02,)) and errors.unknown_ceilings == 1
    assert errors.to_json()["ceilings"] == {
        "compared": 1, "median": pytest.approx(0.02), "worst": pytest.approx(0.02), "unknown": 1
    }  # fmt: skip


def test_sigmas_over_known_errors() -> None:
    """Sigma 4 mm and 2 mrad; walls off by 3, 6 and 12 mm, one inferred, one far from any true wall."""
    truth = walls(box(0, 0, 4, 4))
    off = [0.003, -0.006, 0.012]
    moved = [
        replace(w, start=w.start + d * w.normal, end=w.end + d * w.normal) for w, d in zip(truth, off, strict=False)
    ]
    inferred = replace(truth[3], id=3, source="inferred")
    clutter = replace(truth[0], id=4, start=np.array([1.0, 0.5]), end=np.array([2.0, 0.5]))
    scores = sigma_scores(Layout((*moved, inferred, clutter), ()), Layout(truth, ()))
    np.testing.assert_allclose(scores.offset.ratios, [0.75, -1.5, 3.0])
    np.testing.assert_allclose(scores.angle.ratios, 0.0, atol=1e-9)
    assert scores.offset.within(1.0) == pytest.approx(1 / 3) and scores.offset.within(2.0) == pytest.approx(2 / 3)
    turned = replace(truth[0], end=np.array([4.0, 4 * np.tan(0.003)]))
    angle = sigma_scores(Layout((turned,), ()), Layout(truth, ())).angle
    np.testing.assert_allclose(angle.ratios, 1.5)


def test_honest_sigmas_score_as_a_gaussian() -> None:
    rng = np.random.default_rng(0)
    truth = walls(*[box(10 * i, 0, 4, 4) for i in range(100)])
    shifts = rng.normal(0, 0.004, len(truth))
    found = [replace(w, start=w.start + d * w.normal, end=w.end + d * w.normal)
             for w, d in zip(truth, shifts, strict=True)]  # fmt: skip
    offset = sigma_scores(Layout(tuple(found), ()), Layout(truth, ())).offset
    assert 0.62 < offset.within(1.0) < 0.75 and 0.92 < offset.within(2.0) < 0.98
    assert offset.to_json()["rms_ratio"] == pytest.approx(1.0, abs=0.1)


@settings(max_examples=25, deadline=None)
@given(st.floats(-50, 50), st.floats(-50, 50), st.floats(-3.1, 3.1), st.integers(0, 2**31))
def test_scores_depend_on_neither_frame_nor_order(x: float, y: float, yaw: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    truth = rooms(box(0, 0, 4, 4), box(4.2, 0, 3, 4), box(0, 4.2, 7.2, 2))
    found = tuple(replace(r, polygon=r.polygon + rng.normal(0, 0.1, r.polygon.shape)) for r in truth)
    moved = [tuple(replace(r, polygon=apply2([x, y, yaw], r.polygon)) for r in which) for which in (found[::-1], truth)]
    here, there = room_scores(found, truth), room_scores(*moved)
    assert here.rooms == there.rooms
    assert counts(here, "corners")[:2] == counts(there, "corners")[:2]
    assert here.area_error == pytest.approx(there.area_error, abs=1e-9, nan_ok=True)  # nan: no room was matched
    for kind in ("corners", "angles"):
        assert all(right <= found for found, _, right in counts(here, kind))
        assert counts(here, kind)[0][2] <= counts(here, kind)[1][2]
    perfect = room_scores(moved[1], moved[1])
    assert perfect.rooms.f1 == perfect.corners[0].corners.f1 == perfect.corners[0].angles.f1 == 1.0


def test_json_and_rows_of_a_layout() -> None:
    layout = with_openings(opening(0, "door", 0, 0.5))
    scores = layout_scores(layout, layout)
    assert scores is not None
    content = json.loads(json.dumps(scores.to_json()))
    assert set(content) == {"rooms", "corners", "angles", "openings", "heights", "sigmas"}
    assert [c["threshold"] for c in content["corners"]] == [0.1, 0.2, pytest.approx(0.1875)]
    assert set(content["openings"]) == {"door", "passage", "window", "any"}
    assert content["sigmas"]["offset"]["compared"] == 4
    rows = dict(scores.rows())
    assert rows["rooms"] == "precision 1.000, recall 1.000, F1 1.000 (1 found of 1), IoU 1.000"
    assert "doors" in rows and "windows" not in rows
    assert layout_scores(layout, replace(layout, rooms=())) is None
