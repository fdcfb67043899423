"""Encoded Protobuf messages with numbers that are overwritten for every frame.

The SDK of Foxglove builds one Python object for each point, colour and rotation: over a thousand in a frame.
Here it encodes the messages of a set of names once, with marks instead of numbers. A frame then overwrites
the bytes at the places of the marks.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from foxglove.messages import Timestamp

from enliven.arrays import AnyArray, Float, Int, UInt8

_MARK = 0x7A5E_C35A_0000_0000
"""Bits of the mark of number 0, a double of about 1e282. Number n adds n."""
_MARK_TIME = (1_234_567_891, 987_654_321)
"""Seconds and nanoseconds of the mark of a time. Both are encoded in five bytes, like the times of this
century."""
_VARINT_BYTES = 5
"""Bytes of each of the two numbers of a time."""
_FINITE_LIMIT = 1e300
"""Larger numbers are sent as 0, as are those that are not finite."""


class ProtobufTemplate:
    """One encoded message with places for its numbers and times.

    Args:
        encode: returns the encoded message with these numbers (``count``,) and this time.
        count: number of the numbers.
    """

    def __init__(self, encode: Callable[[Float, Timestamp], bytes], count: int) -> None:
        marks = (np.arange(count, dtype=np.uint64) + np.uint64(_MARK)).view(np.float64)
        data = encode(marks, Timestamp(*_MARK_TIME))
        self._data: UInt8 = np.frombuffer(bytearray(data), np.uint8)
        self._numbers = _places(data, [mark.tobytes() for mark in marks])
        stamp = b"\x08" + _varint(_MARK_TIME[0]) + b"\x10" + _varint(_MARK_TIME[1])
        begins = np.array(_occurrences(data, stamp), np.int64)[:, None]
        self._seconds = begins + 1 + np.arange(_VARINT_BYTES)
        self._nanoseconds = begins + 2 + _VARINT_BYTES + np.arange(_VARINT_BYTES)

    def filled(self, numbers: Float, time_ns: int) -> bytes:
        """Returns the message with these numbers and this time. Values that are not finite become 0."""
        if len(numbers) and not (numbers.max() < _FINITE_LIMIT and numbers.min() > -_FINITE_LIMIT):
            numbers = np.where(np.abs(numbers) < _FINITE_LIMIT, numbers, 0.0)
        self._data[self._numbers] = np.ascontiguousarray(numbers, "<f8").view(np.uint8).reshape(-1, 8)
        seconds, nanoseconds = divmod(max(time_ns, 0), 1_000_000_000)
        self._data[self._seconds] = np.frombuffer(_varint(seconds), np.uint8)
        self._data[self._nanoseconds] = np.frombuffer(_varint(nanoseconds), np.uint8)
        return self._data.tobytes()


def _varint(number: int) -> bytes:
    """Returns a number as a varint of always five bytes. Readers accept leading zeros."""
    parts = [(number >> (7 * place)) & 0x7F for place in range(_VARINT_BYTES)]
    return bytes([*(part | 0x80 for part in parts[:-1]), parts[-1]])


def _places(data: bytes, marks: list[bytes]) -> Int:
    """Returns (N, 8) where the bytes of each mark are. The marks are mostly in their order."""
    begins, after = [], 0
    for mark in marks:
        begin = data.find(mark, after)
        begin = begin if begin >= 0 else data.index(mark)
        begins.append(begin)
        after = begin + len(mark)
    places: AnyArray = np.array(begins, np.int64).reshape(-1, 1) + np.arange(8)
    return places


def _occurrences(data: bytes, part: bytes) -> list[int]:
    """Returns where a part occurs."""
    places, begin = list[int](), data.find(part)
    while begin >= 0:
        places.append(begin)
        begin = data.find(part, begin + len(part))
    return places
