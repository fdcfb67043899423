"""Decodes depth images that are compressed by an arithmetic coder, the archive format of earlier versions.

Every level is coded as answers to yes-no questions (a hole? as predicted? above or below? by how much?). The
probability of each answer is learned from previous answers in the same context. The coder is the carry-free
one with 32-bit bounds (Witten, Neal and Cleary, CACM 30(6), 1987, reduced to two symbols).

Unsigned values are first converted to np.int64. In Numba, int() of an unsigned value stays unsigned, and
mixing unsigned with signed integers gives a float.
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import AnyArray, UInt8, UInt16
from enliven.kernels import njit
from enliven.recording.depth_kernels import predict_level

CONTEXT_COUNT = 12 * 625
"""Number of contexts of a pixel: 12 classes of recent errors times 5^4 patterns of differences between
neighbours."""
STATES_PER_CONTEXT = 15
"""Number of questions about a residual that have a separate probability in each context. Large residuals use
further questions.
"""
MAX_UNARY_LENGTH = 12
"""Number of residual sizes with a separate question. Larger sizes are coded in bits. Part of
:data:`~enliven.recording.depth_codec.LAYOUT`.
"""
HOLE_STATES = 64
"""Number of states of the question "is it a hole?". There is one for each of the 2^6 patterns of six known or
unknown neighbours.
"""
LARGE_STATES_START = HOLE_STATES + CONTEXT_COUNT * STATES_PER_CONTEXT
"""Index of the first state for the number of bits of a large residual."""
TABLE_STATES_START = LARGE_STATES_START + 20
"""Index of the first state for the steps between the levels of the table."""
STATE_COUNT = TABLE_STATES_START + 4 * STATES_PER_CONTEXT
"""Number of states of an image. Archives depend on all these indices."""
_ADAPTING_ANSWERS = 60
"""Number of answers after which a question's probability adapts at a constant rate, so that it follows a
changing image. It is part of the layout."""

_ADAPTATION_RATES = np.array([round(65536 / (n + 1.6)) for n in range(_ADAPTING_ANSWERS + 1)], np.int64)
"""(61,) adaptation rate of a probability at the n-th answer, in units of 1 / 65536."""


@njit(cache=True, nogil=True)
def update_state(states: AnyArray, at: int, bit: int) -> None:
    """Adapts the probability of a question towards the answer ``bit``. The low byte of a state counts the
    answers."""
    state = int(states[at])
    odds, count = state >> 8, state & 255
    odds += ((65535 * bit - odds) * _ADAPTATION_RATES[count]) >> 16
    odds = min(max(odds, 32), 65503)
    states[at] = (odds << 8) | min(count + 1, _ADAPTING_ANSWERS)


@njit(cache=True, nogil=True)
def _decode_bit(coder: AnyArray, data: UInt8, odds: int) -> int:
    """Decodes one answer. ``coder`` is (4,) int64: low bound, high bound, number of bytes read, and current
    value."""
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
    return int(bit)


@njit(cache=True, nogil=True)
def _decode_with_state(coder: AnyArray, data: UInt8, states: AnyArray, at: int) -> int:
    """Decodes one answer with the probability stored in a state."""
    bit = _decode_bit(coder, data, int(states[at]) >> 8)
    update_state(states, at, bit)
    return int(bit)


@njit(cache=True, nogil=True)
def _difference_class(difference: int) -> int:
    return min(max(difference, -2), 2) + 2


@njit(cache=True, nogil=True)
def compute_context_index(w: int, ww: int, n: int, ne: int, p: int, recent: int) -> int:
    """Returns the index of a pixel's context, 0..SURROUNDINGS-1."""
    size = 0
    while size < 11 and recent >> size > 0:
        size += 1
    at = (
        ((size * 5 + _difference_class(n - p)) * 5 + _difference_class(w - p)) * 5 + _difference_class(ne - p)
    ) * 5 + _difference_class(ww - w)
    return int(at)


@njit(cache=True, nogil=True)
def _decode_residual(coder: AnyArray, data: UInt8, states: AnyArray, base: int) -> int:
    """Decodes a residual: the question whether it is zero, its sign, and its size. Small sizes have one
    question per step, and larger sizes are coded in bits."""
    if _decode_with_state(coder, data, states, base):
        return 0
    negative = _decode_with_state(coder, data, states, base + 1)
    for m in range(1, MAX_UNARY_LENGTH + 1):
        if _decode_with_state(coder, data, states, base + 1 + m):
            return -m if negative else m
    bits, value = 0, 1
    while bits < 17 and not _decode_with_state(coder, data, states, LARGE_STATES_START + bits):
        bits += 1
    for _ in range(bits):
        value = (value << 1) | _decode_bit(coder, data, 32768)
    size = value + MAX_UNARY_LENGTH
    return -size if negative else size


@njit(cache=True, nogil=True)
def _read_table(values: UInt16, data: UInt8, coder: AnyArray, states: AnyArray) -> bool:
    """Decodes the ascending ``values`` (P + 1,). Each step is predicted to equal the previous step."""
    former, size = 1, 0
    for level in range(1, values.size):
        r = _decode_residual(coder, data, states, TABLE_STATES_START + size * STATES_PER_CONTEXT)
        step = former + r
        value = int(np.int64(values[level - 1])) + step
        if step < 1 or value > 65535:
            return False
        values[level] = value
        former, size = step, min(abs(r), 3)
    return True


@njit(cache=True, nogil=True)
def _read_image(depth: UInt16, values: UInt16, data: UInt8, coder: AnyArray, states: AnyArray) -> bool:
    """Decodes the image ``depth`` (H, W). ``values`` are the depths of the levels. Returns False if the data
    is invalid."""
    height, width = depth.shape
    count = values.size - 1
    rows, errors = np.zeros((3, width + 4), np.int64), np.zeros((2, width + 4), np.int64)
    last = (count + 1) // 2
    for y in range(height):
        row, above, top = rows[y % 3], rows[(y + 2) % 3], rows[(y + 1) % 3]
        error, former = errors[y % 2], errors[(y + 1) % 2]
        for x in range(2, width + 2):
            w, ww, n, nw, ne, nn = row[x - 1], row[x - 2], above[x], above[x - 1], above[x + 1], top[x]
            holes = (
                (w != 0) | (n != 0) << 1 | (nw != 0) << 2 | (ne != 0) << 3 | (ww != 0) << 4 | (nn != 0) << 5
            )
            row[x], error[x] = 0, 0
            if _decode_with_state(coder, data, states, holes):
                depth[y, x - 2] = 0
                continue
            p = predict_level(w, n, nw, ne, last)
            recent = error[x - 1] + former[x] + ((former[x - 1] + former[x + 1]) >> 1)
            r = _decode_residual(
                coder,
                data,
                states,
                HOLE_STATES + compute_context_index(w, ww, n, ne, p, recent) * STATES_PER_CONTEXT,
            )
            v = p + r
            v = v - count if v > count else (v + count if v < 1 else v)
            if v < 1 or v > count:
                return False
            depth[y, x - 2] = values[v]
            row[x], error[x], last = v, min(abs(r), 2000), v
    return True


@njit(cache=True, nogil=True)
def unpack_levels(data: UInt8, values: UInt16, tabled: bool, depth: UInt16) -> bool:
    """Decodes packed bytes to the image ``depth`` (H, W). Returns False if they are not a valid image.

    Args:
        data: the packed bytes. Bytes beyond their end are read as zeros.
        values: (P + 1,) the depth of each level in millimetres. Overwritten if ``tabled`` is True.
        tabled: True if the data contains the depths of the levels.
        depth: (H, W) receives the image, millimetres.
    """
    states = np.full(STATE_COUNT, 32768 << 8, np.int32)
    coder = np.array([0, 0xFFFFFFFF, 4, 0], np.int64)
    for at in range(4):
        coder[3] = (coder[3] << 8) | (int(np.int64(data[at])) if at < data.size else 0)
    if tabled and not _read_table(values, data, coder, states):
        return False
    return bool(_read_image(depth, values, data, coder, states))
