"""Encoder for depth images in the arithmetic code of earlier versions, as found in their archives."""

import struct
import zlib

import numpy as np

from enliven.kernels import njit
from enliven.recording.depth_codec import rank_depth_levels
from enliven.recording.depth_entropy import (
    HOLE_STATES,
    LARGE_STATES_START,
    MAX_UNARY_LENGTH,
    STATE_COUNT,
    STATES_PER_CONTEXT,
    TABLE_STATES_START,
    compute_context_index,
    update_state,
)
from enliven.recording.depth_kernels import predict_level


def encode_archived(depth):
    """Returns the payload of an (H, W) uint16 image in packing 1 of LAYOUT. Noise makes it larger than the
    image."""
    depth = np.require(depth, requirements=["C", "W", "A"])
    levels, ranks = rank_depth_levels(depth)
    values = np.concatenate([[0], levels]).astype(np.uint16) if len(levels) else ranks
    out = np.empty(2 * depth.nbytes + 2 * values.nbytes + 64, np.uint8)
    packed = out[: pack_levels(depth, ranks, values, len(levels) > 0, out)].tobytes()
    height, width = depth.shape
    header = struct.pack("<BBHHI", 1, 1, width, height, len(levels))
    return header + struct.pack("<I", zlib.crc32(packed, zlib.crc32(header))) + packed


@njit(cache=True, nogil=True)
def _encode_bit(coder, out, odds, bit):
    """Encodes one bit. ``coder`` is (3,) int64: low bound, high bound, bytes written."""
    low, high = coder[0], coder[1]
    width = high - low
    middle = low + (width >> 16) * odds + (((width & 0xFFFF) * odds) >> 16)
    if bit:
        high = middle
    else:
        low = middle + 1
    while (low ^ high) & 0xFF000000 == 0:
        out[coder[2]] = high >> 24
        coder[2] += 1
        low, high = (low << 8) & 0xFFFFFFFF, ((high << 8) & 0xFFFFFFFF) | 255
    coder[0], coder[1] = low, high


@njit(cache=True, nogil=True)
def _encode_bit_with_state(coder, data, states, at, bit):
    """Encodes one bit with the probability of a state."""
    _encode_bit(coder, data, int(states[at]) >> 8, bit)
    update_state(states, at, bit)


@njit(cache=True, nogil=True)
def _encode_residual(coder, data, states, base, r):
    """Encodes a residual: whether it is zero, then its sign, then its size, first in unary and then in
    bits.
    """
    _encode_bit_with_state(coder, data, states, base, int(r == 0))
    if r == 0:
        return
    _encode_bit_with_state(coder, data, states, base + 1, int(r < 0))
    size = abs(r)
    for m in range(1, MAX_UNARY_LENGTH + 1):
        _encode_bit_with_state(coder, data, states, base + 1 + m, int(size == m))
        if size == m:
            return
    rest, bits = size - MAX_UNARY_LENGTH, 0
    while bits < 17:
        last = int(rest >> (bits + 1) == 0)
        _encode_bit_with_state(coder, data, states, LARGE_STATES_START + bits, last)
        if last:
            break
        bits += 1
    for b in range(bits - 1, -1, -1):
        _encode_bit(coder, data, 32768, (rest >> b) & 1)


@njit(cache=True, nogil=True)
def _write_table(values, data, coder, states):
    """Encodes the ascending (P + 1,) ``values``. Each step is predicted to equal the one before."""
    former, size = 1, 0
    for level in range(1, values.size):
        step = int(np.int64(values[level])) - int(np.int64(values[level - 1]))
        _encode_residual(coder, data, states, TABLE_STATES_START + size * STATES_PER_CONTEXT, step - former)
        former, size = step, min(abs(step - former), 3)


@njit(cache=True, nogil=True)
def _write_image(depth, ranks, count, data, coder, states):
    """Encodes (H, W) ``depth`` with the level of each value."""
    height, width = depth.shape
    rows, errors = np.zeros((3, width + 4), np.int64), np.zeros((2, width + 4), np.int64)
    last, half, least = (count + 1) // 2, count // 2, -((count - 1) // 2)
    for y in range(height):
        row, above, top = rows[y % 3], rows[(y + 2) % 3], rows[(y + 1) % 3]
        error, former = errors[y % 2], errors[(y + 1) % 2]
        for x in range(2, width + 2):
            w, ww, n, nw, ne, nn = row[x - 1], row[x - 2], above[x], above[x - 1], above[x + 1], top[x]
            holes = (
                (w != 0) | (n != 0) << 1 | (nw != 0) << 2 | (ne != 0) << 3 | (ww != 0) << 4 | (nn != 0) << 5
            )
            v = int(np.int64(ranks[depth[y, x - 2]]))
            row[x], error[x] = 0, 0
            _encode_bit_with_state(coder, data, states, holes, int(v == 0))
            if v == 0:
                continue
            p = predict_level(w, n, nw, ne, last)
            recent = error[x - 1] + former[x] + ((former[x - 1] + former[x + 1]) >> 1)
            r = v - p
            r = r - count if r > half else (r + count if r < least else r)
            base = HOLE_STATES + compute_context_index(w, ww, n, ne, p, recent) * STATES_PER_CONTEXT
            _encode_residual(coder, data, states, base, r)
            row[x], error[x], last = v, min(abs(r), 2000), v


@njit(cache=True, nogil=True)
def pack_levels(depth, ranks, values, tabled, out):
    """Encodes the levels into ``out``, and returns the used bytes of it.

    The arguments are those of ``unpack_levels``, plus ``ranks`` (65536,): the level of each value.
    """
    states = np.full(STATE_COUNT, 32768 << 8, np.int32)
    coder = np.array([0, 0xFFFFFFFF, 0, 0], np.int64)
    if tabled:
        _write_table(values, out, coder, states)
    _write_image(depth, ranks, values.size - 1, out, coder, states)
    out[coder[2]] = (coder[0] >> 24) + 1
    return int(coder[2]) + 1
