"""Lossless compression of one depth image, each frame on its own.

Depth cameras quantise: a Kinect frame of 300,000 pixels holds a few hundred different distances. So the
distances are replaced by their rank among those that occur, predicted from the neighbours, and the
residuals are packed. :data:`LAYOUT` states every byte; it is written into each recording beside the data.
"""

from __future__ import annotations

import struct
import zlib

import numpy as np
import zstandard

from enliven.arrays import UInt8, UInt16
from enliven.depth_kernels import mark_levels, predict_image, restore_image
from enliven.errors import InputError

MAX_PIXELS = 1 << 24
"""The largest image that a decoder allocates for, unless told otherwise."""

LAYOUT = """\
enliven depth image, version 1 (little endian; lossless; every image stands on its own)

offset size
 0     1    version = 1
 1     1    packing: 0 = zstd
 2     2    width W
 4     2    height H
 6     4    L, the number of levels (different non-zero values); 0 = no table, the level of v is v
10     4    CRC-32 (zlib) of bytes 0..9 followed by the packed bytes
14     ...  packed bytes: one zstd frame that states its content size

The content: the table of levels, then the residuals of all pixels, row by row.
 table      L differences between ascending levels (the first from 0), uint16: all low bytes, then all high.
 residuals  W*H low bytes, then, where L = 0 or L > 255, W*H high bytes.
Value 0 (nothing measured) is level 0, the ascending levels are 1..P (P = L, or 65535 where L = 0).
Residual s of a pixel of level v, with neighbours w (left), n (above), nw, ne (0 outside the image):
 v = 0:  s = 0
 else :  r = v - p, brought into -(P-1)//2 .. P//2 by adding or subtracting P;
         s = 2r where r > 0, else 1 - 2r, so that 1 <= s <= P
 p    :  w, n, nw all known: the median of w, n, w + n - nw (LOCO-I);  w, n known: (w + n) // 2;
         else the first known of w, n, ne; else the last known level in reading order; else (P + 1) // 2.
"""

_HEADER = struct.Struct("<BBHHI")
_CHECK = struct.Struct("<I")
_ZSTD = 0


def encode_depth(depth: UInt16, level: int = 1) -> bytes:
    """The payload of one image.

    Args:
        depth: (H, W) uint16, any values; 0 where nothing is known.
        level: zstd level, 1 (live) to 22 (archives).

    Raises:
        InputError: for another type or shape, an empty image, or one above :data:`MAX_PIXELS`.
    """
    height, width = _checked_shape(depth)
    levels, ranks, count = _levels(depth)
    planes = predict_image(np.ascontiguousarray(depth), ranks, count)
    used = planes if count > 255 else planes[:1]
    content = _table_bytes(levels) + used.tobytes()
    packed = zstandard.ZstdCompressor(level=level).compress(content)
    header = _HEADER.pack(1, _ZSTD, width, height, len(levels))
    return header + _CHECK.pack(zlib.crc32(packed, zlib.crc32(header))) + packed


def decode_depth(payload: bytes, *, max_pixels: int = MAX_PIXELS) -> UInt16:
    """(H, W) uint16, exactly the image that :func:`encode_depth` was given.

    Raises:
        InputError: for a payload that is damaged, of a later version, or larger than ``max_pixels``.
    """
    width, height, levels = _checked_header(payload, max_pixels)
    count = levels or 65535
    pixels = width * height
    planes = 2 if count > 255 else 1
    content = _unpacked(payload[_HEADER.size + _CHECK.size :], 2 * levels + planes * pixels)
    values = _values(content[: 2 * levels], levels)
    residuals = content[2 * levels :].reshape(planes, height, width)
    depth = np.empty((height, width), np.uint16)
    if not restore_image(residuals, values, count, depth):
        raise _damaged("a residual is outside the table of levels")
    return depth


def _checked_shape(depth: UInt16) -> tuple[int, int]:
    if depth.dtype != np.uint16 or depth.ndim != 2:
        raise InputError(f"the image is {depth.dtype} {depth.shape}, expected (H, W) uint16", where="depth")
    if not depth.size or depth.size > MAX_PIXELS or max(depth.shape) > 65535:
        raise InputError(f"the image is {depth.shape}, expected 1 to {MAX_PIXELS} pixels", where="depth")
    return depth.shape[0], depth.shape[1]


def _levels(depth: UInt16) -> tuple[UInt16, UInt16, int]:
    """(L,) the table of levels (empty where it does not pay), (65536,) the rank of each value, and P."""
    seen = mark_levels(np.ascontiguousarray(depth))
    levels = np.flatnonzero(seen).astype(np.uint16)
    if not levels.size or 2 * levels.size > int(levels[-1]) - int(levels[0]) + 1:
        return np.empty(0, np.uint16), np.arange(65536, dtype=np.uint16), 65535
    ranks = np.zeros(65536, np.uint16)
    ranks[levels] = np.arange(1, levels.size + 1, dtype=np.uint16)
    return levels, ranks, int(levels.size)


def _table_bytes(levels: UInt16) -> bytes:
    steps = np.diff(levels, prepend=np.uint16(0)).astype("<u2")
    return steps.view(np.uint8).reshape(-1, 2).T.tobytes()


def _checked_header(payload: bytes, max_pixels: int) -> tuple[int, int, int]:
    """Width, height and number of levels of a payload whose checksum is right."""
    start = _HEADER.size + _CHECK.size
    if len(payload) < start:
        raise _damaged(f"it is {len(payload)} bytes long")
    version, packing, width, height, levels = _HEADER.unpack_from(payload)
    if version != 1 or packing != _ZSTD:
        raise InputError(
            f"the encoding is version {version}, packing {packing}, which is not known here",
            where="depth payload",
            mend="Update enliven, or record again.",
        )
    (check,) = _CHECK.unpack_from(payload, _HEADER.size)
    if zlib.crc32(memoryview(payload)[start:], zlib.crc32(payload[: _HEADER.size])) != check:
        raise _damaged("its checksum is wrong")
    if not 0 < width * height <= max_pixels or levels > 65535:
        raise _damaged(f"it states {width}x{height} pixels and {levels} levels")
    return width, height, levels


def _unpacked(packed: bytes, size: int) -> UInt8:
    """(size,) the content of a zstd frame that must state exactly this size."""
    try:
        stated = zstandard.frame_content_size(packed)
        if stated != size:
            raise _damaged(f"its content has {stated} bytes where {size} belong")
        content = zstandard.ZstdDecompressor().decompress(packed, max_output_size=size)
    except zstandard.ZstdError as error:
        raise _damaged(str(error)) from None
    if len(content) != size:
        raise _damaged(f"its content has {len(content)} bytes where {size} belong")
    return np.frombuffer(content, np.uint8)


def _values(table: UInt8, levels: int) -> UInt16:
    """(P + 1,) the millimetres of each level."""
    if not levels:
        return np.arange(65536, dtype=np.uint16)
    steps = table.reshape(2, -1).T.copy().view("<u2").ravel().astype(np.int64)
    values = np.concatenate([[0], np.cumsum(steps)])
    if steps.min() < 1 or values[-1] > 65535:
        raise _damaged("its table of levels does not ascend")
    return values.astype(np.uint16)


def _damaged(what: str) -> InputError:
    return InputError(
        f"the depth image is damaged: {what}",
        where="depth payload",
        mend="Record or import it again; the other frames can still be read.",
    )
