"""JSON text that is encoded once. In each frame, only its numbers are written.

Encoding thousands of Python objects in each frame would hold Python's global lock for a millisecond. Here
msgspec encodes the message for a set of names once, with a placeholder (mark) for each number. In each frame,
a kernel writes the constant text and the numbers without holding the lock.
"""

from __future__ import annotations

from typing import Any

import msgspec
import numpy as np

from enliven.arrays import AnyArray
from enliven.kernels import njit

MARK = "\ue000\ue000enliven number\ue000\ue000"
"""Placeholder for a number in the value that a template is created from. It contains private-use characters,
which do not occur in names."""
MAX_NUMBER = 1e9
"""Limit of the absolute values that are written. No position is that far from the origin."""
_MAX_NUMBER_BYTES = 20
"""Maximum size in bytes of the text of a number: sign, ten digits, a decimal point and eight digits."""


class JsonTemplate:
    """Encoded JSON text with placeholders for numbers.

    Args:
        value: nested objects to be encoded, with :data:`MARK` instead of each number.
        decimals: (N,) number of decimals, from 1 to 8, of each number, in the order of the text.

    Attributes:
        count: how many numbers the text contains.
    """

    def __init__(self, value: Any, decimals: AnyArray) -> None:
        pieces = msgspec.json.encode(value).split(msgspec.json.encode(MARK))
        self.count = len(pieces) - 1
        self._text = np.frombuffer(bytearray(b"".join(pieces)), np.uint8)
        self._ends = np.cumsum([len(piece) for piece in pieces])
        self._decimals = np.array(np.broadcast_to(decimals, self.count), np.int64)
        self._out = np.empty(len(self._text) + _MAX_NUMBER_BYTES * self.count, np.uint8)

    def fill_numbers(self, numbers: AnyArray) -> bytes:
        """Returns the text with ``numbers`` (``count``,). Values that are not finite become 0."""
        values = np.ascontiguousarray(numbers, np.float64)
        return self._out[: _write(self._text, self._ends, values, self._decimals, self._out)].tobytes()


_POWERS = np.array([10.0**k for k in range(9)])
"""(9,) powers of ten: entry k is the factor for k decimals."""
_TEN = np.uint32(10)
"""Divisor 10 as an unsigned integer. The compiler replaces a division by it with a multiplication."""


@njit(cache=True, nogil=True)
def _write(text, ends, numbers, decimals, out):
    """Writes constant text and numbers alternately to ``out``, and returns the number of written
    bytes."""
    length, begin = 0, 0
    for k in range(len(ends)):
        count = ends[k] - begin
        for i in range(count):
            out[length + i] = text[begin + i]
        length += count
        begin = ends[k]
        if k < len(numbers):
            length = _write_number(numbers[k], decimals[k], out, length)
    return length


@njit(cache=True, nogil=True)
def _write_number(number, decimals, out, length):
    """Writes the shortest text of a rounded number to ``out`` at index ``length``, and returns the
    new length."""
    if not np.isfinite(number):
        number = 0.0
    size = min(abs(number), MAX_NUMBER)
    floor = np.floor(size)
    scaled = np.rint((size - floor) * _POWERS[decimals])
    if scaled >= _POWERS[decimals]:
        floor, scaled = floor + 1.0, 0.0
    whole, fraction = np.uint32(floor), np.uint32(scaled)
    if number < 0.0 and (whole > 0 or fraction > 0):
        out[length] = 45  # "-"
        length += 1
    width, limit = 1, 10.0
    while floor >= limit:
        width, limit = width + 1, limit * 10.0
    length += width
    for place in range(1, width + 1):
        out[length - place] = 48 + whole % _TEN
        whole = np.uint32(whole // _TEN)
    out[length] = 46  # "."
    length += 1
    places = decimals
    while places > 1 and fraction % _TEN == 0:
        fraction, places = np.uint32(fraction // _TEN), places - 1
    length += places
    for place in range(1, places + 1):
        out[length - place] = 48 + fraction % _TEN
        fraction = np.uint32(fraction // _TEN)
    return length
