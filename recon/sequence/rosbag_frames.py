"""Where a bag's transforms put the scanner and the camera on the platform."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from recon.geometry import Array, Pose3, compose2
from recon.sequence.stamps import Stamp
from recon.sequence.tf import BASES, TransformTree, last_name

BODY_FROM_OPTICAL = Pose3(np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]]), np.zeros(3))
"""Of a camera whose frame has x forward and z up (ROS REP 103)."""


@dataclass(frozen=True)
class Odometry:
    """Poses (N, 3) [x, y, yaw] of `frame` in the odometry's own frame."""

    topic: str
    frame: str
    stamps: Sequence[Stamp]
    poses: Array


@dataclass(frozen=True)
class Platform:
    """The platform frame: under the scanner, along the x axis of the robot's frame `base`.

    FORMAT.md has the LiDAR's x point forward; on robots it often does not, and what is forward is the base's x. So the
    scans' bearings are counted from there. base_from_laser is None where the bag does not say it: then the scanner is
    taken as upright and looking along x.
    """

    tree: TransformTree
    laser: str
    base: str
    base_from_laser: Pose3 | None

    def odometry(self, odometry: Odometry, warnings: list[str]) -> Array:
        """Poses (N, 3) of the platform in the odometry's frame."""
        frame = odometry.frame or self.base
        frame_from_base = self.tree.mounting(frame, self.base)
        if frame_from_base is None or self.base_from_laser is None:
            if frame_from_base is None and not _both_usual(frame, self.base):
                warnings.append(
                    f"the bag's transforms do not lead from {frame} ({odometry.topic}) to {self.base}: "
                    "the odometry is taken as the scanner's"
                )
            frame_from_base = Pose3.identity()
        offset = np.zeros(3) if self.base_from_laser is None else self.base_from_laser.translation
        yaw = float(np.arctan2(frame_from_base.rotation[1, 0], frame_from_base.rotation[0, 0]))
        x, y, _ = frame_from_base.apply(offset)
        return compose2(odometry.poses, np.array([x, y, yaw]))

    def camera(self, camera_frame: str, warnings: list[str]) -> Pose3 | None:
        """platform_from_camera, where the bag says it down to the floor; None, and why, where it must be estimated."""
        why = "; its pose is estimated from the images"
        base_from_camera = self.tree.mounting(self.base, camera_frame)
        if self.base_from_laser is None or base_from_camera is None:
            if self.tree.frames():
                warnings.append(f"no transform leads to the camera's frame {camera_frame or '(none)'}{why}")
            return None
        if self.tree.floor_of(self.laser) is None:
            warnings.append(f"the bag names no frame on the floor (base_footprint), so not the camera's height{why}")
            return None
        if base_from_camera.rotation[2, 2] > 0.7:
            base_from_camera = base_from_camera @ BODY_FROM_OPTICAL
            warnings.append(f"the camera's frame {camera_frame} has z up: taken as x forward, not as an optical frame")
        under = self.base_from_laser.translation * [1, 1, 0]
        pose = Pose3(base_from_camera.rotation, base_from_camera.translation - under)
        if not 0.02 < pose.translation[2] < 10:
            height = pose.translation[2]
            warnings.append(f"the bag's transforms put the camera {height:.2f} m above the floor{why}")
            return None
        return pose


def find_platform(tree: TransformTree, laser: str, odometry_frame: str | None, warnings: list[str]) -> Platform:
    """The platform of the scanner with frame `laser`."""
    base = tree.base_of(laser)
    if base is None and odometry_frame and tree.mounting(odometry_frame, laser) is not None:
        base = odometry_frame
    if base is not None:
        return Platform(tree, laser, base, tree.mounting(base, laser))
    if last_name(laser) in BASES:
        return Platform(tree, laser, laser, Pose3.identity())
    known = tree.frames()
    said = f" (frames: {', '.join(known[:8])}{', ...' if len(known) > 8 else ''})" if known else ""
    warnings.append(
        f"no transform of the bag{said} says where the scanner ({laser or 'without a frame'}) is mounted: "
        "taken as upright and looking forward"
    )
    return Platform(tree, laser, laser, None)


def _both_usual(a: str, b: str) -> bool:
    """base_footprint is under base_link (ROS REP 120), whether or not a transform says so."""
    return last_name(a) in BASES and last_name(b) in BASES
