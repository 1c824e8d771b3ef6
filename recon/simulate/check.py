"""Whether a plan can be built and driven."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from recon.errors import InputError
from recon.geometry import Array
from recon.simulate.drive import drive_path
from recon.simulate.openings import LEAF_THICKNESS, Niche, edge, near, opening_niches
from recon.simulate.plan import Plan, PlanObject
from recon.simulate.schema import check_ranges

if TYPE_CHECKING:
    from shapely.geometry import Polygon

THINNEST_WALL = 0.05
"""m between two rooms' free space."""
LEAF_SWING_DEG = 98.0
"""How far an open door's leaf stands open."""
COEFFICIENTS = {"plumb_bob": (4, 5), "rational_polynomial": (8,), "equidistant": (4,)}


def check_plan(plan: Plan) -> None:
    """Raise InputError, one line, at the first thing in the plan that cannot be."""
    _check_values(plan)
    _check_rooms(plan)
    found = _check_openings(plan)
    _check_objects(plan, found)
    _check_path(plan, found)


def standing_objects(plan: Plan, found: list[Niche]) -> tuple[PlanObject, ...]:
    """The plan's objects and, after them, the leaves of its open doors (hinged at the jamb nearer the wall's start)."""
    leaves = []
    for niche in found:
        opening = plan.openings[niche.opening]
        if opening.open and niche.room == opening.room:
            along = (niche.front[1] - niche.front[0]) / opening.width
            yaw = np.arctan2(along[1], along[0]) + np.radians(LEAF_SWING_DEG)
            out, back = np.array([np.cos(yaw), np.sin(yaw)]), np.array([-np.sin(yaw), np.cos(yaw)])
            length = opening.width - 0.02
            hinge = niche.front[0] + 0.012 * np.array([-along[1], along[0]])
            x, y = hinge + out * length / 2 + back * LEAF_THICKNESS / 2
            size, height = (length, LEAF_THICKNESS), (0.01, opening.top - 0.02)
            leaves.append(PlanObject((float(x), float(y)), size, "box", float(np.degrees(yaw)), *height, "leaf"))
    return plan.objects + tuple(leaves)


def footprint(item: PlanObject) -> Array:
    """Outline (n, 2) of an object on the floor, counter-clockwise, plan frame, m; a cylinder's has 32 corners."""
    half = np.array(item.size) / 2
    if item.shape == "cylinder":
        angle = np.arange(32) * (2 * np.pi / 32)
        outline = half[0] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    else:
        outline = half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    c, s = np.cos(np.radians(item.yaw_deg)), np.sin(np.radians(item.yaw_deg))
    return np.asarray(outline @ np.array([[c, s], [-s, c]]) + np.array(item.center))


def free_space(plan: Plan, found: list[Niche]) -> Polygon:
    """Where the platform can be: rooms and the openings between them, less objects that stand in its way."""
    from shapely.geometry import Polygon
    from shapely.ops import unary_union

    parts = [Polygon(room.polygon) for room in plan.rooms]
    ways = [Polygon(np.concatenate([n.front, n.back[::-1]])).buffer(1e-6) for n in found if n.closed == "nothing"]
    tallest = max(plan.lidar.height, plan.camera.height) + 0.1
    blocked = [Polygon(footprint(o)) for o in standing_objects(plan, found) if o.bottom < tallest]
    return unary_union(parts + ways).difference(unary_union(blocked))


def _check_values(plan: Plan) -> None:
    check_ranges(plan, "plan")
    for name in ("drive", "camera", "lidar", "odometry", "look"):
        check_ranges(getattr(plan, name), f"plan.{name}")
    for name in ("rooms", "openings", "objects"):
        for i, item in enumerate(getattr(plan, name)):
            check_ranges(item, f"plan.{name}[{i}]")
    camera = plan.camera
    expected = COEFFICIENTS[camera.distortion_model]
    if len(camera.distortion) not in expected:
        raise InputError(
            f"plan.camera.distortion: {camera.distortion_model} has {' or '.join(map(str, expected))} coefficients,"
            f" not {len(camera.distortion)}"
        )
    if plan.lidar.range_min >= plan.lidar.range_max:
        raise InputError(
            f"plan.lidar.range_min: {plan.lidar.range_min:g} is not below range_max {plan.lidar.range_max:g}"
        )


def _check_rooms(plan: Plan) -> None:
    from shapely.geometry import Polygon

    if not plan.rooms:
        raise InputError("plan.rooms: at least one room is expected")
    shapes = []
    for i, room in enumerate(plan.rooms):
        if len(room.polygon) < 3:
            raise InputError(f"plan.rooms[{i}].polygon: at least three corners are expected, not {len(room.polygon)}")
        shape = Polygon(room.polygon)
        if not shape.is_valid or shape.area < 0.25:
            raise InputError(f"plan.rooms[{i}].polygon: crosses itself or is smaller than 0.25 m2")
        if not shape.exterior.is_ccw:
            raise InputError(f"plan.rooms[{i}].polygon: the corners run clockwise, counter-clockwise is expected")
        for wall in range(len(room.polygon)):
            if np.linalg.norm(np.subtract(*edge(plan, i, wall))) < 0.02:
                raise InputError(f"plan.rooms[{i}].polygon: edge {wall} is shorter than 0.02 m")
        shapes.append(shape)
    for i, shape in enumerate(shapes):
        for j in range(i):
            if shape.distance(shapes[j]) < THINNEST_WALL - 1e-6:
                raise InputError(
                    f"plan.rooms[{i}].polygon: touches or overlaps rooms[{j}]; a wall of at least {THINNEST_WALL:g} m"
                    " is expected between rooms (make one polygon of rooms without a wall between)"
                )


def checked_niches(plan: Plan, index: int) -> list[Niche]:
    """The niches of one opening; raises InputError where it does not fit its wall or what is behind it."""
    opening, where = plan.openings[index], f"plan.openings[{index}]"
    if not 0 <= opening.room < len(plan.rooms):
        raise InputError(f"{where}.room: there is no room {opening.room}, rooms count from 0")
    if not 0 <= opening.wall < len(plan.rooms[opening.room].polygon):
        raise InputError(f"{where}.wall: room {opening.room} has no edge {opening.wall}")
    length = float(np.linalg.norm(np.subtract(*edge(plan, opening.room, opening.wall))))
    if opening.offset + opening.width > length + 1e-6:
        raise InputError(f"{where}: ends {opening.offset + opening.width:g} m along a wall of {length:g} m")
    if opening.type != "window" and opening.bottom != 0.0:
        raise InputError(f"{where}.bottom: a {opening.type} starts at the floor, not at {opening.bottom:g}")
    found = opening_niches(plan, index)
    for niche in found:
        _check_niche(plan, niche)
    return found


def overlapping(a: Niche, b: Niche) -> bool:
    """Whether two niches take the same part of the same wall."""
    if a.wall != b.wall:
        return False
    along = (a.front[1] - a.front[0]) / np.linalg.norm(a.front[1] - a.front[0])
    (a0, a1), (b0, b1) = a.front @ along, b.front @ along
    return bool(max(a0, b0) < min(a1, b1) - 1e-6)


def _check_openings(plan: Plan) -> list[Niche]:
    found: list[Niche] = []
    for index in range(len(plan.openings)):
        for niche in checked_niches(plan, index):
            for other in found:
                if overlapping(niche, other):
                    raise InputError(f"plan.openings[{index}]: overlaps openings[{other.opening}] in the same wall")
            found.append(niche)
    return found


def _check_niche(plan: Plan, niche: Niche) -> None:
    from shapely.geometry import Polygon

    where = f"plan.openings[{niche.opening}]"
    ceiling = plan.rooms[niche.room].ceiling_height or plan.ceiling_height
    if not niche.bottom < niche.top <= ceiling:
        raise InputError(f"{where}: from {niche.bottom:g} to {niche.top:g} m in a room {ceiling:g} m high")
    corners = np.concatenate([niche.front, niche.back[::-1]])
    hole = Polygon(corners)
    for j, room in enumerate(plan.rooms):
        if near(room, corners, 0.0) and hole.area > 0 and hole.intersection(Polygon(room.polygon)).area > 1e-6:
            raise InputError(f"{where}: its recess reaches into rooms[{j}]; a thicker wall is expected")


def _check_objects(plan: Plan, found: list[Niche]) -> None:
    from shapely.geometry import Polygon

    rooms = [Polygon(room.polygon).buffer(1e-6) for room in plan.rooms]
    for i, item in enumerate(standing_objects(plan, found)):
        where = f"plan.objects[{i}]" if i < len(plan.objects) else "plan.openings: an open door's leaf"
        if min(item.size) <= 0.005 or item.bottom >= item.top:
            raise InputError(f"{where}: positive sizes and bottom < top are expected")
        outline = Polygon(footprint(item))
        inside = [r for r, room in enumerate(rooms) if room.covers(outline)]
        if not inside:
            raise InputError(f"{where}: does not stand inside one room")
        ceiling = plan.rooms[inside[0]].ceiling_height or plan.ceiling_height
        if item.top > ceiling:
            raise InputError(f"{where}: {item.top:g} m tall in a room {ceiling:g} m high")


def _check_path(plan: Plan, found: list[Niche]) -> None:
    import shapely

    points = np.array(plan.path, dtype=np.float64).reshape(-1, 2)
    if len(points) < 2 or np.linalg.norm(np.diff(points, axis=0), axis=1).max() < 1e-6:
        raise InputError("plan.path: at least two different way points are expected")
    drive = drive_path(plan)
    driven = drive.at(np.linspace(0.0, drive.duration, max(2, int(drive.duration * 20))))
    clearance = float(np.hypot(plan.camera.x, plan.camera.y)) + 0.05
    room = free_space(plan, found).buffer(-clearance)
    shapely.prepare(room)
    outside = driven[~shapely.contains_xy(room, driven[:, 0], driven[:, 1])]
    if len(outside):
        x, y = outside[0, :2]
        raise InputError(f"plan.path: comes closer than {clearance:.2f} m to a wall or object near ({x:.2f}, {y:.2f})")
