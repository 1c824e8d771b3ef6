"""Random buildings with a drive through all their rooms."""

from __future__ import annotations

import dataclasses

import numpy as np

from recon.errors import InputError
from recon.sequence.camera import DistortionModel
from recon.simulate.check import check_plan, checked_niches, overlapping, standing_objects
from recon.simulate.floorplan import Angles, random_rooms
from recon.simulate.furnish import furnish
from recon.simulate.openings import Niche, edge
from recon.simulate.plan import Plan, PlanCamera, PlanDrive, PlanLidar, PlanOdometry, PlanOpening
from recon.simulate.route import random_route

CLEARANCE = 0.36
"""m that the drive keeps from walls and objects, before corners are rounded."""


def random_plan(seed: int, rooms: int = 4, angles: Angles = "manhattan", clutter: float = 0.5) -> Plan:
    """A random building of `rooms` rooms (1 to 12, the corridor among them) and a drive through it.

    angles: "manhattan" (right angles) or "any" (bends and walls at any angle). clutter: 0 (empty) to 1 (full). Camera,
    mounting, scanner and odometry differ from seed to seed; replace fields for other rates or sizes. Raises InputError
    for numbers out of range.
    """
    if not 1 <= rooms <= 12 or not 0.0 <= clutter <= 1.0 or angles not in ("manhattan", "any"):
        raise InputError(f"random_plan: rooms {rooms} (1 to 12), angles {angles!r}, clutter {clutter:g} (0 to 1)")
    attempt = 0
    while True:
        rng = np.random.default_rng([seed, rooms, 23, attempt])
        plan = _attempt(f"random {seed}", rooms, angles, clutter, rng)
        if plan is not None:
            return plan
        attempt += 1


def _attempt(name: str, rooms: int, angles: Angles, clutter: float, rng: np.random.Generator) -> Plan | None:
    shapes, bases = random_rooms(rooms, angles, rng)
    height = round(float(rng.uniform(2.4, 3.2)), 2)
    nowhere = ((0.0, 0.0), (1.0, 0.0))
    bare = Plan(tuple(shapes), nowhere, name=name, ceiling_height=height, camera=_camera(rng), lidar=_lidar(rng))
    bare = dataclasses.replace(bare, odometry=_odometry(rng), drive=PlanDrive(corner_radius=0.3))
    opened = _openings(bare, bases, rng)
    if opened is None:
        return None
    plan, found = opened
    furnished = furnish(plan, found, clutter, rng)
    for candidate in (furnished, plan):
        way = random_route(candidate, found, CLEARANCE, rng)
        if way is None:
            continue
        driven = dataclasses.replace(candidate, path=tuple((round(float(x), 4), round(float(y), 4)) for x, y in way))
        try:
            check_plan(driven)
        except InputError:
            continue
        return driven
    return None


def _openings(plan: Plan, bases: list[tuple[int, int]], rng: np.random.Generator) -> tuple[Plan, list[Niche]] | None:
    """A way into every room, some more between rooms, closed doors and windows; None where a room stays shut."""
    found: list[Niche] = []
    for room, wall in bases:
        for _ in range(20):
            plan, added = _try(plan, found, _entrance(plan, room, wall, rng))
            if added:
                break
        else:
            return None
    for room in range(len(plan.rooms)):
        for wall in range(len(plan.rooms[room].polygon)):
            for _ in range(rng.poisson(0.18 * _length(plan, room, wall))):
                plan, _ = _try(plan, found, _extra(plan, room, wall, rng))
    return plan, found


def _try(plan: Plan, found: list[Niche], opening: PlanOpening | None) -> tuple[Plan, bool]:
    """The plan with the opening where it fits, 0.15 m clear of others; `found` grows by its niches."""
    if opening is None:
        return plan, False
    wider = dataclasses.replace(opening, offset=max(opening.offset - 0.15, 0.0), width=opening.width + 0.3)
    index = len(plan.openings)
    try:
        margin = checked_niches(dataclasses.replace(plan, openings=(*plan.openings, wider)), index)
        grown = dataclasses.replace(plan, openings=(*plan.openings, opening))
        niches = checked_niches(grown, index)
        standing_objects(grown, niches)
    except InputError:
        return plan, False
    if any(overlapping(a, b) for a in margin for b in found):
        return plan, False
    found += niches
    return grown, True


def _length(plan: Plan, room: int, wall: int) -> float:
    start, end = edge(plan, room, wall)
    return float(np.linalg.norm(end - start))


def _entrance(plan: Plan, room: int, wall: int, rng: np.random.Generator) -> PlanOpening | None:
    length = _length(plan, room, wall)
    wide = rng.random() < 0.2
    width = round(float(rng.uniform(1.3, 1.8) if wide else rng.uniform(0.95, 1.2)), 3)
    if length < width + 0.7:
        return None
    offset = round(float(rng.uniform(0.35, length - width - 0.35)), 3)
    top = round(float(rng.uniform(1.98, 2.2)), 2)
    if not wide and rng.random() < 0.35:
        return PlanOpening("door", room, wall, offset, width, 0.0, top, open=True)
    return PlanOpening("passage", room, wall, offset, width, 0.0, top)


def _extra(plan: Plan, room: int, wall: int, rng: np.random.Generator) -> PlanOpening | None:
    """A closed door, a window or, between neighbouring rooms, now and then a passage."""
    length, ceiling, pick = _length(plan, room, wall), plan.ceiling_height, rng.random()
    if length < 1.5:
        return None
    low, high = (0.8, 2.2) if pick < 0.4 else (0.8, 1.0)
    width = round(float(rng.uniform(low, min(high, length - 0.4))), 3)
    offset = round(float(rng.uniform(0.15, length - width - 0.15)), 3)
    if pick < 0.4:
        bottom = 0.0 if rng.random() < 0.15 else round(float(rng.uniform(0.7, 1.1)), 2)
        return PlanOpening(
            "window", room, wall, offset, width, bottom, round(float(rng.uniform(1.9, ceiling - 0.2)), 2)
        )
    if pick < 0.55:
        return PlanOpening("passage", room, wall, offset, width + 0.1, 0.0, 2.05)
    return PlanOpening("door", room, wall, offset, width, 0.0, 2.05)


def _camera(rng: np.random.Generator) -> PlanCamera:
    models: tuple[DistortionModel, ...] = ("plumb_bob", "rational_polynomial", "equidistant")
    model = models[rng.choice(3, p=[0.6, 0.2, 0.2])]
    coefficients: dict[DistortionModel, tuple[float, ...]] = {
        "plumb_bob": (-0.1, 0.04, 0.0006, -0.0005, 0.0),
        "rational_polynomial": (0.15, -0.06, 0.0003, -0.0002, 0.01, 0.25, -0.04, 0.005),
        "equidistant": (0.02, -0.01, 0.004, -0.001),
    }
    strength = rng.uniform(0.2, 1.3) if model == "plumb_bob" else 1.0
    focal = rng.uniform(380, 560)
    return PlanCamera(
        fx=round(float(focal), 2),
        fy=round(float(focal * rng.uniform(0.995, 1.005)), 2),
        cx=round(float(rng.uniform(308, 331)), 2),
        cy=round(float(rng.uniform(228, 251)), 2),
        distortion_model=model,
        distortion=tuple(round(float(strength * k), 5) for k in coefficients[model]),
        x=round(float(rng.uniform(-0.05, 0.15)), 3),
        y=round(float(rng.uniform(-0.06, 0.06)), 3),
        height=round(float(rng.uniform(0.7, 1.4)), 3),
        tilt_deg=round(float(rng.uniform(4, 18)), 2),
        roll_deg=round(float(rng.normal(0, 1.2)), 2),
        yaw_deg=round(float(rng.normal(0, 2.0)), 2),
    )


def _lidar(rng: np.random.Generator) -> PlanLidar:
    return PlanLidar(
        beams=int(rng.choice([360, 720, 1080])),
        fov_deg=float(rng.choice([240.0, 270.0, 360.0])),
        range_max=float(rng.choice([8.0, 12.0, 25.0])),
        sigma=round(float(rng.uniform(0.005, 0.015)), 4),
        height=round(float(rng.uniform(0.2, 0.6)), 2),
    )


def _odometry(rng: np.random.Generator) -> PlanOdometry:
    scale, drift = 1.0 + rng.normal(0, 0.012), rng.normal(0, 0.1)
    return PlanOdometry(scale=round(float(scale), 4), drift_deg=round(float(drift), 3))
