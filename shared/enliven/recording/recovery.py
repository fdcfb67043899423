"""Copies the undamaged messages of a truncated or damaged recording to a new recording."""

from __future__ import annotations

import contextlib
import math
import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO

from mcap.opcode import Opcode
from mcap.records import Channel, Message

from enliven.errors import InputError, ResourceError
from enliven.files import open_file
from enliven.recording.chunks import ChunkRef, Damage, read_chunk
from enliven.recording.container import Container, check_version, open_container
from enliven.recording.recorder import Recorder
from enliven.recording.schemas import ABOUT_NAME, PROFILE

_CHUNK_START_PATTERN = re.compile(
    rb"\x06(?=.{5}\x00\x00\x00.{28}(\x04\x00\x00\x00zstd|\x00\x00\x00\x00))", re.DOTALL
)
"""Pattern of the beginning of a chunk: opcode, a length below 2^40, 28 bytes (times, size, checksum), and the
compression.
"""
_FIXED_BYTES = 36
"""Size in bytes of a chunk's fields except compression and data: times, two sizes, checksum."""
_HEAD_BYTES = 9
"""Size in bytes of a record's opcode and length."""
_CHUNK_HEAD_BYTES = 64
"""Maximum size in bytes of a chunk's header before its data. Blocks overlap by this length, so that no chunk
header is split.
"""
_BLOCK_BYTES = 1 << 20
"""Size in bytes of a block that is searched for chunks. If a sector is unreadable, the chunk headers of its
block are not found.
"""
_RECORDS_BETWEEN_CHUNKS = {
    Opcode.MESSAGE_INDEX,
    Opcode.METADATA,
    Opcode.SCHEMA,
    Opcode.CHANNEL,
    Opcode.ATTACHMENT,
}
"""The kinds of records that are allowed between chunks. Other bytes between chunks are from a damaged
chunk."""


@dataclass(frozen=True)
class LostSpan:
    """A span of time in which some or all messages were lost.

    Attributes:
        start_ns, end_ns: start and end, nanoseconds of the sensor's clock. None without an undamaged chunk
            before or after the span.
    """

    start_ns: int | None
    end_ns: int | None


@dataclass
class Recovery:
    """The result of a recovery: copied and lost messages.

    Attributes:
        kept, lost: number of copied and of lost messages by topic. ``lost`` is known only if the recording's
            own index contains
        the total.
        spans: the time spans in which messages were lost, in the order of the file.
        cut: True if the recording was not closed properly, so messages after its last chunk are unknown.
        nameless: number of undamaged messages that were left out because the description of their topic is
            lost.
        first_ns: the earliest time of the copied messages, ignoring messages at time 0.
    """

    kept: Counter[str] = field(default_factory=Counter)
    lost: Counter[str] = field(default_factory=Counter)
    spans: list[LostSpan] = field(default_factory=list)
    cut: bool = False
    nameless: int = 0
    first_ns: int | None = None


def recover(path: Path, output: Path) -> Recovery:
    """Copies every undamaged message of ``path`` into the new recording ``output``.

    Raises:
        InputError: if ``path`` is not a recording, is of a later version or has no undamaged message, or if
            ``output`` exists.
        ResourceError: if ``output`` cannot be written. The incomplete file is removed.
    """
    container = _open_damaged(path)
    if container.profile not in (PROFILE, ""):
        raise InputError(
            f"the file is an MCAP file of another program ({container.profile!r})", where=str(path)
        )
    check_version(container)
    recovery = Recovery(cut=not container.complete)
    with open_file(path) as file:
        refs = _candidate_chunks(container, file)
        for _, records in _read_chunks(file, refs):
            # Descriptions may follow the messages that they describe, so read all of them first.
            for record in records or ():
                if not isinstance(record, Message):
                    container.add(record)
        recorder = Recorder(output, sync_seconds=math.inf)
        try:
            with recorder:
                _copy_messages(container, file, refs, recorder, recovery)
            if not recovery.kept:
                raise InputError(
                    "the recording contains no complete message",
                    where=str(path),
                    remedy="The recording cannot be recovered.",
                )
        except BaseException:
            output.unlink(missing_ok=True)
            raise
    if container.complete:
        recovery.lost = _read_stated_counts(container) - recovery.kept
    return recovery


def _open_damaged(path: Path) -> Container:
    """Returns the container of a recording, or an empty container if its index is in an unreadable part of
    the device."""
    try:
        return open_container(path)
    except ResourceError:
        return Container(path)


def _copy_messages(
    container: Container, file: BinaryIO, refs: list[ChunkRef], recorder: Recorder, recovery: Recovery
) -> None:
    """Copies the messages of all chunks, and stores the time spans with missing messages in ``recovery``."""
    for name, values in container.metadata.items():
        if name != ABOUT_NAME:
            recorder.add_metadata(name, values)
    end, end_ns, lost = len(b"\x89MCAP0\r\n"), None, False
    for ref, records in _read_chunks(file, refs):
        if records is None:
            lost = True
            continue
        if lost or not _has_only_small_records(file, end, ref.offset):
            recovery.spans.append(LostSpan(end_ns, ref.start_ns))
        messages = [record for record in records if isinstance(record, Message)]
        for message in messages:
            _write_message(container, message, recorder, recovery)
        last = max((m.log_time for m in messages), default=ref.end_ns)
        end, end_ns, lost = ref.offset + ref.length, last, False
    if lost or recovery.cut:
        recovery.spans.append(LostSpan(end_ns, None))


def _write_message(container: Container, message: Any, recorder: Recorder, recovery: Recovery) -> None:
    """Writes one message into the new recording, with the description of its topic."""
    channel: Channel | None = container.channels.get(message.channel_id)
    schema = None if channel is None else container.schemas.get(channel.schema_id)
    if channel is None or schema is None:
        recovery.nameless += 1
        return
    kind = (schema.name, schema.data.decode(errors="replace"), schema.encoding, channel.message_encoding)
    sensor = channel.metadata.get("sensor", "")
    recorder.write(channel.topic, *kind, bytes(message.data), message.log_time, sensor)
    recovery.kept[channel.topic] += 1
    if message.log_time and (recovery.first_ns is None or message.log_time < recovery.first_ns):
        recovery.first_ns = message.log_time


def _candidate_chunks(container: Container, file: BinaryIO) -> list[ChunkRef]:
    """Returns all possible chunks in the file's order: those in the index, and those found by searching the
    bytes for a chunk's header.
    """
    refs = {ref.offset: ref for ref in container.chunks}
    size = file.seek(0, 2)
    for first, data in _file_blocks(file, size):
        for match in _CHUNK_START_PATTERN.finditer(data):
            chunk_offset, name = match.start(), len(match[1])
            content_bytes, start, end, content = (
                int.from_bytes(data[chunk_offset + field : chunk_offset + field + 8], "little")
                for field in (1, 9, 17, 37 + name)
            )
            offset, length = first + chunk_offset, _HEAD_BYTES + content_bytes
            is_chunk = content_bytes == _FIXED_BYTES + name + content and offset + length <= size
            if is_chunk and offset not in refs:
                refs[offset] = ChunkRef(offset, length, start, end)
    return [refs[offset] for offset in sorted(refs)]


def _file_blocks(file: BinaryIO, size: int) -> Iterator[tuple[int, bytes]]:
    """Yields the offset and the bytes of overlapping blocks. Unreadable blocks are left out.

    The file is not memory-mapped, because a failing device would then kill the process.
    """
    for offset in range(0, size, _BLOCK_BYTES):
        with contextlib.suppress(ResourceError):
            file.seek(offset)
            yield offset, file.read(_BLOCK_BYTES + _CHUNK_HEAD_BYTES)


def _read_chunks(file: BinaryIO, refs: list[ChunkRef]) -> Iterator[tuple[ChunkRef, list[Any] | None]]:
    """Yields every chunk with its records, or with None if it is damaged.

    False matches of the search inside other chunks are left out.
    """
    end = 0
    for ref in refs:
        if ref.offset < end:
            continue
        try:
            records = read_chunk(file, ref)
        except (Damage, ResourceError):
            yield ref, None
            continue
        end = ref.offset + ref.length
        yield ref, records


def _has_only_small_records(file: BinaryIO, start: int, end: int) -> bool:
    """Returns True if there are only small records between two offsets of the file."""
    offset = start
    while offset + _HEAD_BYTES <= end:
        file.seek(offset)
        try:
            head = file.read(_HEAD_BYTES)
        except ResourceError:
            return False
        if head[0] not in _RECORDS_BETWEEN_CHUNKS and head[0] != Opcode.HEADER:
            return False
        offset += _HEAD_BYTES + int.from_bytes(head[1:], "little")
    return offset == end


def _read_stated_counts(container: Container) -> Counter[str]:
    """Returns the number of messages by topic according to the recording's own index."""
    counts: Counter[str] = Counter()
    for number, count in container.counts.items():
        if number in container.channels:
            counts[container.channels[number].topic] += count
    return counts
