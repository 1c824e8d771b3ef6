"""Messages of a ROS bag and where they lie, by the library `rosbags`."""

from __future__ import annotations

import contextlib
import threading
from collections import Counter
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

from recon.errors import InputError, ReconError

if TYPE_CHECKING:
    from rosbags.interfaces import Connection

ROS1_SUFFIXES, ROS2_SUFFIXES = (".bag", ".active"), (".db3", ".mcap")
CUT_OFF = "its end cannot be read (cut off while recording?)"


class DamagedBagError(ReconError):
    """The bag cannot be read through its index; what is in it may still be read from front to back."""


class Topic(NamedTuple):
    """A topic of a bag. encoding: `ros1` or `cdr`; definition: of its messages, empty when the bag holds none."""

    name: str
    type: str
    messages: int
    encoding: str
    definition: str
    definition_format: str


class Message(NamedTuple):
    """time: of recording, ns. place: where the bag finds the message again."""

    topic: str
    time: int
    data: bytes
    place: tuple[Any, ...]


class Storage(Protocol):
    """The messages of one bag. `lost`: one line on what could not be read, empty when nothing."""

    topics: list[Topic]
    lost: str

    def messages(self, topics: Collection[str]) -> Iterator[Message]:
        """Messages of these topics; in order of time, or as they lie in a damaged bag."""
        ...

    def read(self, place: tuple[Any, ...]) -> bytes:
        """The data of one message again; may be called from several threads."""
        ...


class IndexedStorage:
    """A whole bag, read by the library: a ROS 1 file, a ROS 2 file, or a ROS 2 folder with metadata.yaml.

    Every method raises DamagedBagError where the library gives up.
    """

    lost = ""

    def __init__(self, path: Path) -> None:
        from rosbags.rosbag1 import Reader as Reader1
        from rosbags.rosbag2 import Reader as Reader2

        self._path, self._lock = path, threading.Lock()
        _check_database(path)
        ros1 = path.suffix.lower() in ROS1_SUFFIXES
        with _library_errors(path):
            self._reader: Reader1 | Reader2 = Reader1(path) if ros1 else Reader2(path)
            self._reader.open()
            self._connections: dict[str, list[Connection]] = {}
            for connection in self._reader.connections:
                self._connections.setdefault(connection.topic, []).append(connection)
            encoding = "ros1" if ros1 else "cdr"
            self.topics = [_topic(connections, encoding) for connections in self._connections.values()]

    def messages(self, topics: Collection[str]) -> Iterator[Message]:
        """In order of the time of recording."""
        connections = [c for name in topics for c in self._connections.get(name, [])]
        if not connections:
            return
        same: Counter[str] = Counter()  # messages of each topic at `now` so far
        now = -1
        source = self._reader.messages(connections)
        while True:
            with _library_errors(self._path):
                item = next(source, None)
            if item is None:
                return
            connection, time, data = item
            if time != now:
                now = time
                same.clear()
            yield Message(connection.topic, time, data, (connection.topic, time, same[connection.topic]))
            same[connection.topic] += 1

    def read(self, place: tuple[Any, ...]) -> bytes:
        """The n-th message of a topic at a time."""
        topic, time, n = place
        with self._lock, _library_errors(self._path):
            found = self._reader.messages(self._connections[topic], start=time, stop=time + 1)
            for i, (_, _, data) in enumerate(found):
                if i == n:
                    return bytes(data)
        raise InputError(f"{self._path}: changed while it was read")


class JoinedStorage:
    """Several files of one recording, one after the other."""

    def __init__(self, parts: list[Storage]) -> None:
        self._parts = parts
        self.lost = "; ".join(part.lost for part in parts if part.lost)
        merged: dict[str, Topic] = {}
        for topic in (topic for part in parts for topic in part.topics):
            known = merged.get(topic.name)
            merged[topic.name] = topic if known is None else known._replace(messages=known.messages + topic.messages)
        self.topics = list(merged.values())

    def messages(self, topics: Collection[str]) -> Iterator[Message]:
        """File by file."""
        for i, part in enumerate(self._parts):
            for message in part.messages(topics):
                yield message._replace(place=(i, *message.place))

    def read(self, place: tuple[Any, ...]) -> bytes:
        """From the file that holds it."""
        return self._parts[place[0]].read(place[1:])


def bag_files(path: Path) -> list[Path]:
    """The files of a bag: itself, or those of a ROS 2 folder, in the order in which they were recorded."""
    if not path.is_dir():
        return [path]
    files = [p for p in path.iterdir() if p.suffix.lower() in ROS2_SUFFIXES and p.is_file()]
    return sorted(files, key=lambda p: ([int(n) for n in p.stem.split("_") if n.isdigit()], p.name))


def open_indexed(path: Path) -> Storage:
    """The bag through its indexes. Raises DamagedBagError."""
    if path.is_dir() and (path / "metadata.yaml").exists():
        return IndexedStorage(path)
    parts: list[Storage] = [IndexedStorage(file) for file in bag_files(path)]
    return parts[0] if len(parts) == 1 else JoinedStorage(parts)


def open_salvaged(path: Path) -> Storage:
    """The bag from front to back, as far as it can be read. Raises InputError when nothing can."""
    from recon.sequence.rosbag_salvage import SalvagedFile
    from recon.sequence.rosbag_sqlite import SalvagedDatabase

    files = bag_files(path)
    parts: list[Storage] = [SalvagedDatabase(f) if f.suffix.lower() == ".db3" else SalvagedFile(f) for f in files]
    return parts[0] if len(parts) == 1 else JoinedStorage(parts)


@contextlib.contextmanager
def _library_errors(path: Path) -> Iterator[None]:
    try:
        yield
    except ReconError:
        raise
    except PermissionError:
        raise InputError(f"{path}: cannot be read: permission denied") from None
    except Exception as error:  # damaged bytes make the library fail in any of a dozen ways
        raise DamagedBagError(f"{path}: {error}") from error


def _check_database(path: Path) -> None:
    """Raises DamagedBagError for what SQLite would not tell: a torn last page, a journal that is not merged."""
    from recon.sequence.rosbag_sqlite import ends_within_page, has_journal

    for file in (file for file in bag_files(path) if file.suffix.lower() == ".db3"):
        if ends_within_page(file) or has_journal(file):
            raise DamagedBagError(f"{file}: was not closed")


def _topic(connections: list[Connection], encoding: str) -> Topic:
    first = connections[0]
    count = sum(c.msgcount for c in connections)
    return Topic(first.topic, first.msgtype, count, encoding, first.msgdef.data, first.msgdef.format.name.lower())
