"""Bags whose index is missing or damaged (cut off while recording): what can be read from front to back."""

from __future__ import annotations

import contextlib
import mmap
import sqlite3
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
from recon.sequence.rosbag_storage import Message, Topic


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


class SalvagedDatabase:
    """A ROS 2 SQLite file, cut off or with a journal beside it. Raises InputError when it is no such file."""

    def __init__(self, path: Path) -> None:
        self._path, self._lock = path, threading.Lock()
        self.lost = ""
        self._database = self._opened("mode=ro")
        try:
            self._read_topics()
        except sqlite3.Error:  # read-only folders hold no journal that could be opened
            self._database = self._opened("mode=ro&immutable=1")
            try:
                self._read_topics()
            except sqlite3.Error as error:
                raise InputError(f"{path}: is no ROS 2 bag, or damaged at its start ({error})") from None
        counts = Counter(message.topic for message in self.messages([t.name for t in self._names.values()]))
        self.topics = [topic._replace(messages=counts[topic.name]) for topic in self._names.values()]

    def messages(self, topics: Collection[str]) -> Iterator[Message]:
        """In the order of recording, up to damage."""
        rows = self._database.execute("SELECT id, topic_id, timestamp, data FROM messages ORDER BY id")
        while True:
            try:
                row = rows.fetchone()
            except sqlite3.Error:
                self.lost = "its end cannot be read (cut off while recording?)"
                return
            if row is None:
                return
            topic = self._names.get(row[1])
            if topic is not None and topic.name in topics:
                yield Message(topic.name, row[2], row[3], (row[0],))

    def read(self, place: tuple[Any, ...]) -> bytes:
        """By its row."""
        with self._lock:
            row = self._database.execute("SELECT data FROM messages WHERE id = ?", place).fetchone()
        return bytes(row[0])

    def _opened(self, mode: str) -> sqlite3.Connection:
        database = sqlite3.connect(f"{self._path.absolute().as_uri()}?{mode}", uri=True, check_same_thread=False)
        database.execute("PRAGMA writable_schema = ON")  # opens files shorter than they say, too
        return database

    def _read_topics(self) -> None:
        rows = self._database.execute("SELECT id, name, type FROM topics").fetchall()
        definitions: dict[str, tuple[str, str]] = {}
        query = "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
        with contextlib.suppress(sqlite3.Error):  # older bags have no such table
            definitions = {name: (kind, text) for name, kind, text in self._database.execute(query)}
        self._names = {}
        for number, name, message_type in rows:
            kind, text = definitions.get(message_type, ("", ""))
            known = {"ros2msg": "msg", "ros2idl": "idl"}.get(kind, "none")
            self._names[number] = Topic(name, message_type, 0, "cdr", text, known)


def _expected(path: Path) -> str:
    return "MCAP file" if path.suffix == ".mcap" else "ROS 1 bag of version 2.0"


def _said(cuts: set[int]) -> str:
    """One line on what was lost."""
    if -1 in cuts:
        return "its end cannot be read (cut off while recording?)"
    return f"{len(cuts)} of its chunks are damaged and were read in part" if cuts else ""
