"""Reads the messages of a ROS bag of version 2.0 from its beginning, without its index.

The library rosbags (0.11.9) is not used, because it trusts the sizes in a file. It allocated 4.3 GB for a
damaged bag of 26 kB, and raised errors of five types. It also cannot read a bag without an index.
"""

from __future__ import annotations

import bz2
import os
import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import BinaryIO, NamedTuple

from enliven.doctor import need
from enliven.errors import InputError
from enliven.files import open_file

_MAX_TEXT_BYTES = 4096
"""Maximum bytes of a name, or of a number as text."""


class Fields:
    """A message in the format of ROS 1: packed numbers. Strings and blocks are preceded by their size.

    Args:
        data: the message.
        where: the file and topic, for error messages.
    """

    def __init__(self, data: bytes, where: str) -> None:
        self._data, self._offset, self.where = data, 0, where

    def number(self, kind: str) -> int | float:
        """Reads the next number, with a format of :mod:`struct`, such as "I" or "d"."""
        (value,) = self.numbers(kind)
        return value

    def count(self) -> int:
        """Reads the next unsigned number of 32 bits."""
        return int(self.number("I"))

    def numbers(self, kinds: str) -> tuple[float, ...]:
        """Reads the next numbers, one for each letter of ``kinds``.

        Raises:
            InputError: if the message is too short.
        """
        return struct.unpack("<" + kinds, self._read_bytes(struct.calcsize("<" + kinds)))

    def text(self) -> str:
        """Reads the next string."""
        size = self.count()
        if size > _MAX_TEXT_BYTES:
            raise self.make_damage_error()
        return self._read_bytes(size).decode("utf-8", errors="replace")

    def block(self) -> bytes:
        """Reads the next block of bytes, which is preceded by its size."""
        return self._read_bytes(self.count())

    def make_damage_error(self) -> InputError:
        """Returns the error for a message with impossible content."""
        return InputError("a message is damaged", where=self.where, remedy="Copy the recording again.")

    def _read_bytes(self, size: int) -> bytes:
        data = self._data[self._offset : self._offset + size]
        if len(data) != size:
            raise self.make_damage_error()
        self._offset += size
        return data


class AlignedFields(Fields):
    """A message in the format of ROS 2 (CDR, little-endian): numbers are aligned to multiples of their
    size."""

    def __init__(self, data: bytes, where: str) -> None:
        super().__init__(data[4:], where)
        if data[:2] != b"\0\1":
            raise self.make_damage_error()

    def numbers(self, kinds: str) -> tuple[float, ...]:
        """Reads the next numbers, one for each letter of ``kinds``. Skips the padding before each of them.

        Raises:
            InputError: if the message is too short.
        """
        values: list[float] = []
        for kind in kinds:
            self._offset += -self._offset % struct.calcsize(kind)
            values += super().numbers(kind)
        return tuple(values)

    def text(self) -> str:
        """Reads the next text, without its final zero byte."""
        return super().text().rstrip("\0")


MAGIC = b"#ROSBAG V2.0\n"
_MAX_HEADER_BYTES = 1 << 16
"""Maximum bytes of a record's header, which may contain a topic's name."""
_MAX_CHUNK_BYTES = 1 << 27
"""Maximum bytes of a decompressed chunk. The chunks of manufacturers contain either one message or 768 KiB.
An image has up to 50 MB."""
_MESSAGE = 2
"""Record kind (op) of message data in a bag."""
_CHUNK = 5
"""Record kind (op) of a chunk of records."""
_CONNECTION = 7
"""Record kind (op) of a connection, which names a topic. The other kinds are the index."""
_COPY_HINT = "Copy the recording again. It was not closed, or copied only in part."


class Message(NamedTuple):
    """One message of a recording."""

    topic: str
    fields: Fields


def messages(path: Path, is_requested: Callable[[str], bool]) -> Iterator[Message]:
    """Yields the messages of the requested topics, in the order of the file.

    Raises:
        InputError: if the file is damaged or truncated, or would not fit into memory.
    """
    with open_file(path) as file:
        if file.read(len(MAGIC)) != MAGIC:
            raise InputError(
                "the file is not a ROS bag of version 2.0", where=str(path), remedy="Choose another file."
            )
        size = os.fstat(file.fileno()).st_size
        topics: dict[bytes, str] = {}
        while (offset := file.tell()) < size:
            header = _parse_header(_read_sized(file, _MAX_HEADER_BYTES, path), path)
            if _record_kind(header) != _CHUNK:
                remaining = _read_size(file, path)
                if remaining > size - file.tell():
                    raise _cut_off_error(offset, path)
                if _record_kind(header) == _CONNECTION:
                    _add_connection(header, topics)
                file.seek(remaining, os.SEEK_CUR)
                continue
            yield from _chunk_messages(
                decompress_chunk(header, _read_sized(file, _MAX_CHUNK_BYTES, path), path),
                topics,
                is_requested,
                path,
            )


def _chunk_messages(
    chunk: bytes, topics: dict[bytes, str], is_requested: Callable[[str], bool], path: Path
) -> Iterator[Message]:
    """Yields the messages of a chunk. Its connections are added to ``topics``."""
    offset = 0
    while offset < len(chunk):
        header_range, offset = _find_part(chunk, offset, path)
        header = _parse_header(chunk[header_range:offset], path)
        data_range, offset = _find_part(chunk, offset, path)
        if _record_kind(header) == _CONNECTION:
            _add_connection(header, topics)
        elif _record_kind(header) == _MESSAGE:
            topic = topics.get(header.get(b"conn", b""))
            if topic is None:
                raise InputError("a message has no topic", where=str(path), remedy=_COPY_HINT)
            if is_requested(topic):
                yield Message(topic, Fields(chunk[data_range:offset], f"{path}, {topic}"))


def _find_part(chunk: bytes, offset: int, path: Path) -> tuple[int, int]:
    """Returns the start and the end of a chunk's next part, which is preceded by its size."""
    start = offset + 4
    end = start + int.from_bytes(chunk[offset:start], "little")
    if start > len(chunk) or end > len(chunk):
        raise _cut_off_error(offset, path)
    return start, end


def decompress_chunk(header: dict[bytes, bytes], compressed: bytes, path: Path) -> bytes:
    """Returns the decompressed content of a chunk, limited to its declared size."""
    compression, size = (
        header.get(b"compression", b""),
        int.from_bytes(header.get(b"size", b"")[:4], "little"),
    )
    if size > _MAX_CHUNK_BYTES:
        raise _make_too_large_error(size, path)
    try:
        match compression:
            case b"none":
                content = compressed
            case b"lz4":
                content = _decompress_lz4(compressed, size + 1, path)
            case b"bz2":
                content = bz2.BZ2Decompressor().decompress(compressed, max_length=size + 1)
            case _:
                raise InputError(
                    f"the chunks have the unsupported compression {compression!r}",
                    where=str(path),
                    remedy="Decompress the bag: rosbag decompress",
                )
    except (RuntimeError, OSError, EOFError, ValueError):
        raise InputError("a chunk cannot be decompressed", where=str(path), remedy=_COPY_HINT) from None
    if len(content) != size:
        raise InputError("a chunk does not have its declared size", where=str(path), remedy=_COPY_HINT)
    return content


def _decompress_lz4(compressed: bytes, max_bytes: int, path: Path) -> bytes:
    """Returns at most ``max_bytes`` bytes of a chunk that lz4 compressed.

    Raises:
        ResourceError: if the library is not installed.
        RuntimeError: if the chunk is damaged.
    """
    need("lz4", "bags", str(path))
    import lz4.frame  # Imported here, because only some bags need it.

    return lz4.frame.LZ4FrameDecompressor().decompress(compressed, max_length=max_bytes)


def _parse_header(content: bytes, path: Path) -> dict[bytes, bytes]:
    """Returns the fields of a record's header."""
    fields, offset = {}, 0
    while offset < len(content):
        start, offset = _find_part(content, offset, path)
        key, _, value = content[start:offset].partition(b"=")
        fields[key] = value
    return fields


def _add_connection(header: dict[bytes, bytes], topics: dict[bytes, str]) -> None:
    topics[header.get(b"conn", b"")] = header.get(b"topic", b"").decode("utf-8", errors="replace")


def _record_kind(header: dict[bytes, bytes]) -> int:
    return int.from_bytes(header.get(b"op", b"")[:1], "little")


def _read_size(file: BinaryIO, path: Path) -> int:
    size_bytes = file.read(4)
    if len(size_bytes) < 4:
        raise _cut_off_error(file.tell(), path)
    return int(struct.unpack("<I", size_bytes)[0])


def _read_sized(file: BinaryIO, max_bytes: int, path: Path) -> bytes:
    """Reads the next bytes of the file, which are preceded by their number."""
    size = _read_size(file, path)
    if size > os.fstat(file.fileno()).st_size - file.tell():
        raise _cut_off_error(file.tell(), path)
    if size > max_bytes:
        raise _make_too_large_error(size, path)
    return file.read(size)


def _cut_off_error(offset: int, path: Path) -> InputError:
    return InputError(
        f"the file ends in the middle of the record at byte {offset}", where=str(path), remedy=_COPY_HINT
    )


def _make_too_large_error(size: int, path: Path) -> InputError:
    return InputError(
        f"a record has {size} bytes; no depth camera writes records of this size",
        where=str(path),
        remedy=_COPY_HINT,
    )
