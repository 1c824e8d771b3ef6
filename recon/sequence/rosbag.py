"""ROS 1 and ROS 2 bags as sequences. No ROS is needed."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from recon.errors import InputError
from recon.geometry import Array
from recon.sequence.rosbag_collector import Collector
from recon.sequence.rosbag_frames import Odometry, Platform, find_platform
from recon.sequence.rosbag_images import CameraTopic, choose_camera
from recon.sequence.rosbag_messages import IMAGES, ODOMETRIES, SCANS, Decoder
from recon.sequence.rosbag_storage import DamagedBagError, Storage, Topic, open_indexed, open_salvaged
from recon.sequence.scans import checked_scans, say_blind
from recon.sequence.sequence import ImageList, Scans, Sequence
from recon.sequence.stamps import increasing, on_one_clock
from recon.sequence.text import drive_name, plural
from recon.sequence.tf import TransformTree
from recon.sequence.topics import NONE, Topics
from recon.sequence.trajectory import Trajectory


def read_rosbag(path: Path, topics: Topics | None = None) -> Sequence:
    """The scans of a bag, and its images, odometry and mountings where it has them.

    path: a ROS 1 bag, a ROS 2 file (.db3, .mcap), or a ROS 2 folder, with or without metadata.yaml. A bag that is cut
    off or damaged gives what can be read, with a warning. Raises InputError for a bag without usable scans, two
    scanners on one topic, and topics that are not in it.
    """
    path, topics = Path(path), topics or Topics()
    try:
        return _Bag(path, open_indexed(path), topics).sequence()
    except DamagedBagError as error:
        return _Bag(path, open_salvaged(path), topics, why_salvaged=str(error)).sequence()


@dataclass
class _Bag:
    """A bag on its way to a sequence."""

    path: Path
    storage: Storage
    topics: Topics
    why_salvaged: str = ""
    warnings: list[str] = field(default_factory=list)

    def sequence(self) -> Sequence:
        if self.storage.lost:
            self.warnings.append(f"{self.path.name}: {self.storage.lost}; the rest is used")
        elif self.why_salvaged:
            self.warnings.append(f"{self.path.name}: read without its index ({' '.join(self.why_salvaged.split())})")
        elif self.path.is_dir() and not (self.path / "metadata.yaml").exists():
            self.warnings.append(f"{self.path.name}: metadata.yaml is missing; the bag's files are read without it")
        decoder = Decoder(self.storage.topics)
        scan_topic = self._topic(SCANS, "scan", self.topics.scan)
        if scan_topic is None:
            raise InputError(f"{self.path}: has no laser scans; it holds {self._contents()}")
        odometry_topic = self._topic(ODOMETRIES, "odom", self.topics.odometry)
        camera = self._camera(decoder)
        collector, tree = (
            Collector(self.path, decoder, scan_topic, odometry_topic, camera, self.storage),
            TransformTree(),
        )
        for record in self.storage.messages(collector.wanted()):
            collector.add(record, tree)
        self._say_lost(collector)
        return self._assembled(collector, tree, camera)

    def _assembled(self, collected: Collector, tree: TransformTree, camera: CameraTopic | None) -> Sequence:
        laser = collected.scans.frame(self.warnings)
        odometry = collected.odometry(tree, laser, self.topics.odometry)
        platform = find_platform(tree, laser, None if odometry is None else odometry.frame, self.warnings)
        raw, ahead = collected.scans.scans(platform.base_from_laser, self.warnings)
        scans = self._scans(raw, collected.scans.topic)
        trajectory = None if odometry is None else self._trajectory(odometry, platform, scans, ahead)
        images = None if camera is None else self._images(collected, scans, ahead)
        extrinsics = None if camera is None or images is None else platform.camera(camera.frame, self.warnings)
        intrinsics = None if camera is None or images is None else camera.camera
        name = drive_name(self.path)
        return Sequence(name, scans, intrinsics, images, trajectory, extrinsics, tuple(self.warnings))

    def _topic(self, types: tuple[str, ...], option: str, named: str | None) -> Topic | None:
        """The named topic, else the one of these types with the most messages; a scan topic must be there."""
        found = [t for t in self.storage.topics if t.type in types and t.messages]
        if named == NONE:
            return None
        if named is not None:
            found = [t for t in found if t.name == named]
            if not found:
                kinds = " or ".join(name.split("/")[-1] for name in types)
                raise InputError(f"{self.path}: has no {kinds} topic {named}; it holds {self._contents()}")
        if not found:
            return None
        best = max(found, key=lambda t: t.messages)
        others = ", ".join(t.name for t in found if t is not best)
        if others:
            self.warnings.append(
                f"{best.name} ({best.messages} messages) is used, not {others}; choose with --{option}-topic"
            )
        return best

    def _contents(self) -> str:
        """What is in the bag, for messages."""
        topics = [f"{t.name} ({t.type.split('/')[-1]}, {t.messages})" for t in self.storage.topics]
        return ", ".join(topics) if topics else "no topic at all"

    def _camera(self, decoder: Decoder) -> CameraTopic | None:
        named, info = self.topics.image, self.topics.camera_info
        if named == NONE:
            return None
        by_name = {t.name: t for t in self.storage.topics if t.messages}
        if named is not None and (named not in by_name or by_name[named].type not in IMAGES):
            raise InputError(f"{self.path}: has no image topic {named}; it holds {self._contents()}")
        if info is not None and info not in by_name:
            raise InputError(f"{self.path}: has no CameraInfo topic {info}; it holds {self._contents()}")
        return choose_camera(self.path, self.storage, decoder, named, info, self.warnings)

    def _say_lost(self, collected: Collector) -> None:
        """Says what was lost of each topic. Raises InputError when no scan is left."""
        scans = collected.scans
        if not len(scans):
            raise InputError(f"{self.path}: topic {scans.topic} has no scan that can be used ({scans.damaged} damaged)")
        for topic, count, why in collected.lost():
            self.warnings.append(f"{plural(count, 'message')} of {topic} left out: {why}")

    def _scans(self, raw: Scans, topic: str) -> Scans:
        keep = increasing(raw.timestamps)
        if keep.sum() < len(keep) / 2:
            raise InputError(
                f"{self.path}: time stamps of {topic} jump back: only {int(keep.sum())} of {len(keep)} scans increase"
            )
        self._say_unordered(keep, topic)
        kept = Scans(
            raw.timestamps[keep], raw.ranges[keep], raw.angle_min, raw.angle_increment, raw.range_min, raw.range_max,
            raw.time_increment,
        )  # fmt: skip
        scans = checked_scans(self.path, kept)
        say_blind(scans, self.warnings)
        return scans

    def _trajectory(self, odometry: Odometry, platform: Platform, scans: Scans, ahead: float) -> Trajectory | None:
        times = on_one_clock(odometry.stamps, odometry.topic, ahead, self.warnings)
        keep = increasing(times)
        self._say_unordered(keep, odometry.topic)
        if not self._overlap(times[keep], scans, odometry.topic):
            return None
        return Trajectory(times[keep], platform.odometry(odometry, self.warnings)[keep])

    def _images(self, collected: Collector, scans: Scans, ahead: float) -> ImageList | None:
        images = collected.images
        if images is None or not images.stamps:
            return None
        topic = images.chosen.topic.name
        times = on_one_clock(images.stamps, topic, ahead, self.warnings)
        keep = increasing(times)
        self._say_unordered(keep, topic)
        return images.images(times, keep) if self._overlap(times[keep], scans, topic) else None

    def _say_unordered(self, keep: Any, topic: str) -> None:
        lost = int((~keep).sum())
        if lost:
            self.warnings.append(
                f"{plural(lost, 'message')} of {topic} left out (of {len(keep)}): time stamps that do not increase"
            )

    def _overlap(self, times: Array, scans: Scans, topic: str) -> bool:
        if len(times) and times[0] <= scans.timestamps[-1] and times[-1] >= scans.timestamps[0]:
            return True
        self.warnings.append(f"{topic} is left out: none of it is from the time of the scans")
        return False
