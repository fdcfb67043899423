"""Reads the MCAP container. A damaged chunk does not affect the other chunks."""

from __future__ import annotations

import struct
import zlib
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO

from mcap import records
from mcap.opcode import Opcode

from enliven.errors import InputError, refuse_later_version
from enliven.files import open_file
from enliven.recording.chunks import (
    DAMAGE,
    RECORD,
    SMALL_RECORDS,
    ChunkRef,
    Damage,
    parse_record,
    read_chunk,
)
from enliven.recording.schemas import ABOUT_NAME, RECORDING_VERSION, VERSION_KEY

MAGIC = b"\x89MCAP0\r\n"
_FOOTER = struct.Struct("<QQI")
_FOOTER_BYTES = RECORD.size + _FOOTER.size + len(MAGIC)
_MAX_SMALL_RECORD_BYTES = 1 << 26
"""Maximum size in bytes of a schema, a channel or another small record."""
_MAX_METADATA_BYTES = 1 << 20
"""Maximum size in bytes of a metadata record that the index refers to. It is limited because an index may
refer to the same record many times.
"""
_MAX_METADATA_RECORDS = 1 << 10
"""Maximum number of metadata records that the index may refer to. Enliven's recorder writes only a few."""


@dataclass
class Container:
    """The content of a recording, without its messages.

    Attributes:
        complete: True if the file was closed properly.
        cut_at: if the file was not closed properly, the offset of the first byte that cannot be read.
        counts: number of messages for each channel.
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
        """Registers a schema, channel, metadata or header record."""
        if isinstance(record, records.Schema):
            self.schemas[record.id] = record
        elif isinstance(record, records.Channel):
            self.channels[record.id] = record
        elif isinstance(record, records.Metadata):
            self.metadata[record.name] = dict(record.metadata)
        elif isinstance(record, records.Header):
            self.profile, self.library = record.profile, record.library


def open_container(path: Path) -> Container:
    """Reads the container of a file from its index. If the index is missing, reads all records in order.

    Raises:
        InputError: if the file is missing, empty or not an MCAP file.
    """
    with open_file(path) as file:
        start = file.read(len(MAGIC))
        if start != MAGIC:
            raise _make_foreign_file_error(path, start)
        size = file.seek(0, 2)
        try:
            return _read_indexed(path, file, size)
        except (Damage, *DAMAGE):
            return _scan_records(path, file, size)


def check_version(container: Container) -> None:
    """Raises InputError if a recording has a later version, or its version is not a number."""
    stated = container.metadata.get(ABOUT_NAME, {}).get(VERSION_KEY, "1")
    if not (stated.isdecimal() and stated.isascii()):
        problem, remedy = f"the version {stated[:20]!r} of the recording is not a number", "Record again."
        raise InputError(problem, where=str(container.path), remedy=remedy)
    refuse_later_version(int(stated), RECORDING_VERSION, str(container.path), container.library)


def _read_indexed(path: Path, file: BinaryIO, size: int) -> Container:
    """Reads the container from the summary at the end of a file that was closed properly."""
    if size < len(MAGIC) + _FOOTER_BYTES:
        raise Damage("the file has no footer")
    file.seek(size - _FOOTER_BYTES)
    tail = file.read(_FOOTER_BYTES)
    if tail[-len(MAGIC) :] != MAGIC or tail[0] != Opcode.FOOTER:
        raise Damage("the file has no footer")
    start, _, crc = _FOOTER.unpack_from(tail, RECORD.size)
    if not len(MAGIC) < start < size - _FOOTER_BYTES:
        raise Damage("the file has no summary")
    file.seek(start)
    summary = file.read(size - _FOOTER_BYTES - start)
    if not crc or zlib.crc32(tail[: RECORD.size + 16], zlib.crc32(summary)) != crc:
        raise Damage("the summary's checksum is wrong")
    container = Container(path, complete=True, cut_at=size)
    file.seek(len(MAGIC))
    container.add(_read_record(file, size))
    inside = _parse_summary(summary)
    if sum(isinstance(record, records.MetadataIndex) for record in inside) > _MAX_METADATA_RECORDS:
        raise Damage("the index refers to too many metadata records")
    for record in inside:
        _add_indexed(container, record, file, size)
    end = 0
    for ref in sorted(container.chunks, key=lambda ref: ref.offset):
        # Reject chunks that overlap. A damaged index that lists one chunk a thousand times would otherwise
        # cause a thousand reads.
        if ref.offset < end or ref.offset + ref.length > size:
            raise Damage("the index refers to chunks that overlap or do not exist")
        end = ref.offset + ref.length
    return container


def _add_indexed(container: Container, record: Any, file: BinaryIO, size: int) -> None:
    """Registers one record of the summary."""
    if isinstance(record, records.ChunkIndex):
        container.chunks.append(
            ChunkRef(
                record.chunk_start_offset,
                record.chunk_length,
                record.message_start_time,
                record.message_end_time,
            )
        )
    elif isinstance(record, records.Statistics):
        container.counts.update(record.channel_message_counts)
    elif isinstance(record, records.MetadataIndex):
        if record.offset > size:
            raise Damage("the index refers to metadata that does not exist")
        file.seek(record.offset)
        container.add(_read_record(file, size))
    else:
        container.add(record)


def _scan_records(path: Path, file: BinaryIO, size: int) -> Container:
    """Reads the container of a truncated file: all complete records from its start."""
    container = Container(path)
    offset = len(MAGIC)
    while offset + RECORD.size <= size:
        file.seek(offset)
        opcode, length = RECORD.unpack(file.read(RECORD.size))
        end = offset + RECORD.size + length
        if opcode == 0 or end > size:
            break
        if opcode == Opcode.CHUNK:
            _add_scanned(container, file, offset, end - offset)
        elif opcode in SMALL_RECORDS and length <= _MAX_SMALL_RECORD_BYTES:
            try:
                container.add(parse_record(opcode, file.read(length)))
            except DAMAGE:
                container.damaged_chunks += 1
        offset = end
        if opcode in (Opcode.DATA_END, Opcode.FOOTER):
            break
    container.cut_at = offset
    return container


def _add_scanned(container: Container, file: BinaryIO, offset: int, length: int) -> None:
    """Registers a chunk, and the schemas, channels and message counts in it."""
    try:
        inside = read_chunk(file, ChunkRef(offset, length, 0, 0))
    except Damage:
        container.damaged_chunks += 1
        return
    times = [record.log_time for record in inside if isinstance(record, records.Message)]
    for record in inside:
        if isinstance(record, records.Message):
            container.counts[record.channel_id] += 1
        else:
            container.add(record)
    if times:
        container.chunks.append(ChunkRef(offset, length, min(times), max(times)))


def _read_record(file: BinaryIO, size: int) -> Any:
    """Returns the record at the file's position."""
    opcode, length = RECORD.unpack(file.read(RECORD.size))
    if length > min(size, _MAX_METADATA_BYTES):
        raise Damage("a record states a larger size than the file has")
    return parse_record(opcode, file.read(length))


def _parse_summary(data: bytes) -> list[Any]:
    """Returns those records of a summary section that this module uses."""
    summary_records, offset = [], 0
    while offset < len(data):
        opcode, length = RECORD.unpack_from(data, offset)
        offset += RECORD.size
        if opcode in SMALL_RECORDS:
            summary_records.append(parse_record(opcode, data[offset : offset + length]))
        offset += length
    return summary_records


def _make_foreign_file_error(path: Path, start: bytes) -> InputError:
    problem = "the file is empty" if not start else "the file is not a recording (MCAP file)"
    remedy = (
        "Record again."
        if not start
        else (
            "Import other recordings with `enliven import`. `enliven import --list-readers` lists the "
            "known formats."
        )
    )
    return InputError(problem, where=str(path), remedy=remedy)
