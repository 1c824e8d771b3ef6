"""Bags whose index is missing or damaged (cut off while recording): what can be read from front to back."""

from __future__ import annotations

import mmap
import threading
from collections import Counter
from collections.abc import Callable, Collection, Iterator
from pathlib import Path
from typing import Any

from recon.errors import InputError
from recon.sequence.rosbag_records import (
    BAG_MAGIC,
    MCAP_MAGIC,
    Buffer,
    Channel,
    Chunk,
    CutError,
    Record,
    Schemas,
    bag_records,
    inflated,
    mcap_records,
)
from recon.sequence.rosbag_storage import CUT_OFF, Message, Topic


class SalvagedFile:
    """A ROS 1 bag or an MCAP file. Raises InputError for a file that is neither."""

    def __init__(self, path: Path) -> None:
        self._path, self._lock = path, threading.Lock()
        with path.open("rb") as file:
            magic = file.read(len(BAG_MAGIC))
            self._buffer: Buffer = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) if magic else b""
        self._parse: Callable[[Buffer, int, Schemas], Iterator[Record]]
        if magic == BAG_MAGIC:
            self._parse, self._start = bag_records, len(BAG_MAGIC)
        elif magic.startswith(MCAP_MAGIC):
            self._parse, self._start = mcap_records, len(MCAP_MAGIC)
        else:
            raise InputError(f"{path}: {'holds' if magic else 'is empty,'} no {_expected(path)}")
        self._schemas: Schemas = {}
        self._channels: dict[int, Topic] = {}
        self._open_chunk: tuple[int, bytes] = (-1, b"")
        self._cuts: set[int] = set()
        counts = Counter(message.topic for message in self._walk(self._buffer, self._start, -1))
        topics = {topic.name: topic._replace(messages=counts[topic.name]) for topic in self._channels.values()}
        self.topics = list(topics.values())
        self.lost = _said(self._cuts)

    def messages(self, topics: Collection[str]) -> Iterator[Message]:
        """As they lie in the file."""
        return (message for message in self._walk(self._buffer, self._start, -1) if message.topic in topics)

    def read(self, place: tuple[Any, ...]) -> bytes:
        """From its chunk, the last of which is kept, or straight from the file."""
        chunk, start, size = place
        if chunk < 0:
            return bytes(self._buffer[start : start + size])
        with self._lock:
            if self._open_chunk[0] != chunk:
                record = next(self._parse(self._buffer, chunk, {}))
                assert isinstance(record, Chunk)
                self._open_chunk = (chunk, inflated(record))
            return self._open_chunk[1][start : start + size]

    def _walk(self, buffer: Buffer, at: int, chunk: int) -> Iterator[Message]:
        """Messages of the file (chunk -1) or of the chunk at `chunk`, up to damage."""
        try:
            for record in self._parse(buffer, at, self._schemas):
                if isinstance(record, Chunk):
                    yield from self._walk(inflated(record), 0, record.at)
                elif isinstance(record, Channel):
                    self._channels[record.id] = record.topic
                elif record.channel in self._channels:
                    topic, time, start, size = self._channels[record.channel].name, *record[1:]
                    yield Message(topic, time, bytes(buffer[start : start + size]), (chunk, start, size))
        except CutError:
            self._cuts.add(chunk)


def _expected(path: Path) -> str:
    return "MCAP file" if path.suffix == ".mcap" else "ROS 1 bag of version 2.0"


def _said(cuts: set[int]) -> str:
    """One line on what was lost."""
    if -1 in cuts:
        return CUT_OFF
    return f"{len(cuts)} of its chunks are damaged and were read in part" if cuts else ""
