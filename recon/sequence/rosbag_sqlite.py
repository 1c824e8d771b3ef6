"""ROS 2 bags in SQLite files that were not closed: cut off, or with a journal beside them."""

from __future__ import annotations

import contextlib
import threading
from collections import Counter
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

import apsw

from recon.errors import InputError
from recon.sequence.rosbag_storage import CUT_OFF, Message, Topic

DEFINITION = "encoded_message_definition"
MAGIC = b"SQLite format 3\x00"


class SalvagedDatabase:
    """A SQLite file, read row by row up to damage. Raises InputError when it is no ROS 2 bag.

    Where the file ends within a page, SQLite would read the rest of the page as zeros; here it ends before that page.
    """

    def __init__(self, path: Path) -> None:
        self._path, self._lock = path, threading.Lock()
        self.lost = CUT_OFF if ends_within_page(path) else ""
        self._vfs = _WholePages(page_size(path)) if self.lost and not has_journal(path) else None
        self._database: apsw.Connection
        self._names: dict[int, Topic] = {}
        try:
            self._open("mode=ro")
        except apsw.Error:
            try:  # in a folder that may not be written, a journal cannot be opened
                self._open("immutable=1")
                self.lost = "its journal (-wal) cannot be opened" if has_journal(path) else self.lost
            except apsw.Error as error:
                raise InputError(f"{path}: is no ROS 2 bag, or damaged at its start ({error})") from None
        counts = Counter(message.topic for message in self.messages([t.name for t in self._names.values()]))
        self.topics = [topic._replace(messages=counts[topic.name]) for topic in self._names.values()]

    def messages(self, topics: Collection[str]) -> Iterator[Message]:
        """In the order of recording, up to damage."""
        query = "SELECT id, topic_id, timestamp, CAST(data AS BLOB) FROM messages ORDER BY id"
        try:
            rows: Any = self._database.execute(query)
            for number, topic_id, time, data in rows:
                topic = self._names.get(topic_id)
                if topic is not None and topic.name in topics and isinstance(data, bytes) and isinstance(time, int):
                    yield Message(topic.name, time, data, (number,))
        except (apsw.Error, UnicodeDecodeError):
            self.lost = CUT_OFF

    def read(self, place: tuple[Any, ...]) -> bytes:
        """By its row; empty where damage hides it from a search."""
        query = "SELECT CAST(data AS BLOB) FROM messages WHERE id = ?"
        with self._lock, contextlib.suppress(apsw.Error):
            rows: Any = self._database.execute(query, place)
            for row in rows:
                return bytes(row[0])
        return b""

    def _open(self, mode: str) -> None:
        flags = apsw.SQLITE_OPEN_READONLY | apsw.SQLITE_OPEN_URI
        uri, vfs = f"{self._path.absolute().as_uri()}?{mode}", None if self._vfs is None else self._vfs.name
        self._database = apsw.Connection(uri, flags=flags, vfs=vfs)
        self._database.execute("PRAGMA writable_schema = ON")  # opens files shorter than they say, too
        definitions: dict[str, tuple[str, str]] = {}
        with contextlib.suppress(apsw.Error):  # older bags have no such table
            for name, kind, text in self._texts("message_definitions", "topic_type", "encoding", DEFINITION):
                definitions[name] = (kind, text)
        for number, name, message_type in self._texts("topics", "id", "name", "type"):
            kind, text = definitions.get(message_type, ("", ""))
            known = {"ros2msg": "msg", "ros2idl": "idl"}.get(kind, "none")
            if number.isdecimal():
                self._names[int(number)] = Topic(name, message_type, 0, "cdr", text, known)

    def _texts(self, table: str, *columns: str) -> Iterator[list[str]]:
        """Columns of a table as text, damaged or not."""
        chosen = ", ".join(f"CAST({column} AS BLOB)" for column in columns)
        rows: Any = self._database.execute(f"SELECT {chosen} FROM {table}")
        for row in rows:
            yield [(value or b"").decode(errors="replace") for value in row]


class _WholePages(apsw.VFS):
    """Files as SQLite sees them, shortened to whole pages."""

    def __init__(self, page: int) -> None:
        self.name, self._page = f"whole-pages-{page}", page
        super().__init__(self.name, "")

    def xOpen(self, name: Any, flags: list[int]) -> apsw.VFSFile:
        return _WholePagesFile(name, flags, self._page)


class _WholePagesFile(apsw.VFSFile):
    def __init__(self, name: Any, flags: list[int], page: int) -> None:
        super().__init__("", name, flags)
        self._page = page if flags[0] & apsw.SQLITE_OPEN_MAIN_DB else 1

    def xFileSize(self) -> int:
        size = super().xFileSize()
        return size - size % self._page


def page_size(path: Path) -> int:
    """Bytes a page of a SQLite file, by its header; 1 for a file that is none."""
    with path.open("rb") as file:
        head = file.read(18)
    size = int.from_bytes(head[16:18], "big")
    return (65536 if size == 1 else max(size, 1)) if head.startswith(MAGIC) else 1


def has_journal(path: Path) -> bool:
    """Whether messages are still in a write-ahead log beside the file: the recorder did not end well."""
    journal = path.with_name(path.name + "-wal")
    return journal.is_file() and journal.stat().st_size > 0


def ends_within_page(path: Path) -> bool:
    """Whether a SQLite file is cut off in the middle of a page; False for a file that is none."""
    return path.stat().st_size % page_size(path) != 0
