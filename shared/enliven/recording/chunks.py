"""Reads the chunks of an MCAP file and their records, with limits on the decompressed size."""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass
from io import BytesIO
from typing import Any, BinaryIO

import zstandard
from mcap import records
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode

from enliven.errors import InputError, find_plain_reason

RECORD = struct.Struct("<BQ")
"""The header of a record: its kind and its length."""
_MESSAGE_HEADER = struct.Struct("<HIQQ")
_MAX_CHUNK_BYTES = 1 << 28
"""Maximum size of a decompressed chunk in bytes. Enliven's recorder closes a chunk at 1 MiB, but a single
message can have 128 MiB.
"""
_MAX_COMPRESSION_RATIO = 200
"""Maximum compression ratio. A chunk of empty images with their times reaches about 40."""
_MIN_CHUNK_BYTE_LIMIT = 1 << 16
"""Decompressed size, in bytes, that is always allowed, even for a very small chunk."""
_MAX_RECORDS = 1 << 16
"""Maximum number of records in a chunk. Enliven's recorder writes at most 34,000, since records have at least
31 bytes and a chunk 1 MiB.
"""
_MIN_CHUNK_RECORD_LIMIT = 256
"""Number of records that is always allowed, even in a very small chunk. Each further record needs at least
one compressed byte, for its time.
"""
DAMAGE = (McapError, struct.error, ValueError, OverflowError, zstandard.ZstdError)


class Damage(Exception):
    """Raised for a chunk or record that cannot be read."""


@dataclass(frozen=True)
class ChunkRef:
    """Position of a chunk record in the file, and the log times of its messages."""

    offset: int
    length: int
    start_ns: int
    end_ns: int


SMALL_RECORDS: dict[int, Any] = {
    Opcode.HEADER: records.Header,
    Opcode.SCHEMA: records.Schema,
    Opcode.CHANNEL: records.Channel,
    Opcode.METADATA: records.Metadata,
    Opcode.METADATA_INDEX: records.MetadataIndex,
    Opcode.CHUNK_INDEX: records.ChunkIndex,
    Opcode.STATISTICS: records.Statistics,
}


def read_chunk(file: BinaryIO, ref: ChunkRef) -> list[Any]:
    """Returns the messages, schemas and channels of a chunk.

    Raises:
        Damage: if the chunk's checksum, compression or content is wrong.
        InputError: if a small chunk would decompress to a very large size (decompression bomb).
    """
    try:
        file.seek(ref.offset)
        data = file.read(ref.length)
        opcode, length = RECORD.unpack_from(data)
        if opcode != Opcode.CHUNK or length + RECORD.size != len(data):
            raise Damage("no chunk begins at the position of a chunk")
        chunk = records.Chunk.read(ReadDataStream(BytesIO(data[RECORD.size :])))
        content = _decompress_chunk(chunk)
        if chunk.uncompressed_crc and zlib.crc32(content) != chunk.uncompressed_crc:
            raise Damage("a chunk's checksum is wrong")
        return _chunk_contents(content, min(_MAX_RECORDS, _MIN_CHUNK_RECORD_LIMIT + len(chunk.data)))
    except DAMAGE as error:
        raise Damage(find_plain_reason(error)) from None
    except _DecompressionBombError as error:
        where = f"{getattr(file, 'name', 'recording')}, byte {ref.offset}"
        remedy = "Get a new copy of the recording. No recorder writes such a part."
        raise InputError(str(error), where=where, remedy=remedy) from None


class _DecompressionBombError(Exception):
    """A small chunk that decompresses to a very large size (decompression bomb)."""


def _decompress_chunk(chunk: Any) -> bytes:
    size, packed_bytes = chunk.uncompressed_size, len(chunk.data)
    if chunk.compression == "":
        return bytes(chunk.data)
    if chunk.compression != "zstd":
        raise Damage(f"a chunk uses the unsupported compression {chunk.compression!r}")
    if zstandard.frame_content_size(chunk.data) not in (size, -1):
        raise Damage("a chunk states two different sizes")
    if size > min(_MAX_CHUNK_BYTES, _MIN_CHUNK_BYTE_LIMIT + _MAX_COMPRESSION_RATIO * packed_bytes):
        raise _DecompressionBombError(
            f"a part of {packed_bytes} bytes states an unpacked size of {size} bytes"
        )
    return zstandard.ZstdDecompressor().decompress(chunk.data, max_output_size=size)


def _chunk_contents(content: bytes, max_records: int) -> list[Any]:
    """Returns the messages, schemas and channels in the content of a chunk of at most ``max_records``
    records."""
    contents: list[Any] = []
    offset = count = 0
    while offset < len(content):
        count += 1
        if count > max_records:
            raise _DecompressionBombError(
                f"a part has more than {max_records} records in {len(content)} bytes"
            )
        opcode, length = RECORD.unpack_from(content, offset)
        start = offset + RECORD.size
        offset = start + length
        if offset > len(content) or (opcode == Opcode.MESSAGE and length < _MESSAGE_HEADER.size):
            raise Damage("a record reaches beyond its chunk, or is too short")
        if opcode == Opcode.MESSAGE:
            channel, sequence, logged, published = _MESSAGE_HEADER.unpack_from(content, start)
            data = content[start + _MESSAGE_HEADER.size : offset]
            contents.append(records.Message(channel, logged, data, published, sequence))
        elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            contents.append(parse_record(opcode, content[start:offset]))
    return contents


def parse_record(opcode: int, data: bytes) -> Any:
    """Returns a record of :data:`SMALL_RECORDS`.

    Raises:
        Damage: if the record has another kind. A damaged record may also raise another exception in
            :data:`DAMAGE`.
    """
    kind = SMALL_RECORDS.get(opcode)
    if kind is None:
        raise Damage(f"a record of kind {opcode} is not allowed here")
    return kind.read(ReadDataStream(BytesIO(data)))
