"""Standard deviations on plans: of distances across rooms, and of jambs."""

from __future__ import annotations

import dataclasses
from functools import cache

import numpy as np
import pytest

from recon.config import Config
from recon.evaluate.openings import matched_openings
from recon.evaluate.sigmas import counterpart
from recon.layout_json import layout_from_json, layout_to_json
from recon.model import Layout, Model
from recon.pipeline import build
from recon.plan.draw import draw_plan
from recon.plan.drawing import Dimension as Drawn
from recon.sequence.sequence import Sequence
from recon.simulate import random_plan, run_simulation


@cache
def built(seed: int) -> tuple[Layout, Layout]:
    """The layout of a building of four rooms, from its scans alone, and the true one."""
    plan = random_plan(seed, 4)
    plan = dataclasses.replace(plan, lidar=dataclasses.replace(plan.lidar, sigma=0.01))
    simulation = run_simulation(plan, seed)
    return build(Sequence(plan.name, simulation.scans), Config()).model.layout, simulation.layout


def test_distances_across_rooms_know_what_walls_share() -> None:
    layout, truth = built(2003)
    walls = {wall.id: wall for wall in layout.walls}
    across = layout.spans
    assert len(across) >= 4
    ratios = []
    for d in across:
        a, b = (walls[k] for k in d.walls)
        apart = sum(float(np.hypot(w.sigma_offset, w.sigma_angle * w.length)) for w in (a, b))
        assert 0 < d.sigma < 1.01 * apart  # no more than if both erred to opposite sides
        pair = [counterpart(w, truth.walls) for w in (a, b)]
        if pair[0] is not None and pair[1] is not None:
            way = (d.end - d.start) / d.distance
            near, far = (float((w.start - d.start) @ w.normal / (way @ w.normal)) for w in pair if w)
            ratios.append((d.distance - (far - near)) / d.sigma)
    assert 0.1 < float(np.median(np.abs(ratios))) < 2.0
    tighter = [d for d in across if d.sigma < 0.7 * sum(walls[k].sigma_offset for k in d.walls)]
    assert tighter  # walls of one drive err together


def test_jambs_have_sigmas_of_the_size_of_their_errors() -> None:
    layout, truth = built(2003)
    narrow, sigmas = [], []
    for opening, true in matched_openings(layout, list(layout.openings), truth, list(truth.openings)):
        wall = layout.wall(opening.wall)
        ends, true_ends = (np.sort([(end - wall.start) @ wall.direction for end in (o.start, o.end)])
                           for o in (opening, true))  # fmt: skip
        narrow += [ends[0] - true_ends[0], true_ends[1] - ends[1]]
        assert opening.sigma_jambs is not None
        sigmas += [opening.sigma_jambs] * 2
    assert len(narrow) >= 6
    assert abs(np.median(narrow)) < 0.002  # neither too narrow nor too wide, although returns scatter by 1 cm
    assert np.quantile(np.abs(narrow), 0.95) < 0.008
    ratios = np.abs(narrow) / sigmas
    assert 0.2 < np.median(ratios) < 1.2
    assert np.mean(ratios < 2) > 0.8
    assert 0.0005 < np.median(sigmas) < 0.004


def test_what_is_known_comes_back_from_the_file_and_onto_the_plan() -> None:
    layout, _ = built(2003)
    again = layout_from_json(layout_to_json(layout), "layout.json")
    assert [d.walls for d in again.spans] == [d.walls for d in layout.spans]
    assert [d.sigma for d in again.spans] == pytest.approx([d.sigma for d in layout.spans], abs=1e-6)
    assert [o.sigma_jambs for o in again.openings] == pytest.approx([o.sigma_jambs for o in layout.openings], abs=1e-6)
    drawn = [e for e in draw_plan(Model("plan", layout, ())).plan if isinstance(e, Drawn) and e.extensions]
    assert sum(e.sigma is not None for e in drawn) > 0.8 * len(drawn)
