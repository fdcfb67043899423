"""Rice codes: they store small signed integers in few bits, and any integer in a bounded number of bits.

An integer n is folded to u = 2n or -2n - 1, so that small magnitudes stay small (zigzag). It is written as u
>> k ones, a zero, and the low k bits of u (Rice, "Some practical universal noiseless coding techniques", JPL
79-22, 1979). ``ESCAPE`` ones announce ``ESCAPE_BITS`` raw bits instead, which bounds the worst case. A column
of numbers shares one k, the one with the fewest bits. ``ALL_ZERO`` in place of k means that the whole column
is zero.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from enliven.arrays import Int32, UInt8
from enliven.kernels import njit

ESCAPE: Any = np.int64(12)
"""Number of consecutive ones that announce a raw number."""
ESCAPE_BITS: Any = np.int64(22)
LIMIT = int(2 ** (ESCAPE_BITS - 1) - 1)
"""The largest magnitude that can be encoded."""
ALL_ZERO = 15
"""The parameter value for a column of zeros, which needs no further bits."""
PARAMETER_BITS: Any = np.int64(4)
"""Number of bits of a parameter. It is an int64, because a plain int would be a different type for the
compiler.
"""


@njit(cache=True, nogil=True)
def best_parameter(column: Int32) -> tuple[int, int]:
    """Returns the Rice parameter of an (N,) column with the fewest bits, and the number of bits including the
    parameter.
    """
    if not column.any():
        return ALL_ZERO, PARAMETER_BITS
    best, best_cost = 0, 2**62
    for k in range(ALL_ZERO):
        cost = PARAMETER_BITS
        for n in column:
            quotient = (2 * n if n >= 0 else -2 * n - 1) >> k
            cost += quotient + 1 + k if quotient < ESCAPE else ESCAPE + ESCAPE_BITS
        if cost < best_cost:
            best, best_cost = k, cost
    return best, best_cost


@njit(cache=True, nogil=True)
def _write_bits(out: UInt8, at: int, value: int, count: int) -> int:
    """Writes the low ``count`` bits of ``value`` at bit ``at``, most significant first.

    Returns the next bit position.
    """
    remaining = count
    while remaining > 0:
        free = 8 - (at & 7)
        width = min(free, remaining)
        remaining -= width
        chunk = (value >> remaining) & ((1 << width) - 1)
        out[at >> 3] |= np.uint8(chunk << (free - width))
        at += width
    return at


@njit(cache=True, nogil=True)
def encode_columns(table: Int32) -> UInt8:
    """Returns the bytes of an (N, C) table of integers within +-LIMIT, by columns, padded with zero bits."""
    rows, columns = table.shape
    parameters = np.empty(columns, np.int64)
    total = 0
    for c in range(columns):
        parameters[c], cost = best_parameter(table[:, c])
        total += cost
    out = np.zeros((total + 7) // 8, np.uint8)
    at: Any = np.int64(0)
    for c in range(columns):
        k = parameters[c]
        at = _write_bits(out, at, k, PARAMETER_BITS)
        if k == ALL_ZERO:
            continue
        for r in range(rows):
            n = np.int64(table[r, c])
            folded = 2 * n if n >= 0 else -2 * n - 1
            quotient = folded >> k
            if quotient < ESCAPE:
                at = _write_bits(out, at, (1 << (quotient + 1)) - 2, quotient + 1)
                at = _write_bits(out, at, folded, k)
            else:
                at = _write_bits(out, at, (1 << ESCAPE) - 1, ESCAPE)
                at = _write_bits(out, at, folded, ESCAPE_BITS)
    return out


@njit(cache=True, nogil=True)
def _read_bits(data: UInt8, at: int, count: int) -> int:
    """Returns the ``count`` bits at bit ``at``. The caller has checked that they exist."""
    value, remaining = 0, count
    while remaining > 0:
        available = 8 - (at & 7)
        width = min(available, remaining)
        chunk = (int(data[at >> 3]) >> (available - width)) & ((1 << width) - 1)
        value = (value << width) | chunk
        at += width
        remaining -= width
    return value


@njit(cache=True, nogil=True)
def decode_columns(data: UInt8, table: Int32) -> bool:
    """Fills an (N, C) table from the bytes of :func:`encode_columns`. Returns False for invalid bytes.

    Too few bytes, an extra byte, or a one in the padding is invalid.
    """
    rows, columns = table.shape
    at: Any = np.int64(0)
    end, once = 8 * len(data), np.int64(1)
    for c in range(columns):
        if at + PARAMETER_BITS > end:
            return False
        k = _read_bits(data, at, PARAMETER_BITS)
        at += PARAMETER_BITS
        for r in range(rows):
            if k == ALL_ZERO:
                table[r, c] = 0
                continue
            quotient = 0
            while quotient < ESCAPE and at < end and _read_bits(data, at, once):
                quotient += 1
                at += 1
            count = ESCAPE_BITS
            if quotient < ESCAPE:
                at, count = at + 1, k
            if at + count > end:
                return False
            folded = _read_bits(data, at, count)
            if quotient < ESCAPE:
                folded |= quotient << k
            at += count
            table[r, c] = folded >> 1 if folded & 1 == 0 else -(folded >> 1) - 1
    return bool(end - at < 8 and _read_bits(data, at, end - at) == 0)
