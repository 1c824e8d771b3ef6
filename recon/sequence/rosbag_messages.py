"""Messages of a ROS bag, decoded, and what all of them have: a time stamp and a frame."""

from __future__ import annotations

from collections import Counter
from typing import Any

from recon.sequence.rosbag_storage import Message, Topic

SCANS = ("sensor_msgs/msg/LaserScan", "sensor_msgs/msg/MultiEchoLaserScan")
IMAGES = ("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage")
CAMERA_INFOS = ("sensor_msgs/msg/CameraInfo",)
ODOMETRIES = ("nav_msgs/msg/Odometry",)
TRANSFORMS = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")

ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
"""Starts a compressed message; a plain one starts with 0."""


class Decoder:
    """Decodes messages by the definitions that the bag holds, else by those of ROS. `failed`: how many a topic."""

    def __init__(self, topics: list[Topic]) -> None:
        self._topics = {topic.name: topic for topic in topics}
        self._stores: dict[str, Any] = {}
        self.failed: Counter[str] = Counter()

    def decode(self, message: Message) -> Any:
        """The message, None when it is damaged."""
        topic = self._topics[message.topic]
        if topic.type not in self._stores:
            self._stores[topic.type] = _typestore(topic)
        store = self._stores[topic.type]
        data: bytes = message.data
        try:
            if data[:4] == ZSTD_MAGIC:
                from recon.sequence.rosbag_records import zstd_library

                data = zstd_library().decompress(data)
            return (store.deserialize_ros1 if topic.encoding == "ros1" else store.deserialize_cdr)(data, topic.type)
        except Exception:  # the generated decoders fail in many ways on damaged bytes
            self.failed[message.topic] += 1
            return None


def stamp(header: Any) -> int:
    """Time of a header, ns; 0 where it was not filled in."""
    return int(header.stamp.sec) * 1_000_000_000 + int(header.stamp.nanosec)


def frame(name: str) -> str:
    """A frame's name without the slash that ROS 1 put before it."""
    return name.strip().lstrip("/")


def _typestore(topic: Topic) -> Any:
    """Decoders of a topic's type: by the bag's definition where that has the fields we know, else those of ROS."""
    from rosbags.typesys import Stores, get_typestore

    usual = get_typestore(Stores.ROS1_NOETIC if topic.encoding == "ros1" else Stores.ROS2_HUMBLE)
    try:
        types = _defined_types(topic)
        if topic.type not in types or not all(_has_fields(types[name], usual.fielddefs.get(name)) for name in types):
            return usual
        store = get_typestore(Stores.EMPTY)
        store.register(types)
        store.get_msgdef(topic.type)
        return store
    except Exception:  # a damaged definition makes the library fail in any of a dozen ways
        return usual


def _defined_types(topic: Topic) -> dict[str, Any]:
    """Types by name, with their fields, of the definition that the bag holds."""
    from rosbags.typesys import get_types_from_idl, get_types_from_msg

    if topic.definition_format == "msg":
        return dict(get_types_from_msg(topic.definition, topic.type))
    types: dict[str, Any] = {}
    if topic.definition_format == "idl":
        for part in topic.definition.split("=" * 80 + "\n"):  # several files, each headed `IDL: name`
            types |= get_types_from_idl(part.split("\n", 1)[-1] if part.startswith("IDL: ") else part)
    return types


def _has_fields(found: Any, usual: Any) -> bool:
    """Whether a definition has all fields of the usual one; it may have more."""
    if usual is None:
        return True
    fields = dict(found[1])
    return all(fields.get(name) == kind for name, kind in usual[1])
