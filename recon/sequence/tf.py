"""The tree of frames of a robot, from its transform messages: what is mounted where."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

import numpy as np

from recon.geometry import Pose3
from recon.sequence.stamps import Stamp

SAME_PLACE = 0.005
"""m: transforms of one pair of frames that stay closer together are a fixed mounting."""
SAME_DIRECTION = np.radians(0.3)
BASES = ("base_footprint", "base_link", "base")
"""Usual names (ROS REP 105, 120) of the robot's own frame; the first lies on the floor."""
FLOOR = "base_footprint"
ODOMETRY = ("odom", "odom_combined", "odometry")


@dataclass
class _Edge:
    """Transforms parent_from_child; all of them where the parent is an odometry frame, else the first."""

    first: Pose3
    last: tuple[float, ...]
    fixed: bool = True
    history: list[tuple[Stamp, Pose3]] = field(default_factory=list)


class TransformTree:
    """Frames joined by the transforms that were recorded. Names are without a leading slash."""

    def __init__(self) -> None:
        self._edges: dict[tuple[str, str], _Edge] = {}
        self._graph: dict[str, list[tuple[str, Pose3]]] | None = None

    def add(
        self,
        parent: str,
        child: str,
        translation: tuple[float, ...],
        quaternion_xyzw: tuple[float, ...],
        time: Stamp,
        fixed: bool = False,
    ) -> None:
        """parent_from_child at `time`; `fixed`: from a topic of mountings, the last of which holds.

        Numbers that are no transform are passed over.
        """
        values = (*translation, *quaternion_xyzw)
        edge = self._edges.get((parent, child))
        if edge is not None and edge.last == values and not _is_odometry(parent):  # most are said over and over
            return
        if parent == child or not np.isfinite(values).all() or not 0.9 < sum(v * v for v in quaternion_xyzw) < 1.1:
            return
        self._graph = None
        pose = Pose3.from_quaternion(translation, quaternion_xyzw)
        if edge is None or (fixed and edge.fixed):
            edge = self._edges[parent, child] = _Edge(pose, values)
        elif edge.fixed and not _same(edge.first, pose):
            edge.fixed = False
        edge.last = values
        if _is_odometry(parent) and not fixed:
            edge.history.append((time, pose))

    def frames(self) -> list[str]:
        """All names, sorted."""
        return sorted({name for pair in self._edges for name in pair})

    def mounting(self, target: str, source: str) -> Pose3 | None:
        """target_from_source along fixed transforms; None where they do not lead from one to the other."""
        if target == source:
            return Pose3.identity()
        found, queue = {target: Pose3.identity()}, deque([target])
        neighbours = self._graph = self._neighbours() if self._graph is None else self._graph
        while queue:
            here = queue.popleft()
            for name, here_from_name in neighbours.get(here, []):
                if name not in found:
                    found[name] = found[here] @ here_from_name
                    queue.append(name)
        return found.get(source)

    def base_of(self, sensor: str) -> str | None:
        """The robot's own frame: a usual name that the sensor is mounted on, else the root of its fixed transforms."""
        for name in BASES:
            for candidate in (frame for frame in self.frames() if last_name(frame) == name):
                if self.mounting(candidate, sensor) is not None:
                    return candidate
        root, parents = sensor, {child: parent for (parent, child), edge in self._edges.items() if edge.fixed}
        seen = {sensor}
        while root in parents and parents[root] not in seen and not _is_world(parents[root]):
            root = parents[root]
            seen.add(root)
        return root if root != sensor else None

    def floor_of(self, sensor: str) -> str | None:
        """The frame on the floor under the robot that carries the sensor, where the tree names one."""
        base = self.base_of(sensor)
        return base if base is not None and last_name(base) == FLOOR else None

    def odometry(self, sensor: str) -> tuple[str, list[Stamp], list[Pose3]] | None:
        """Frame, times and poses odom_from_frame of the robot that carries the sensor, where they were recorded."""
        for (_, child), edge in sorted(self._edges.items()):
            if len(edge.history) > 1 and self.mounting(child, sensor) is not None:
                return child, [time for time, _ in edge.history], [pose for _, pose in edge.history]
        return None

    def _neighbours(self) -> dict[str, list[tuple[str, Pose3]]]:
        out: dict[str, list[tuple[str, Pose3]]] = {}
        for (parent, child), edge in self._edges.items():
            if edge.fixed and not _is_world(parent):
                out.setdefault(parent, []).append((child, edge.first))
                out.setdefault(child, []).append((parent, edge.first.inverse()))
        for (a, b), a_from_b in self._siblings():
            out.setdefault(a, []).append((b, a_from_b))
            out.setdefault(b, []).append((a, a_from_b.inverse()))
        return out

    def _siblings(self) -> list[tuple[tuple[str, str], Pose3]]:
        """Frames that move together under one odometry frame: they are mounted on each other."""
        out = []
        moving = sorted((pair, edge) for pair, edge in self._edges.items() if edge.history)
        for i, ((parent, a), edge_a) in enumerate(moving):
            for (other, b), edge_b in moving[i + 1 :]:
                if parent != other:
                    continue
                poses = {time.header: pose for time, pose in edge_a.history}
                both = [poses[time.header].inverse() @ pose for time, pose in edge_b.history if time.header in poses]
                if len(both) > 1 and all(_same(both[0], pose) for pose in both):
                    out.append(((a, b), both[0]))
        return out


def last_name(frame: str) -> str:
    """A frame's name without the name of its robot: `base_link` of `robot1/base_link`."""
    return frame.rsplit("/", maxsplit=1)[-1]


def _is_odometry(name: str) -> bool:
    return last_name(name) in ODOMETRY


def _is_world(name: str) -> bool:
    """A frame that stands still while the robot moves: what hangs on it is no mounting, even while the robot stands."""
    return _is_odometry(name) or last_name(name) in ("map", "world", "earth")


def _same(a: Pose3, b: Pose3) -> bool:
    turn = np.arccos(np.clip((np.trace(a.rotation.T @ b.rotation) - 1) / 2, -1, 1))
    return bool(np.linalg.norm(a.translation - b.translation) < SAME_PLACE and turn < SAME_DIRECTION)
