"""Records of ROS 1 bag and MCAP files, from front to back, without an index.

Formats: wiki.ros.org/Bags/Format/2.0 and mcap.dev/spec.
"""

from __future__ import annotations

import bz2
import struct
import sys
from collections.abc import Iterator
from importlib import import_module
from typing import Any, NamedTuple

from recon.sequence.rosbag_storage import Topic

BAG_MAGIC, MCAP_MAGIC = b"#ROSBAG V2.0\n", b"\x89MCAP0\r\n"
PIECE = 1 << 16
"""Bytes inflated at once: damage costs what follows it in its chunk."""
Buffer = Any
"""bytes, or a file mapped into memory."""


class CutError(Exception):
    """The next record is cut short or makes no sense."""


class Channel(NamedTuple):
    """What the messages of a channel are."""

    id: int
    topic: Topic


class Datum(NamedTuple):
    """One message: channel, time of recording in ns, where its data is in the buffer."""

    channel: int
    time: int
    start: int
    size: int


class Chunk(NamedTuple):
    """Records together, compressed or not. at: of the chunk's record in the buffer."""

    at: int
    compression: str
    data: bytes


Record = Channel | Datum | Chunk
Schemas = dict[int, tuple[str, str, bytes]]


def bag_records(buffer: Buffer, at: int, _schemas: Schemas) -> Iterator[Record]:
    """Of a ROS 1 bag, or of a chunk of one; raises CutError where they end too early."""
    while at < len(buffer):
        header_start = at + 4
        data_start = header_start + _number("<I", buffer, at) + 4
        data_size = _number("<I", buffer, data_start - 4)
        fields = _bag_fields(buffer[header_start : data_start - 4])
        operation = fields[b"op"][0] if fields.get(b"op") else 0
        end = data_start + data_size
        try:
            if operation == 5:
                yield Chunk(at, fields[b"compression"].decode(), bytes(buffer[data_start:end]))
            if end > len(buffer):
                raise CutError
            if operation == 2:
                second, nanosecond = struct.unpack("<II", fields[b"time"])
                time = second * 1_000_000_000 + nanosecond
                yield Datum(_number("<I", fields[b"conn"], 0), time, data_start, data_size)
            elif operation == 7:
                yield _bag_channel(fields, _bag_fields(buffer[data_start:end]))
        except (KeyError, struct.error, UnicodeDecodeError):
            raise CutError from None
        at = end


def _bag_fields(data: bytes) -> dict[bytes, bytes]:
    fields, at = {}, 0
    while at < len(data):
        size = _number("<I", data, at)
        name, equals, value = data[at + 4 : at + 4 + size].partition(b"=")
        if not equals or at + 4 + size > len(data):
            raise CutError
        fields[name] = value
        at += 4 + size
    return fields


def _bag_channel(fields: dict[bytes, bytes], data: dict[bytes, bytes]) -> Channel:
    from rosbags.typesys.msg import normalize_msgtype

    definition = data.get(b"message_definition", b"").decode(errors="replace")
    topic = Topic(
        fields[b"topic"].decode(),
        normalize_msgtype(data[b"type"].decode()),
        0,
        "ros1",
        definition,
        "msg" if definition.strip() else "none",
    )
    return Channel(_number("<I", fields[b"conn"], 0), topic)


def mcap_records(buffer: Buffer, at: int, schemas: Schemas) -> Iterator[Record]:
    """Of an MCAP file, or of a chunk of one; raises CutError where they end too early. `schemas` collects them."""
    while at < len(buffer):
        if buffer[at : at + len(MCAP_MAGIC)] == MCAP_MAGIC:  # ends the file
            return
        operation, start = buffer[at], at + 9
        end = start + _number("<Q", buffer, at + 1)
        try:
            if operation == 6:
                yield _mcap_chunk(buffer, at, end)
            if end > len(buffer) or operation == 0:
                raise CutError
            if operation == 5 and end - start >= 22:
                channel, time = _number("<H", buffer, start), _number("<Q", buffer, start + 6)
                yield Datum(channel, time, start + 22, end - start - 22)
            elif operation == 3:
                (name, encoding, definition), _ = _strings(buffer, start + 2, 3)
                schemas[_number("<H", buffer, start)] = (name.decode(), encoding.decode(), definition)
            elif operation == 4:
                yield _mcap_channel(buffer, start, schemas)
        except (struct.error, UnicodeDecodeError):
            raise CutError from None
        if operation == 2:  # the footer
            return
        at = end


def _mcap_chunk(buffer: Buffer, at: int, end: int) -> Chunk:
    (compression,), data = _strings(buffer, at + 9 + 28, 1)
    return Chunk(at, compression.decode(), bytes(buffer[data + 8 : end]))


def _mcap_channel(buffer: Buffer, start: int, schemas: Schemas) -> Channel:
    from rosbags.typesys.msg import normalize_msgtype

    (topic, encoding), _ = _strings(buffer, start + 4, 2)
    name, schema_encoding, definition = schemas.get(_number("<H", buffer, start + 2), ("", "", b""))
    kind = {"ros1msg": "msg", "ros2msg": "msg", "ros2idl": "idl", "omgidl": "idl"}.get(schema_encoding, "none")
    message_type = normalize_msgtype(name) if "/" in name else name
    text = definition.decode(errors="replace") if kind != "none" else ""
    encoding_name = "ros1" if encoding == b"ros1" else "cdr"
    return Channel(_number("<H", buffer, start), Topic(topic.decode(), message_type, 0, encoding_name, text, kind))


def _strings(buffer: Buffer, at: int, count: int) -> tuple[list[bytes], int]:
    """`count` strings that say their lengths, and where they end."""
    found = []
    for _ in range(count):
        size = _number("<I", buffer, at)
        if at + 4 + size > len(buffer):
            raise CutError
        found.append(bytes(buffer[at + 4 : at + 4 + size]))
        at += 4 + size
    return found, at


def _number(code: str, buffer: Buffer, at: int) -> int:
    try:
        return int(struct.unpack_from(code, buffer, at)[0])
    except struct.error:
        raise CutError from None


def inflated(chunk: Chunk) -> bytes:
    """The records of a chunk, as far as they can be inflated."""
    if chunk.compression in ("", "none"):
        return chunk.data
    decompressor = _decompressor(chunk.compression)
    pieces = []
    try:
        for start in range(0, len(chunk.data), PIECE):
            pieces.append(decompressor.decompress(chunk.data[start : start + PIECE]))
    except Exception:  # damaged: each library has its own errors; what came before is whole
        pass
    return b"".join(pieces)


def _decompressor(compression: str) -> Any:
    if compression == "bz2":
        return bz2.BZ2Decompressor()
    if compression == "lz4":
        return import_module("lz4.frame").LZ4FrameDecompressor()
    if compression == "zstd":
        return zstd_library().ZstdDecompressor()
    raise CutError


def zstd_library() -> Any:
    """The standard library's from Python 3.14 on, before that the one that `rosbags` brings."""
    return import_module("compression.zstd" if sys.version_info >= (3, 14) else "backports.zstd")
