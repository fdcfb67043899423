"""Lossless compression of depth images, each frame separately.

Depth cameras quantise: a Kinect frame of 300,000 pixels contains a few hundred different distances. Each
distance is replaced by its rank among the occurring values and predicted from its neighbours. The residuals
are packed with zstd. Archives of earlier versions, which use an arithmetic coder instead of zstd, can also be
read. :data:`LAYOUT` specifies every byte. It is written into each recording.
"""

from __future__ import annotations

import struct
import zlib

import numpy as np
import zstandard

from enliven.arrays import UInt8, UInt16
from enliven.errors import InputError, refuse_later_version
from enliven.recording.depth_entropy import unpack_levels
from enliven.recording.depth_kernels import mark_levels, predict_image, restore_image

MAX_PIXELS = 1 << 24
"""Default maximum number of pixels that a decoder accepts: 4096 x 4096, which is more than any depth camera
has."""


LAYOUT = """\
enliven depth image, version 1 (little endian; lossless; every image stands on its own)

offset size
 0     1    version = 1
 1     1    packing: 0 = zstd, 1 = arithmetic coder
 2     2    width W
 4     2    height H
 6     4    L, the number of levels (different non-zero values); 0 = no table, the level of v is v
10     4    CRC-32 (zlib) of bytes 0..9 followed by the packed bytes
14     ...  packed bytes

Value 0 (nothing measured) is level 0, the ascending levels are 1..P (P = L, or 65535 where L = 0).
The level v of a pixel is predicted from its neighbours' w (left), n (above), nw, ne (0 outside the image):
 p = w, n, nw all known: the median of w, n, w + n - nw (LOCO-I);  w, n known: (w + n) // 2;
     else the first known of w, n, ne; else the last known level in reading order; else (P + 1) // 2.
Where v > 0, r = v - p is brought into -((P - 1) // 2) .. P // 2 by adding or subtracting P.

Packing 0: one zstd frame that states its content size. Its content:
 table      L differences between ascending levels (the first from 0), uint16: all low bytes, then all high.
 residuals  of all pixels, row by row: W*H low bytes, then, where L = 0 or L > 255, W*H high bytes of
            s = 0 where v = 0;  s = 2r where r > 0;  s = 1 - 2r elsewhere.

Packing 1 (archives of earlier versions): yes-no answers in one arithmetic code; ww is left of w, nn above n.
 table      for each of the L differences d (as above; before the first, d' = 1): the residual d - d', d' the
            difference before, with the surroundings 7500 + c, c = min(3, |residual before|), 0 for the first.
 pixels     row by row: "v = 0?" with the odds of (w, n, nw, ne, ww, nn known?, as bits 0..5); if not, the
            residual r with the surroundings (((e*5 + f(n-p))*5 + f(w-p))*5 + f(ne-p))*5 + f(ww-w), where
            f(x) = 2 + x kept within -2..2, and e = the bit length, at most 11, of
            E(left) + E(above) + (E(above left) + E(above right)) // 2, with E = min(|r|, 2000), 0 for holes.
 residual   "zero?", "negative?", then "|r| = m?" for m = 1..12, each with odds of its own in these
            surroundings; else |r| - 12 in bits: "no bit after this one?" with 17 odds shared by all
            residuals, one for each place from the second bit on, then the bits below the highest from high
            to low, at even odds.
 odds       of "yes", of 65536: 32768 at first; after the k-th answer (k from 0, at most 60) moved by
            ((65535*answer - odds) * round(65536 / (k + 1.6))) >> 16, and kept within 32..65503.
 code       low = 0, high = 2^32 - 1; with width = high - low, middle = low + (width >> 16) * odds
            + ((width & 65535) * odds >> 16); yes: high = middle, no: low = middle + 1; while the top bytes
            of both agree that byte is written and both move up by 8 bits (low gains 0, high 255).
            At the end the top byte of low, plus 1, is written; zeros follow.
"""

_HEADER = struct.Struct("<BBHHI")
_CHECKSUM = struct.Struct("<I")
_CONTENT_OFFSET = _HEADER.size + _CHECKSUM.size
_ZSTD_PACKING = 0
"""Value of byte 1 in the layout for packing by zstd."""
_ARITHMETIC_PACKING = 1
"""Value of byte 1 in the layout for packing by the arithmetic coder."""


def encode_depth(depth: UInt16, level: int = 1) -> bytes:
    """Compresses one image. Returns the payload.

    Args:
        depth: (H, W) uint16, any values. 0 means unknown depth.
        level: zstd level, 1 (live) to 22 (archives).

    Raises:
        InputError: if type or shape are wrong, or the image is empty or has more than :data:`MAX_PIXELS`
            pixels.
    """
    height, width = _check_shape(depth)
    depth = np.require(depth, requirements=["C", "W", "A"])
    levels, ranks = rank_depth_levels(depth)
    planes = predict_image(depth, ranks, len(levels) or 65535)
    steps = np.diff(levels, prepend=np.uint16(0)).astype("<u2")
    table = steps.view(np.uint8).reshape(-1, 2).T.tobytes()
    compressed = zstandard.ZstdCompressor(level=level).compress(table + planes.tobytes())
    header = _HEADER.pack(1, _ZSTD_PACKING, width, height, len(levels))
    return header + _CHECKSUM.pack(zlib.crc32(compressed, zlib.crc32(header))) + compressed


def decode_depth(payload: bytes, *, max_pixels: int = MAX_PIXELS) -> UInt16:
    """Returns (H, W) uint16, exactly the image that was passed to :func:`encode_depth`.

    Raises:
        InputError: if the payload is damaged, has a later version, or has more than ``max_pixels`` pixels.
    """
    packing, width, height, levels = _check_header(payload, max_pixels)
    compressed = payload[_CONTENT_OFFSET:]
    depth = np.empty((height, width), np.uint16)
    if packing == _ARITHMETIC_PACKING:
        values = np.zeros(levels + 1, np.uint16) if levels else np.arange(65536, dtype=np.uint16)
        is_complete = unpack_levels(np.frombuffer(bytearray(compressed), np.uint8), values, levels > 0, depth)
    else:
        values, residuals = _unpack_zstd(compressed, width, height, levels)
        is_complete = restore_image(residuals, values, len(values) - 1, depth)
    if not is_complete:
        raise _damage_error("a pixel refers to a depth level that does not exist")
    return depth


def _unpack_zstd(packed: bytes, width: int, height: int, levels: int) -> tuple[UInt16, UInt8]:
    """Unpacks an image with packing 0. Returns the depth values of the levels, and the residuals (1 or 2, H,
    W)."""
    planes = 1 if 0 < levels <= 255 else 2
    content = _unpack_content(packed, 2 * levels + planes * width * height)
    return _level_depths(content[: 2 * levels], levels), content[2 * levels :].reshape(planes, height, width)


def _check_shape(depth: UInt16) -> tuple[int, int]:
    if depth.dtype != np.uint16 or depth.ndim != 2:
        raise InputError(
            f"the depth image is {depth.dtype} {depth.shape}, expected (H, W) uint16", where="depth"
        )
    if not depth.size or depth.size > MAX_PIXELS or max(depth.shape) > 65535:
        raise InputError(
            f"the depth image has the shape {depth.shape}, expected 1 to {MAX_PIXELS} pixels", where="depth"
        )
    return depth.shape[0], depth.shape[1]


def rank_depth_levels(depth: UInt16) -> tuple[UInt16, UInt16]:
    """Returns the table of levels (L,), and the level (65536,) of each value. The table is empty if it would
    not save space.
    """
    occurs = mark_levels(depth)
    levels = np.flatnonzero(occurs).astype(np.uint16)
    if not levels.size or 2 * levels.size > int(levels[-1]) - int(levels[0]) + 1:
        return np.empty(0, np.uint16), np.arange(65536, dtype=np.uint16)
    ranks = np.zeros(65536, np.uint16)
    ranks[levels] = np.arange(1, levels.size + 1, dtype=np.uint16)
    return levels, ranks


def _check_header(payload: bytes, max_pixels: int) -> tuple[int, int, int, int]:
    """Checks the header and the checksum of a payload. Returns its packing, width, height and number of
    levels."""
    if len(payload) < _CONTENT_OFFSET:
        raise _damage_error(f"its data has only {len(payload)} bytes")
    version, packing, width, height, levels = _HEADER.unpack_from(payload)
    refuse_later_version(version, 1, "depth payload")
    if version != 1 or packing not in (_ZSTD_PACKING, _ARITHMETIC_PACKING):
        raise InputError(
            f"this version of enliven does not know the encoding (version {version}, packing {packing})",
            where="depth payload",
            remedy="Update enliven, or record again.",
        )
    (check,) = _CHECKSUM.unpack_from(payload, _HEADER.size)
    if zlib.crc32(memoryview(payload)[_CONTENT_OFFSET:], zlib.crc32(payload[: _HEADER.size])) != check:
        raise _damage_error("its checksum is wrong")
    if not 0 < width * height <= max_pixels or levels > 65535:
        raise _damage_error(f"its header states {width}x{height} pixels and {levels} depth levels")
    return packing, width, height, levels


def _unpack_content(packed: bytes, size: int) -> UInt8:
    """Decompresses a zstd frame. Returns its content (size,). The frame must declare exactly this size."""
    try:
        stated = zstandard.frame_content_size(packed)
        if stated != size:
            raise _damage_error(f"its content has {stated} bytes, expected {size}")
        content = zstandard.ZstdDecompressor().decompress(packed, max_output_size=size)
    except zstandard.ZstdError:
        raise _damage_error("its content cannot be unpacked") from None
    if len(content) != size:
        raise _damage_error(f"its content has {len(content)} bytes, expected {size}")
    return np.frombuffer(content, np.uint8)


def _level_depths(table: UInt8, levels: int) -> UInt16:
    """Returns the depth (P + 1,) of each level in millimetres."""
    if not levels:
        return np.arange(65536, dtype=np.uint16)
    steps = table.reshape(2, -1).T.copy().view("<u2").ravel().astype(np.int64)
    values = np.concatenate([[0], np.cumsum(steps)])
    if steps.min() < 1 or values[-1] > 65535:
        raise _damage_error("its depth levels are not in ascending order")
    return values.astype(np.uint16)


def _damage_error(damage: str) -> InputError:
    return InputError(
        f"the depth image is damaged: {damage}",
        where="depth payload",
        remedy="Record or import the recording again. The other frames can still be read.",
    )
