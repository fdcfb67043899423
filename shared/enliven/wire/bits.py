"""Rice codes store small signed integers in few bits, and any other integer in a bounded number of bits.

An integer n is folded to u = 2n or -2n - 1, so that small magnitudes stay small (zigzag). It is written as u
>> k ones, a zero, and the low k bits of u (Rice, "Some practical universal noiseless coding techniques", JPL
79-22, 1979). If the code begins with ``ESCAPE_LENGTH`` ones, the integer follows as ``ESCAPE_BITS`` raw
bits, which bounds the code's length. All numbers in a column use the same k, which is chosen for the fewest
bits. The value ``ALL_ZERO_PARAMETER`` instead of k means that the whole column is zero.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from enliven.arrays import Int32, UInt8
from enliven.kernels import njit

ESCAPE_LENGTH: Any = np.int64(12)
"""Number of consecutive ones before a raw number."""
ESCAPE_BITS: Any = np.int64(22)
MAX_VALUE = int(2 ** (ESCAPE_BITS - 1) - 1)
"""The largest magnitude that can be encoded."""
ALL_ZERO_PARAMETER = 15
"""Value of the parameter k for a column of zeros. No further bits follow."""
PARAMETER_BITS: Any = np.int64(4)
"""Number of bits of a parameter k. It is an int64, because Numba would compile the code again for a plain
int.
"""


@njit(cache=True, nogil=True)
def find_best_parameter(column: Int32) -> tuple[int, int]:
    """Returns the Rice parameter k that needs the fewest bits for a column (N,), and the number of bits
    including the parameter.
    """
    if not column.any():
        return ALL_ZERO_PARAMETER, PARAMETER_BITS
    best, best_cost = 0, 2**62
    for k in range(ALL_ZERO_PARAMETER):
        cost = PARAMETER_BITS
        for n in column:
            quotient = (2 * n if n >= 0 else -2 * n - 1) >> k
            cost += quotient + 1 + k if quotient < ESCAPE_LENGTH else ESCAPE_LENGTH + ESCAPE_BITS
        if cost < best_cost:
            best, best_cost = k, cost
    return best, best_cost


@njit(cache=True, nogil=True)
def _write_bits(out: UInt8, at: int, value: int, count: int) -> int:
    """Writes the lowest ``count`` bits of ``value`` at bit position ``at``, most significant bit first.

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
    """Encodes a table (N, C) of integers within +-LIMIT column by column. The last byte is padded with zero
    bits."""
    rows, columns = table.shape
    parameters = np.empty(columns, np.int64)
    total = 0
    for c in range(columns):
        parameters[c], cost = find_best_parameter(table[:, c])
        total += cost
    out = np.zeros((total + 7) // 8, np.uint8)
    at: Any = np.int64(0)
    for c in range(columns):
        k = parameters[c]
        at = _write_bits(out, at, k, PARAMETER_BITS)
        if k == ALL_ZERO_PARAMETER:
            continue
        for r in range(rows):
            n = np.int64(table[r, c])
            folded = 2 * n if n >= 0 else -2 * n - 1
            quotient = folded >> k
            if quotient < ESCAPE_LENGTH:
                at = _write_bits(out, at, (1 << (quotient + 1)) - 2, quotient + 1)
                at = _write_bits(out, at, folded, k)
            else:
                at = _write_bits(out, at, (1 << ESCAPE_LENGTH) - 1, ESCAPE_LENGTH)
                at = _write_bits(out, at, folded, ESCAPE_BITS)
    return out


@njit(cache=True, nogil=True)
def _read_bits(data: UInt8, at: int, count: int) -> int:
    """Reads ``count`` bits at bit position ``at``. The caller must check that they exist."""
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
            if k == ALL_ZERO_PARAMETER:
                table[r, c] = 0
                continue
            quotient = 0
            while quotient < ESCAPE_LENGTH and at < end and _read_bits(data, at, once):
                quotient += 1
                at += 1
            count = ESCAPE_BITS
            if quotient < ESCAPE_LENGTH:
                at, count = at + 1, k
            if at + count > end:
                return False
            folded = _read_bits(data, at, count)
            if quotient < ESCAPE_LENGTH:
                folded |= quotient << k
            at += count
            table[r, c] = folded >> 1 if folded & 1 == 0 else -(folded >> 1) - 1
    return bool(end - at < 8 and _read_bits(data, at, end - at) == 0)
