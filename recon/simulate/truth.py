"""The ground truth of a simulated building in the map frame."""

from __future__ import annotations

import numpy as np

from recon.geometry import Array, Pose3, apply2, mounted_camera
from recon.model import FloorObject, Layout, Opening, Room, Wall
from recon.sequence.camera import Camera
from recon.simulate.building import Building
from recon.simulate.check import footprint
from recon.simulate.openings import edge, first_wall_ids
from recon.simulate.plan import Plan, PlanCamera


def true_layout(building: Building, map_from_plan: Array) -> Layout:
    """Walls, rooms, openings and objects, moved by the planar pose map_from_plan (3,).

    Every edge of a room is one wall, which goes on through its openings: an opening between two rooms appears twice,
    once in each room's wall, and its reveals belong to the wall on their side.
    """
    plan = building.plan
    first = first_wall_ids(plan)
    walls, rooms = [], []
    for r, shape in enumerate(plan.rooms):
        for w in range(len(shape.polygon)):
            start, end = apply2(map_from_plan, np.stack(edge(plan, r, w)))
            walls.append(Wall(first[r] + w, start, end, 0.0, 0.0, "lidar", 0))
        rooms.append(Room(r, shape.name, apply2(map_from_plan, np.array(shape.polygon)), shape.ceiling_height))
    openings = []
    for i, niche in enumerate(building.niches):
        start, end = apply2(map_from_plan, niche.front)
        openings.append(Opening(i, niche.type, niche.wall, start, end, niche.bottom, niche.top))
    outlines = [apply2(map_from_plan, footprint(item)) for item in building.objects]
    objects = tuple(FloorObject(i, outline) for i, outline in enumerate(outlines))
    return Layout(tuple(walls), tuple(rooms), tuple(openings), objects, plan.ceiling_height)


def true_camera(settings: PlanCamera) -> Camera:
    """The camera's intrinsics; the principal point defaults to the middle of the image."""
    cx = (settings.image_width - 1) / 2 if settings.cx is None else settings.cx
    cy = (settings.image_height - 1) / 2 if settings.cy is None else settings.cy
    matrix = np.array([[settings.fx, 0.0, cx], [0.0, settings.fy, cy], [0.0, 0.0, 1.0]])
    size = settings.image_width, settings.image_height
    return Camera(*size, matrix, settings.distortion_model, np.array(settings.distortion), "simulated")


def true_extrinsics(plan: Plan) -> Pose3:
    """platform_from_camera: yaw to the left, then tilt downwards, then roll, of a camera that looks ahead."""
    camera = plan.camera
    yaw, tilt, roll = np.radians([camera.yaw_deg, camera.tilt_deg, camera.roll_deg])
    return mounted_camera([camera.x, camera.y, camera.height], yaw, tilt, roll)
