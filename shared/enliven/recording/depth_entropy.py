"""Compiled loops of the small packing: a binary arithmetic coder with odds conditioned on the neighbours.

Every level is told apart by yes-no questions (a hole? as predicted? above or below? by how much?), and the
odds of each answer are learned from the answers so far in the same surroundings. The coder is the
carry-free one with 32-bit bounds (Witten, Neal and Cleary, CACM 30(6), 1987, narrowed to two symbols).

Unsigned values pass through np.int64 first: compiled, int() of them is unsigned, and unsigned with signed
makes a float.
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import AnyArray, UInt8, UInt16
from enliven.kernels import njit
from enliven.recording.depth_kernels import predict_level

SURROUNDINGS = 12 * 625
"""Surroundings of a pixel that are told apart: 12 sizes of recent errors, 5^4 shapes of the neighbours."""
QUESTIONS = 15
"""Questions about a residual with odds by surroundings; the answers of large residuals go on elsewhere."""
UNARY = 12
"""Sizes of a residual that have a question each; larger ones are coded in bits. Part of
:data:`~enliven.recording.depth_codec.LAYOUT`."""
_HOLES = 64
"""States of the question "hole?": one for each known-or-not pattern of six neighbours, 2^6."""
_LARGE = _HOLES + SURROUNDINGS * QUESTIONS
_TABLE = _LARGE + 20
_STATES = _TABLE + 4 * QUESTIONS
_PATIENCE = 60
"""Answers after which a question's odds adapt no slower: they keep following a changing image. Part of the
layout."""

_RATES = np.array([round(65536 / (n + 1.6)) for n in range(_PATIENCE + 1)], np.int64)
"""(61,) how far (of 65536) an odd moves to the n-th answer."""


@njit(cache=True, nogil=True)
def _learn(states: AnyArray, at: int, bit: int) -> None:
    """Moves the odds of a question towards the answer; the low byte of a state counts the answers."""
    state = int(states[at])
    odds, count = state >> 8, state & 255
    odds += ((65535 * bit - odds) * _RATES[count]) >> 16
    odds = min(max(odds, 32), 65503)
    states[at] = (odds << 8) | min(count + 1, _PATIENCE)


@njit(cache=True, nogil=True)
def _put(coder: AnyArray, out: UInt8, odds: int, bit: int) -> None:
    """Encode one answer. ``coder`` is (3,) int64: low bound, high bound, bytes written."""
    low, high = coder[0], coder[1]
    width = high - low
    middle = low + (width >> 16) * odds + (((width & 0xFFFF) * odds) >> 16)
    if bit:
        high = middle
    else:
        low = middle + 1
    while (low ^ high) & 0xFF000000 == 0:
        if coder[2] < out.size:
            out[coder[2]] = high >> 24
        coder[2] += 1
        low, high = (low << 8) & 0xFFFFFFFF, ((high << 8) & 0xFFFFFFFF) | 255
    coder[0], coder[1] = low, high


@njit(cache=True, nogil=True)
def _get(coder: AnyArray, data: UInt8, odds: int) -> int:
    """Decode one answer. ``coder`` is (4,) int64: low bound, high bound, bytes read, the value between."""
    low, high, value = coder[0], coder[1], coder[3]
    width = high - low
    middle = low + (width >> 16) * odds + (((width & 0xFFFF) * odds) >> 16)
    bit = 1 if value <= middle else 0
    if bit:
        high = middle
    else:
        low = middle + 1
    while (low ^ high) & 0xFF000000 == 0:
        byte = int(np.int64(data[coder[2]])) if coder[2] < data.size else 0
        coder[2] += 1
        low, high = (low << 8) & 0xFFFFFFFF, ((high << 8) & 0xFFFFFFFF) | 255
        value = ((value << 8) & 0xFFFFFFFF) | byte
    coder[0], coder[1], coder[3] = low, high, value
    return bit


@njit(cache=True, nogil=True)
def _ask(coder: AnyArray, data: UInt8, states: AnyArray, at: int, bit: int, encode: bool) -> int:
    """Encode the answer ``bit``, or decode and return it, with the odds of a state."""
    odds = int(states[at]) >> 8
    if encode:
        _put(coder, data, odds, bit)
    else:
        bit = _get(coder, data, odds)
    _learn(states, at, bit)
    return bit


@njit(cache=True, nogil=True)
def _shape(difference: int) -> int:
    return min(max(difference, -2), 2) + 2


@njit(cache=True, nogil=True)
def _surroundings(w: int, ww: int, n: int, ne: int, p: int, recent: int) -> int:
    """The index of a pixel's surroundings, 0..SURROUNDINGS-1."""
    size = 0
    while size < 11 and recent >> size > 0:
        size += 1
    at = (((size * 5 + _shape(n - p)) * 5 + _shape(w - p)) * 5 + _shape(ne - p)) * 5 + _shape(ww - w)
    return int(at)


@njit(cache=True, nogil=True)
def _residual(coder: AnyArray, data: UInt8, states: AnyArray, base: int, r: int, encode: bool) -> int:
    """Encode ``r``, or decode and return it: zero? negative? then the size, one by one and then in bits."""
    if _ask(coder, data, states, base, int(r == 0), encode):
        return 0
    negative = _ask(coder, data, states, base + 1, int(r < 0), encode)
    size = abs(r)
    for m in range(1, UNARY + 1):
        if _ask(coder, data, states, base + 1 + m, int(size == m), encode):
            return -m if negative else m
    rest, bits = size - UNARY, 0
    while bits < 17 and not _ask(coder, data, states, _LARGE + bits, int(rest >> (bits + 1) == 0), encode):
        bits += 1
    made = 1
    for b in range(bits - 1, -1, -1):
        bit = (rest >> b) & 1
        if encode:
            _put(coder, data, 32768, bit)
        else:
            bit = _get(coder, data, 32768)
        made = (made << 1) | bit
    size = made + UNARY
    return -size if negative else size


@njit(cache=True, nogil=True)
def _code_table(values: UInt16, data: UInt8, coder: AnyArray, states: AnyArray, encode: bool) -> bool:
    """Encode the ascending (P + 1,) ``values``, or decode them; a step is expected to be as the former."""
    former, size = 1, 0
    for level in range(1, values.size):
        step = int(np.int64(values[level])) - int(np.int64(values[level - 1])) if encode else 0
        r = _residual(coder, data, states, _TABLE + size * QUESTIONS, step - former, encode)
        step = former + r
        if not encode:
            value = int(np.int64(values[level - 1])) + step
            if step < 1 or value > 65535:
                return False
            values[level] = value
        former, size = step, min(abs(r), 3)
    return True


@njit(cache=True, nogil=True)
def _code_image(
    depth: UInt16, table: UInt16, count: int, data: UInt8, coder: AnyArray, states: AnyArray, encode: bool
) -> bool:
    """Encode (H, W) ``depth`` into ``data``, or decode it from there; False where the data make no image.

    ``table`` is the level of each value to encode, the value of each level to decode.
    """
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
            v = int(np.int64(table[depth[y, x - 2]])) if encode else 0
            row[x], error[x] = 0, 0
            if _ask(coder, data, states, holes, int(v == 0), encode):
                depth[y, x - 2] = 0
                continue
            p = predict_level(w, n, nw, ne, last)
            recent = error[x - 1] + former[x] + ((former[x - 1] + former[x + 1]) >> 1)
            r = v - p
            if encode:
                r = r - count if r > half else (r + count if r < least else r)
            base = _HOLES + _surroundings(w, ww, n, ne, p, recent) * QUESTIONS
            r = _residual(coder, data, states, base, r, encode)
            if not encode:
                v = p + r
                v = v - count if v > count else (v + count if v < 1 else v)
                if v < 1 or v > count:
                    return False
                depth[y, x - 2] = table[v]
            row[x], error[x], last = v, min(abs(r), 2000), v
    return True


@njit(cache=True, nogil=True)
def pack_levels(depth: UInt16, ranks: UInt16, values: UInt16, tabled: bool, out: UInt8) -> int:
    """The bytes used of ``out`` for an (H, W) image, or -1 where they do not suffice.

    Args:
        depth: (H, W) millimetres; not changed.
        ranks: (65536,) the level of each value, 0..P.
        values: (P + 1,) the millimetres of each level.
        tabled: whether the values are written too.
        out: room for the packed bytes.
    """
    states = np.full(_STATES, 32768 << 8, np.int32)
    coder = np.array([0, 0xFFFFFFFF, 0, 0], np.int64)
    if tabled:
        _code_table(values, out, coder, states, True)
    _code_image(depth, ranks, values.size - 1, out, coder, states, True)
    if coder[2] >= out.size:
        return -1
    out[coder[2]] = (coder[0] >> 24) + 1
    return int(coder[2]) + 1


@njit(cache=True, nogil=True)
def unpack_levels(data: UInt8, values: UInt16, tabled: bool, depth: UInt16) -> bool:
    """Fill (H, W) ``depth`` from packed bytes; False where they are not those of an image.

    Args:
        data: the packed bytes; zeros follow after their end.
        values: (P + 1,) the millimetres of each level; written where they are in the data.
        tabled: whether the values are in the data.
        depth: (H, W), written.
    """
    states = np.full(_STATES, 32768 << 8, np.int32)
    coder = np.array([0, 0xFFFFFFFF, 4, 0], np.int64)
    for at in range(4):
        coder[3] = (coder[3] << 8) | (int(np.int64(data[at])) if at < data.size else 0)
    if tabled and not _code_table(values, data, coder, states, False):
        return False
    return bool(_code_image(depth, values, values.size - 1, data, coder, states, False))
