"""The MCAP container, read so that damage costs no more than the chunk it is in."""

from __future__ import annotations

import dataclasses
import struct
import zlib
from collections import Counter
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO

import zstandard
from mcap import records
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.stream_reader import breakup_chunk

from enliven.errors import InputError

MAGIC = b"\x89MCAP0\r\n"
_RECORD = struct.Struct("<BQ")
_CHUNK = struct.Struct("<QQQII")
_FOOTER = struct.Struct("<QQI")
_FOOTER_BYTES = _RECORD.size + _FOOTER.size + len(MAGIC)
_MAX_CHUNK = 1 << 30
_MAX_RECORD = 1 << 26
_DAMAGE = (McapError, struct.error, ValueError, OverflowError, zstandard.ZstdError)


class Damage(Exception):
    """A chunk or record that cannot be read."""


@dataclass(frozen=True)
class ChunkRef:
    """Where a chunk record is, and the log times of its messages."""

    offset: int
    length: int
    start_ns: int
    end_ns: int


@dataclass
class Container:
    """What a recording holds, without its messages.

    Attributes:
        complete: whether the file was closed properly.
        cut_at: the byte from which on nothing can be read, where it was not.
        counts: messages by channel.
    """

    path: Path
    profile: str = ""
    library: str = ""
    complete: bool = False
    cut_at: int = 0
    chunks: list[ChunkRef] = field(default_factory=list)
    schemas: dict[int, Any] = field(default_factory=dict)
    channels: dict[int, Any] = field(default_factory=dict)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    counts: Counter[int] = field(default_factory=Counter)
    damaged_chunks: int = 0

    def add(self, record: Any) -> None:
        """Take note of a schema, channel, metadata or header record."""
        if isinstance(record, records.Schema):
            self.schemas[record.id] = record
        elif isinstance(record, records.Channel):
            self.channels[record.id] = record
        elif isinstance(record, records.Metadata):
            self.metadata[record.name] = dict(record.metadata)
        elif isinstance(record, records.Header):
            self.profile, self.library = record.profile, record.library


def open_container(path: Path) -> Container:
    """The container of a file: from its index, or where that is missing by walking from record to record.

    Raises:
        InputError: where the file is missing, empty or no MCAP file.
    """
    with open_file(path) as file:
        start = file.read(len(MAGIC))
        if start != MAGIC:
            raise _foreign(path, start)
        size = file.seek(0, 2)
        try:
            return _from_index(path, file, size)
        except (Damage, *_DAMAGE):
            return _from_walk(path, file, size)


def open_file(path: Path) -> BinaryIO:
    """The file, opened for reading.

    Raises:
        InputError: where that is not possible.
    """
    try:
        return path.open("rb")
    except FileNotFoundError:
        raise InputError("there is no such file", where=str(path), mend="Check the path.") from None
    except OSError as error:
        mend = "Name a file that can be read." if path.exists() else "Check the path."
        raise InputError(
            f"it cannot be read ({error.strerror or error})", where=str(path), mend=mend
        ) from None


def read_chunk(file: BinaryIO, ref: ChunkRef) -> list[Any]:
    """The records of a chunk.

    Raises:
        Damage: where the chunk's checksum, compression or content is wrong.
    """
    file.seek(ref.offset)
    data = file.read(ref.length)
    try:
        opcode, length = _RECORD.unpack_from(data)
        if opcode != Opcode.CHUNK or length + _RECORD.size != len(data):
            raise Damage("no chunk is where one belongs")
        chunk = records.Chunk.read(ReadDataStream(BytesIO(data[_RECORD.size :])))
        content = _decompressed(chunk)
        if chunk.uncompressed_crc and zlib.crc32(content) != chunk.uncompressed_crc:
            raise Damage("a chunk's checksum is wrong")
        return list(breakup_chunk(dataclasses.replace(chunk, compression="", data=content)))
    except _DAMAGE as error:
        raise Damage(str(error) or type(error).__name__) from None


def _decompressed(chunk: Any) -> bytes:
    size = chunk.uncompressed_size
    if size > _MAX_CHUNK:
        raise Damage(f"a chunk states {size} bytes")
    if chunk.compression == "":
        return bytes(chunk.data)
    if chunk.compression != "zstd":
        raise Damage(f"a chunk is compressed with {chunk.compression!r}")
    if zstandard.frame_content_size(chunk.data) not in (size, -1):
        raise Damage("a chunk states two sizes")
    return zstandard.ZstdDecompressor().decompress(chunk.data, max_output_size=size)


def _from_index(path: Path, file: BinaryIO, size: int) -> Container:
    """The container from the summary at the end of a file that was closed properly."""
    if size < len(MAGIC) + _FOOTER_BYTES:
        raise Damage("no footer")
    file.seek(size - _FOOTER_BYTES)
    tail = file.read(_FOOTER_BYTES)
    if tail[-len(MAGIC) :] != MAGIC or tail[0] != Opcode.FOOTER:
        raise Damage("no footer")
    start, _, crc = _FOOTER.unpack_from(tail, _RECORD.size)
    if not len(MAGIC) < start < size - _FOOTER_BYTES:
        raise Damage("no summary")
    file.seek(start)
    summary = file.read(size - _FOOTER_BYTES - start)
    if not crc or zlib.crc32(tail[: _RECORD.size + 16], zlib.crc32(summary)) != crc:
        raise Damage("the summary's checksum is wrong")
    found = Container(path, complete=True, cut_at=size)
    file.seek(len(MAGIC))
    found.add(_read_record(file, size))
    for record in _records_of(summary):
        _add_indexed(found, record, file, size)
    return found


def _add_indexed(found: Container, record: Any, file: BinaryIO, size: int) -> None:
    """Take note of one record of the summary."""
    if isinstance(record, records.ChunkIndex):
        found.chunks.append(
            ChunkRef(
                record.chunk_start_offset,
                record.chunk_length,
                record.message_start_time,
                record.message_end_time,
            )
        )
    elif isinstance(record, records.Statistics):
        found.counts.update(record.channel_message_counts)
    elif isinstance(record, records.MetadataIndex):
        file.seek(record.offset)
        found.add(_read_record(file, size))
    else:
        found.add(record)


def _from_walk(path: Path, file: BinaryIO, size: int) -> Container:
    """The container of a file without its end: every whole record from the start."""
    found = Container(path)
    at = len(MAGIC)
    while at + _RECORD.size <= size:
        file.seek(at)
        opcode, length = _RECORD.unpack(file.read(_RECORD.size))
        end = at + _RECORD.size + length
        if opcode == 0 or end > size:
            break
        if opcode == Opcode.CHUNK:
            _add_walked(found, file, at, end - at)
        elif opcode in _SMALL_RECORDS and length <= _MAX_RECORD:
            try:
                found.add(_parsed(opcode, file.read(length)))
            except _DAMAGE:
                found.damaged_chunks += 1
        at = end
        if opcode in (Opcode.DATA_END, Opcode.FOOTER):
            break
    found.cut_at = at
    return found


def _add_walked(found: Container, file: BinaryIO, offset: int, length: int) -> None:
    """Take note of a chunk and the schemas, channels and counts inside."""
    try:
        inside = read_chunk(file, ChunkRef(offset, length, 0, 0))
    except Damage:
        found.damaged_chunks += 1
        return
    times = [record.log_time for record in inside if isinstance(record, records.Message)]
    for record in inside:
        if isinstance(record, records.Message):
            found.counts[record.channel_id] += 1
        else:
            found.add(record)
    if times:
        found.chunks.append(ChunkRef(offset, length, min(times), max(times)))


_SMALL_RECORDS: dict[int, Any] = {
    Opcode.HEADER: records.Header,
    Opcode.SCHEMA: records.Schema,
    Opcode.CHANNEL: records.Channel,
    Opcode.METADATA: records.Metadata,
    Opcode.METADATA_INDEX: records.MetadataIndex,
    Opcode.CHUNK_INDEX: records.ChunkIndex,
    Opcode.STATISTICS: records.Statistics,
}


def _read_record(file: BinaryIO, size: int) -> Any:
    """The record at the file's position."""
    opcode, length = _RECORD.unpack(file.read(_RECORD.size))
    if length > min(size, _MAX_RECORD):
        raise Damage("a record states more bytes than the file has")
    return _parsed(opcode, file.read(length))


def _records_of(data: bytes) -> list[Any]:
    """The records of a summary section that are of use here."""
    made, at = [], 0
    while at < len(data):
        opcode, length = _RECORD.unpack_from(data, at)
        at += _RECORD.size
        if opcode in _SMALL_RECORDS:
            made.append(_parsed(opcode, data[at : at + length]))
        at += length
    return made


def _parsed(opcode: int, data: bytes) -> Any:
    kind = _SMALL_RECORDS.get(opcode)
    if kind is None:
        raise Damage(f"a record of kind {opcode} is out of place")
    return kind.read(ReadDataStream(BytesIO(data)))


def _foreign(path: Path, start: bytes) -> InputError:
    what = "the file is empty" if not start else "it is not a recording (an MCAP file)"
    mend = (
        "Record again."
        if not start
        else "Use `enliven import` for other recordings; `enliven import --list-readers` shows which."
    )
    return InputError(what, where=str(path), mend=mend)
