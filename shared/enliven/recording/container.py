"""The MCAP container, read so that damage costs no more than the chunk it is in."""

from __future__ import annotations

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

from enliven.errors import InputError
from enliven.files import open_file

MAGIC = b"\x89MCAP0\r\n"
_RECORD = struct.Struct("<BQ")
_CHUNK = struct.Struct("<QQQII")
_FOOTER = struct.Struct("<QQI")
_FOOTER_BYTES = _RECORD.size + _FOOTER.size + len(MAGIC)
_MESSAGE = struct.Struct("<HIQQ")
_MAX_CHUNK = 1 << 28
"""Bytes of a chunk, unpacked: our recorder closes one at 1 MiB, and its longest message has 128 MiB."""
_MAX_RATIO = 200
"""Bytes that one packed byte may unpack to: images of nothing, each with its time, reach some 40."""
_FREE_BYTES = 1 << 16
"""Bytes that a chunk may unpack to however few it has."""
_MAX_RECORDS = 1 << 16
"""Records of a chunk: our recorder writes at most 34,000, each with at least 31 bytes of 1 MiB."""
_FREE_RECORDS = 256
"""Records of a chunk however few bytes it has: more need at least a packed byte each, for their times."""
_MAX_RECORD = 1 << 26
"""Bytes of a schema, a channel or another small record."""
_MAX_NAMED = 1 << 20
"""Bytes of a record of words that the index names: it may name the same one many times."""
_MAX_METADATA = 1 << 10
"""Records of words that the index may name: our recorder writes a few."""
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


def read_chunk(file: BinaryIO, ref: ChunkRef) -> list[Any]:
    """The messages, schemas and channels of a chunk.

    Raises:
        Damage: where the chunk's checksum, compression or content is wrong.
        InputError: for a chunk that nobody recorded: of a few bytes that unpack to a flood.
    """
    try:
        file.seek(ref.offset)
        data = file.read(ref.length)
        opcode, length = _RECORD.unpack_from(data)
        if opcode != Opcode.CHUNK or length + _RECORD.size != len(data):
            raise Damage("no chunk is where one belongs")
        chunk = records.Chunk.read(ReadDataStream(BytesIO(data[_RECORD.size :])))
        content = _decompressed(chunk)
        if chunk.uncompressed_crc and zlib.crc32(content) != chunk.uncompressed_crc:
            raise Damage("a chunk's checksum is wrong")
        return _contents(content, min(_MAX_RECORDS, _FREE_RECORDS + len(chunk.data)))
    except _DAMAGE as error:
        raise Damage(str(error) or type(error).__name__) from None
    except _Flood as error:
        where = f"{getattr(file, 'name', 'recording')}, byte {ref.offset}"
        mend = "Ask for the recording again: no recorder writes such a part."
        raise InputError(str(error), where=where, mend=mend) from None


class _Flood(Exception):
    """A chunk of a few bytes that unpacks to a flood."""


def _decompressed(chunk: Any) -> bytes:
    size, packed = chunk.uncompressed_size, len(chunk.data)
    if chunk.compression == "":
        return bytes(chunk.data)
    if chunk.compression != "zstd":
        raise Damage(f"a chunk is compressed with {chunk.compression!r}")
    if zstandard.frame_content_size(chunk.data) not in (size, -1):
        raise Damage("a chunk states two sizes")
    if size > min(_MAX_CHUNK, _FREE_BYTES + _MAX_RATIO * packed):
        raise _Flood(f"a part of {packed} bytes states that it unpacks to {size}")
    return zstandard.ZstdDecompressor().decompress(chunk.data, max_output_size=size)


def _contents(content: bytes, most: int) -> list[Any]:
    """The messages, schemas and channels in the content of a chunk of at most ``most`` records."""
    made: list[Any] = []
    at = count = 0
    while at < len(content):
        count += 1
        if count > most:
            raise _Flood(f"a part has more than {most} records in {len(content)} bytes")
        opcode, length = _RECORD.unpack_from(content, at)
        start = at + _RECORD.size
        at = start + length
        if at > len(content) or (opcode == Opcode.MESSAGE and length < _MESSAGE.size):
            raise Damage("a record reaches beyond its chunk, or is too short")
        if opcode == Opcode.MESSAGE:
            channel, sequence, logged, published = _MESSAGE.unpack_from(content, start)
            data = content[start + _MESSAGE.size : at]
            made.append(records.Message(channel, logged, data, published, sequence))
        elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            made.append(_parsed(opcode, content[start:at]))
    return made


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
    inside = _records_of(summary)
    if sum(isinstance(record, records.MetadataIndex) for record in inside) > _MAX_METADATA:
        raise Damage("the index names too many records of words")
    for record in inside:
        _add_indexed(found, record, file, size)
    end = 0
    for ref in sorted(found.chunks, key=lambda ref: ref.offset):
        # An index that names one chunk a thousand times would have it read as often.
        if ref.offset < end or ref.offset + ref.length > size:
            raise Damage("the index names chunks that overlap or are not there")
        end = ref.offset + ref.length
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
        if record.offset > size:
            raise Damage("the index names words that are not there")
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
    if length > min(size, _MAX_NAMED):
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
