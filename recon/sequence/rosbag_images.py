"""Images of a ROS bag: which topic, which intrinsics, and pixels read when asked for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import compress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recon.errors import InputError
from recon.geometry import Array
from recon.sequence.camera import Camera
from recon.sequence.camera_info import camera_of, scaled
from recon.sequence.ros_image import DEPTHS, ENCODINGS, Image, file_kind, file_size, is_colour, picture, samples
from recon.sequence.ros_image import used_bits as bits_of
from recon.sequence.rosbag_messages import CAMERA_INFOS, IMAGES, Decoder, frame
from recon.sequence.rosbag_storage import DamagedBagError, Message, Storage, Topic
from recon.sequence.sequence import ImageList
from recon.sequence.stamps import Stamp

LOOKED_AT = 5
"""Images whose brightest sample tells how many bits a 16-bit camera uses."""


@dataclass(frozen=True)
class CameraTopic:
    """Images that can be used: topic, whether colour, the camera and its frame."""

    topic: Topic
    colour: bool
    camera: Camera
    frame: str
    extension: str


class BagImages:
    """Pixels of a bag's images, read when asked for."""

    def __init__(
        self, storage: Storage, topic: Topic, places: Sequence[tuple[Any, ...]], sizes: Sequence[int], bits: int
    ) -> None:
        self._storage, self._topic, self._places, self._sizes, self._bits = storage, topic, places, sizes, bits
        self._decoder = Decoder([topic])

    def read(self, index: int) -> bytes | Image:
        """The JPEG or PNG file of a CompressedImage, or the pixels of an Image, BGR (H, W, 3) or grey (H, W).

        Empty where the bag is damaged: a corrupt image.
        """
        try:
            data = self._storage.read(self._places[index])
        except DamagedBagError:  # costs this image
            return b""
        message = self._decoder.decode(Message(self._topic.name, 0, data, ()))
        if message is None:
            return b""
        if not hasattr(message, "encoding"):
            return bytes(message.data)
        pixels = picture(message, self._bits)
        return b"" if pixels is None else pixels

    def size(self, index: int) -> int:
        """Bytes of the message."""
        return self._sizes[index]


@dataclass
class ImageCollector:
    """Gathers where the images of one topic are; their pixels stay in the bag."""

    chosen: CameraTopic
    storage: Storage
    damaged: int = 0
    other_size: int = 0
    stamps: list[Stamp] = field(default_factory=list)
    _places: list[tuple[Any, ...]] = field(default_factory=list)
    _sizes: list[int] = field(default_factory=list)
    _bits: int = 8
    _looked_at: int = 0

    def add(self, record: Message, message: Any, stamp: Stamp) -> None:
        """One message; counted where it is damaged or has another size than the first."""
        size = _size(message)
        if size is None:
            self.damaged += 1
            return
        if size != (self.chosen.camera.width, self.chosen.camera.height):
            self.other_size += 1
            return
        if self._looked_at < LOOKED_AT and getattr(message, "encoding", "").endswith(("16", "16UC1")):
            self._bits = max(self._bits, bits_of(message))
            self._looked_at += 1
        self.stamps.append(stamp)
        self._places.append(record.place)
        self._sizes.append(len(record.data))

    def images(self, timestamps: Array, keep: NDArray[np.bool_]) -> ImageList:
        """The images `keep`, at `timestamps` (of all), s."""
        places, sizes = list(compress(self._places, keep)), list(compress(self._sizes, keep))
        names = tuple(f"images/{i:06d}.{self.chosen.extension}" for i in range(len(places)))
        source = BagImages(self.storage, self.chosen.topic, places, sizes, self._bits)
        return ImageList(timestamps[keep], (), names, source)


def choose_camera(
    path: Path, storage: Storage, decoder: Decoder, named: str | None, named_info: str | None, warnings: list[str]
) -> CameraTopic | None:
    """The image topic with the most messages that has intrinsics, or the named one; None and a warning where none has.

    Raises InputError where a named topic is no image, or has no intrinsics.
    """
    infos = _infos(storage, decoder, named_info)
    usable: list[CameraTopic] = []
    reasons: list[str] = []
    for topic in storage.topics:
        if topic.type not in IMAGES or topic.messages == 0 or (named is not None and topic.name != named):
            continue
        found = _camera_topic(storage, decoder, topic, infos, (named is not None, named_info is not None), warnings)
        if isinstance(found, CameraTopic):
            usable.append(found)
        elif found:
            reasons.append(f"{topic.name} {found}")
    if not usable:
        if reasons and named is not None:
            raise InputError(f"{path}: image topic {reasons[0]}")
        warnings += [f"images left out: {reason}" for reason in reasons]
        return None
    raw = [c.topic.type == IMAGES[0] for c in usable]
    best = max(range(len(usable)), key=lambda i: (usable[i].topic.messages, usable[i].colour, raw[i], -i))
    others = [c.topic.name for i, c in enumerate(usable) if i != best]
    if others:
        warnings.append(
            f"images of {usable[best].topic.name} ({usable[best].topic.messages}) are used, not those of "
            f"{', '.join(others)}; choose with --image-topic"
        )
    return usable[best]


def _infos(storage: Storage, decoder: Decoder, named: str | None) -> dict[str, Any]:
    """The first CameraInfo of each topic of them."""
    out = {}
    for topic in storage.topics:
        if topic.type in CAMERA_INFOS and topic.messages and named in (None, topic.name):
            message = _first(storage, decoder, topic)
            if message is not None:
                out[topic.name] = message
    return out


def _camera_topic(
    storage: Storage,
    decoder: Decoder,
    topic: Topic,
    infos: dict[str, Any],
    named: tuple[bool, bool],
    warnings: list[str],
) -> CameraTopic | str:
    """What is needed of a topic of images, or why they cannot be used; an empty string for depth images.

    named: whether the user named the topic, and the CameraInfo.
    """
    message = _first(storage, decoder, topic)
    if message is None:
        return "cannot be decoded"
    kind = _picture_kind(message, named[0])
    if isinstance(kind, str):
        return kind
    size, image_frame = _size(message), frame(message.header.frame_id)
    if size is None:
        return "starts with a damaged image"
    info = _matching(topic, image_frame, infos, named[1])
    if info is None:
        return "has no CameraInfo (name one with --camera-info-topic)"
    said: list[str] = []
    camera = camera_of(infos[info], _is_rectified(topic), said)
    if isinstance(camera, str):
        return f"cannot be used: {info} {camera}"
    if size != (camera.width, camera.height):
        fitted = scaled(camera, *size)
        if fitted is None:
            return f"has {size[0]} x {size[1]} pixels, {info} says {camera.width} x {camera.height}"
        said.append(f"scaled from {camera.width} x {camera.height} to {size[0]} x {size[1]} pixels")
        camera = fitted
    warnings += [f"{info}: {line}" for line in said]
    return CameraTopic(topic, kind[0], camera, image_frame, kind[1])


def _picture_kind(message: Any, named: bool) -> tuple[bool, str] | str:
    """Whether in colour, and the suffix of files of such images; or why they are no pictures, empty for depth."""
    if hasattr(message, "encoding"):
        encoding = message.encoding
        if encoding in DEPTHS and not (named and encoding in ENCODINGS):
            return f"holds {encoding}, which is no picture" if named else ""
        return (is_colour(encoding), "png") if encoding in ENCODINGS else f"has the unknown encoding {encoding!r}"
    kind = file_kind(bytes(message.data[:16]))
    if kind is None:
        return "" if "depth" in message.format.lower() else f"has the format {message.format!r}, not JPEG or PNG"
    return True, kind


def _matching(topic: Topic, image_frame: str, infos: dict[str, Any], named: bool) -> str | None:
    """The CameraInfo that was named, else the one beside the images, else the one of their frame."""
    if named:
        return next(iter(infos), None)
    parts = topic.name.split("/")
    for depth in (1, 2, 3):
        name = "/".join([*parts[:-depth], "camera_info"])
        if len(parts) > depth and name in infos:
            return name
    same = [name for name, info in infos.items() if frame(info.header.frame_id) == image_frame]
    return same[0] if len(same) == 1 else None


def _is_rectified(topic: Topic) -> bool:
    return any(part.startswith("image_rect") for part in topic.name.split("/"))


def _first(storage: Storage, decoder: Decoder, topic: Topic) -> Any:
    """The first message of a topic that can be decoded."""
    for i, record in enumerate(storage.messages([topic.name])):
        message = decoder.decode(record)
        if message is not None or i > 20:
            return message
    return None


def _size(message: Any) -> tuple[int, int] | None:
    """Width and height of an Image or a CompressedImage; None when it is damaged."""
    if hasattr(message, "encoding"):
        pixels = samples(message)
        return None if pixels is None else (int(message.width), int(message.height))
    return file_size(bytes(message.data))
