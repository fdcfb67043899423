"""JSON text that is encoded once, with numbers that are filled in for every frame.

A JSON encoder walks through thousands of Python objects in each frame, and holds the interpreter's lock for a
millisecond. Here msgspec encodes a set of names once, with a mark at the place of each number. A kernel then
writes the constant text and the numbers of a frame, without the lock.
"""

from __future__ import annotations

from typing import Any

import msgspec
import numpy as np

from enliven.arrays import AnyArray
from enliven.kernels import njit

MARK = "\ue000\ue000enliven number\ue000\ue000"
"""Stands for a number in the value that a template is made from. Its private characters occur in no name."""
MAX_NUMBER = 1e9
"""Limit of the numbers that are written. No position is that far away."""
_MAX_NUMBER_BYTES = 20
"""Longest text of a number: sign, ten digits, a point and eight digits."""


class JsonTemplate:
    """Encoded JSON with places for numbers.

    Args:
        value: objects for msgspec, with :data:`MARK` instead of each number.
        decimals: (N,) digits after the point of each number, in the order of the text, from 1 to 8.

    Attributes:
        count: how many numbers it has.
    """

    def __init__(self, value: Any, decimals: AnyArray) -> None:
        pieces = msgspec.json.encode(value).split(msgspec.json.encode(MARK))
        self.count = len(pieces) - 1
        self._text = np.frombuffer(bytearray(b"".join(pieces)), np.uint8)
        self._ends = np.cumsum([len(piece) for piece in pieces])
        self._decimals = np.array(np.broadcast_to(decimals, self.count), np.int64)
        self._out = np.empty(len(self._text) + _MAX_NUMBER_BYTES * self.count, np.uint8)

    def filled(self, numbers: AnyArray) -> bytes:
        """Returns the text with these numbers (``count``,). Values that are not finite become 0."""
        values = np.ascontiguousarray(numbers, np.float64)
        return self._out[: _write(self._text, self._ends, values, self._decimals, self._out)].tobytes()


_POWERS = np.array([10.0**k for k in range(9)])
"""(9,) the factor of each number of decimals."""
_TEN = np.uint32(10)
"""Divisor of unsigned numbers, which the compiler replaces by a multiplication."""


@njit(cache=True, nogil=True)
def _write(text, ends, numbers, decimals, out):
    """Writes constant text and numbers alternately, and returns the number of written bytes (kernel)."""
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
    """Writes the shortest text of a rounded number at ``length``, and returns the new length (kernel)."""
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
