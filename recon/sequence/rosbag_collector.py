"""What is kept of each message of a bag, in one pass."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from recon.sequence.rosbag_frames import Odometry
from recon.sequence.rosbag_images import CameraTopic, ImageCollector
from recon.sequence.rosbag_messages import TRANSFORMS, Decoder, frame, stamp
from recon.sequence.rosbag_scans import ScanCollector
from recon.sequence.rosbag_storage import Message, Storage, Topic
from recon.sequence.stamps import Stamp
from recon.sequence.tf import TransformTree
from recon.sequence.topics import NONE
from recon.sequence.tum import yaw_of_quaternions

FARTHEST = 1e7
"""m: odometry farther away is damaged."""


class Collector:
    """What is kept of each message."""

    def __init__(
        self,
        path: Path,
        decoder: Decoder,
        scan_topic: Topic,
        odometry_topic: Topic | None,
        camera: CameraTopic | None,
        storage: Storage,
    ) -> None:
        self.decoder, self.odometry_topic, self.bad_poses = decoder, odometry_topic, 0
        self.scans = ScanCollector(path, scan_topic.name)
        self.images = None if camera is None else ImageCollector(camera, storage)
        self._transforms = {t.name for t in storage.topics if t.type in TRANSFORMS}
        self._frames: list[str] = []
        self._stamps: list[Stamp] = []
        self._poses: list[tuple[float, ...]] = []

    def wanted(self) -> list[str]:
        """Names of the topics to be read."""
        names = [self.scans.topic, *sorted(self._transforms)]
        if self.odometry_topic is not None:
            names.append(self.odometry_topic.name)
        return names if self.images is None else [*names, self.images.chosen.topic.name]

    def add(self, record: Message, tree: TransformTree) -> None:
        """One message of a wanted topic."""
        message = self.decoder.decode(record)
        if message is None:
            return
        if record.topic in self._transforms:
            self._add_transforms(record, message, tree)
            return
        times = Stamp(stamp(message.header), _sane(record.time))
        if record.topic == self.scans.topic:
            self.scans.add(message, times)
        elif self.images is not None and record.topic == self.images.chosen.topic.name:
            self.images.add(record, message, times)
        else:
            self._add_pose(message, times)

    def lost(self) -> list[tuple[str, int, str]]:
        """Topic, number of its messages that were not used, and why."""
        topic = self.scans.topic
        out = [(topic, self.scans.damaged, "without beams or damaged")]
        out += [(name, n, "that cannot be decoded") for name, n in sorted(self.decoder.failed.items())]
        if self.odometry_topic is not None:
            out.append((self.odometry_topic.name, self.bad_poses, "no pose"))
        if self.images is not None:
            topic = self.images.chosen.topic.name
            out += [(topic, self.images.damaged, "damaged"), (topic, self.images.other_size, "of another size")]
        return [item for item in out if item[1]]

    def odometry(self, tree: TransformTree, laser: str, named: str | None) -> Odometry | None:
        """Of the topic, else of the transforms."""
        if self._poses:
            rows = np.array(self._poses)
            unit = rows[:, 2:] / np.linalg.norm(rows[:, 2:], axis=1, keepdims=True)
            assert self.odometry_topic is not None
            poses = np.column_stack([rows[:, :2], yaw_of_quaternions(unit)])
            return Odometry(self.odometry_topic.name, self._frames[0], self._stamps, poses)
        found = None if named == NONE else tree.odometry(laser)
        if found is None:
            return None
        child, stamps, moved = found
        yaw = [np.arctan2(pose.rotation[1, 0], pose.rotation[0, 0]) for pose in moved]
        return Odometry(
            "/tf", child, stamps, np.array([[*p.translation[:2], a] for p, a in zip(moved, yaw, strict=True)])
        )

    def _add_transforms(self, record: Message, message: Any, tree: TransformTree) -> None:
        fixed = record.topic.endswith("tf_static")
        for item in message.transforms:
            t, q = item.transform.translation, item.transform.rotation
            times = Stamp(stamp(item.header), _sane(record.time))
            parent, child = frame(item.header.frame_id), frame(item.child_frame_id)
            tree.add(parent, child, (t.x, t.y, t.z), (q.x, q.y, q.z, q.w), times, fixed)

    def _add_pose(self, message: Any, times: Stamp) -> None:
        p, q = message.pose.pose.position, message.pose.pose.orientation
        values = tuple(float(v) for v in (p.x, p.y, q.x, q.y, q.z, q.w))
        if not 0.9 < sum(v * v for v in values[2:]) < 1.1 or not abs(values[0]) + abs(values[1]) < FARTHEST:
            self.bad_poses += 1
            return
        self._frames.append(frame(message.child_frame_id))
        self._stamps.append(times)
        self._poses.append(values)


def _sane(time: int) -> int:
    """A time of recording, ns, that damage has not made larger than any clock."""
    return min(max(time, 0), 1 << 62)
