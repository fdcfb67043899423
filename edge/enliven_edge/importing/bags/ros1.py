"""Reads the messages of a ROS bag of version 2.0 from its beginning, without its index."""

from __future__ import annotations

import bz2
import os
import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import BinaryIO, NamedTuple

from enliven.errors import InputError
from enliven.files import open_file
from enliven_edge.extras import need

_MAX_TEXT_BYTES = 4096
"""Maximum bytes of a name, or of a number as text."""


class Fields:
    """A message in the format of ROS 1: packed numbers; texts and blocks are preceded by their size.

    Args:
        data: the message.
        where: the file and topic, for error messages.
    """

    def __init__(self, data: bytes, where: str) -> None:
        self._data, self._at, self.where = data, 0, where

    def number(self, kind: str) -> int | float:
        """Reads the next number, with a format of :mod:`struct`, such as "I" or "d"."""
        (value,) = self.numbers(kind)
        return value

    def count(self) -> int:
        """Reads the next unsigned number of 32 bits."""
        return int(self.number("I"))

    def numbers(self, kinds: str) -> tuple[float, ...]:
        """Reads the next numbers, one for each letter.

        Raises:
            InputError: if the message is too short.
        """
        return struct.unpack("<" + kinds, self._take(struct.calcsize("<" + kinds)))

    def text(self) -> str:
        """Reads the next text."""
        size = self.count()
        if size > _MAX_TEXT_BYTES:
            raise self.damaged()
        return self._take(size).decode("utf-8", errors="replace")

    def block(self) -> bytes:
        """Reads the next block of bytes, which is preceded by its size."""
        return self._take(self.count())

    def damaged(self) -> InputError:
        """Returns the error for a message with impossible content."""
        return InputError("a message is damaged", where=self.where, mend="Copy the recording again.")

    def _take(self, size: int) -> bytes:
        taken = self._data[self._at : self._at + size]
        if len(taken) != size:
            raise self.damaged()
        self._at += size
        return taken


class AlignedFields(Fields):
    """A message in the format of ROS 2 (CDR, little-endian): numbers are aligned to multiples of their
    size."""

    def __init__(self, data: bytes, where: str) -> None:
        super().__init__(data[4:], where)
        if data[:2] != b"\0\1":
            raise self.damaged()

    def numbers(self, kinds: str) -> tuple[float, ...]:
        values: list[float] = []
        for kind in kinds:
            self._at += -self._at % struct.calcsize(kind)
            values += super().numbers(kind)
        return tuple(values)

    def text(self) -> str:
        """Reads the next text, without its final zero byte."""
        return super().text().rstrip("\0")


MAGIC = b"#ROSBAG V2.0\n"
_MAX_HEADER_BYTES = 1 << 16
"""Maximum bytes of a record's header, which may contain a topic's name."""
_MAX_CHUNK_BYTES = 1 << 27
"""Maximum bytes of a decompressed chunk: the makers' have one message or 768 KiB, an image up to 50 MB."""
_MESSAGE = 2
"""Record kind (op) of message data in a bag."""
_CHUNK = 5
"""Record kind (op) of a chunk of records."""
_CONNECTION = 7
"""Record kind (op) of a connection, which names a topic. The other kinds are the index."""
_COPY = "Copy it again; it was not closed, or copied only in part."


class Message(NamedTuple):
    """One message of a recording."""

    topic: str
    fields: Fields


def messages(path: Path, wanted: Callable[[str], bool]) -> Iterator[Message]:
    """Yields the messages of the requested topics, in the order of the file.

    Raises:
        InputError: if the file is damaged, cut off, or would not fit into memory.
    """
    with open_file(path) as file:
        if file.read(len(MAGIC)) != MAGIC:
            raise InputError(
                "it is not a ROS bag of version 2.0", where=str(path), mend="Choose another file."
            )
        size = os.fstat(file.fileno()).st_size
        topics: dict[bytes, str] = {}
        while (at := file.tell()) < size:
            header = _header(_sized(file, _MAX_HEADER_BYTES, path), path)
            if _kind(header) != _CHUNK:
                left = _size(file, path)
                if left > size - file.tell():
                    raise _cut(at, path)
                if _kind(header) == _CONNECTION:
                    _connect(header, topics)
                file.seek(left, os.SEEK_CUR)
                continue
            yield from _inside(
                _unpacked(header, _sized(file, _MAX_CHUNK_BYTES, path), path), topics, wanted, path
            )


def _inside(
    chunk: bytes, topics: dict[bytes, str], wanted: Callable[[str], bool], path: Path
) -> Iterator[Message]:
    """Yields the messages of a chunk. Its connections are added to ``topics``."""
    at = 0
    while at < len(chunk):
        header_at, at = _extent(chunk, at, path)
        header = _header(chunk[header_at:at], path)
        data_at, at = _extent(chunk, at, path)
        if _kind(header) == _CONNECTION:
            _connect(header, topics)
        elif _kind(header) == _MESSAGE:
            topic = topics.get(header.get(b"conn", b""))
            if topic is None:
                raise InputError("a message has no topic", where=str(path), mend=_COPY)
            if wanted(topic):
                yield Message(topic, Fields(chunk[data_at:at], f"{path}, {topic}"))


def _extent(chunk: bytes, at: int, path: Path) -> tuple[int, int]:
    """Returns the start and the end of a sized part of a chunk."""
    begin = at + 4
    end = begin + int.from_bytes(chunk[at:begin], "little")
    if begin > len(chunk) or end > len(chunk):
        raise _cut(at, path)
    return begin, end


def _unpacked(header: dict[bytes, bytes], packed: bytes, path: Path) -> bytes:
    """Returns the decompressed content of a chunk, limited to its declared size."""
    how, size = header.get(b"compression", b""), int.from_bytes(header.get(b"size", b"")[:4], "little")
    if size > _MAX_CHUNK_BYTES:
        raise _too_large(size, path)
    try:
        match how:
            case b"none":
                content = packed
            case b"lz4":
                content = _lz4_unpacked(packed, size + 1, path)
            case b"bz2":
                content = bz2.BZ2Decompressor().decompress(packed, max_length=size + 1)
            case _:
                raise InputError(
                    f"it is packed by {how!r}", where=str(path), mend="Unpack it: rosbag decompress"
                )
    except (RuntimeError, OSError, EOFError, ValueError):
        raise InputError("a part cannot be unpacked", where=str(path), mend=_COPY) from None
    if len(content) != size:
        raise InputError("a part has another size than it says", where=str(path), mend=_COPY)
    return content


def _lz4_unpacked(packed: bytes, most: int, path: Path) -> bytes:
    """Returns at most ``most`` bytes of a chunk that lz4 compressed.

    Raises:
        ResourceError: if the library is not installed.
        RuntimeError: if the chunk is damaged.
    """
    need("lz4", "bags", str(path))
    import lz4.frame  # Imported here, because only some bags need it.

    return lz4.frame.LZ4FrameDecompressor().decompress(packed, max_length=most)


def _header(content: bytes, path: Path) -> dict[bytes, bytes]:
    """Returns the fields of a record's header."""
    fields, at = {}, 0
    while at < len(content):
        begin, at = _extent(content, at, path)
        key, _, value = content[begin:at].partition(b"=")
        fields[key] = value
    return fields


def _connect(header: dict[bytes, bytes], topics: dict[bytes, str]) -> None:
    topics[header.get(b"conn", b"")] = header.get(b"topic", b"").decode("utf-8", errors="replace")


def _kind(header: dict[bytes, bytes]) -> int:
    return int.from_bytes(header.get(b"op", b"")[:1], "little")


def _size(file: BinaryIO, path: Path) -> int:
    four = file.read(4)
    if len(four) < 4:
        raise _cut(file.tell(), path)
    return int(struct.unpack("<I", four)[0])


def _sized(file: BinaryIO, most: int, path: Path) -> bytes:
    """Reads the next bytes of the file, which are preceded by their number."""
    size = _size(file, path)
    if size > os.fstat(file.fileno()).st_size - file.tell():
        raise _cut(file.tell(), path)
    if size > most:
        raise _too_large(size, path)
    return file.read(size)


def _cut(at: int, path: Path) -> InputError:
    return InputError(f"it ends in the middle of the record at byte {at}", where=str(path), mend=_COPY)


def _too_large(size: int, path: Path) -> InputError:
    return InputError(
        f"a record has {size} bytes; no depth camera writes records of this size", where=str(path), mend=_COPY
    )
