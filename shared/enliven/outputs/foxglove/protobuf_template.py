"""Protobuf messages that are encoded once. In each frame, only their numbers are overwritten.

The SDK of Foxglove builds one Python object for each point, colour and rotation: over a thousand in a frame.
Here the SDK encodes the messages for a set of names once, with placeholders (marks) instead of numbers. In
each frame, the bytes of the marks are overwritten.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from foxglove.messages import Timestamp

from enliven.arrays import AnyArray, Float, Int, UInt8

_PLACEHOLDER_NUMBER = 0x7A5E_C35A_0000_0000
"""Bits of the mark of number 0, as a double (about 1e282). The mark of number n is this value plus n."""
_PLACEHOLDER_TIME = (1_234_567_891, 987_654_321)
"""Seconds and nanoseconds of the mark of a time. Both are encoded in five bytes, like current times."""
_VARINT_BYTES = 5
"""Size in bytes of the encoded seconds, and of the encoded nanoseconds."""
_FINITE_LIMIT = 1e300
"""Limit of the absolute values that are sent. Larger values and values that are not finite are sent as 0."""


class ProtobufTemplate:
    """An encoded message with placeholders for its numbers and times.

    Args:
        encode: a function that returns the encoded message for given numbers (``count``,) and a time.
        count: how many numbers the message contains.
    """

    def __init__(self, encode: Callable[[Float, Timestamp], bytes], count: int) -> None:
        marks = (np.arange(count, dtype=np.uint64) + np.uint64(_PLACEHOLDER_NUMBER)).view(np.float64)
        data = encode(marks, Timestamp(*_PLACEHOLDER_TIME))
        self._data: UInt8 = np.frombuffer(bytearray(data), np.uint8)
        self._numbers = _find_marks(data, [mark.tobytes() for mark in marks])
        stamp = b"\x08" + _varint(_PLACEHOLDER_TIME[0]) + b"\x10" + _varint(_PLACEHOLDER_TIME[1])
        begins = np.array(_find_occurrences(data, stamp), np.int64)[:, None]
        self._seconds = begins + 1 + np.arange(_VARINT_BYTES)
        self._nanoseconds = begins + 2 + _VARINT_BYTES + np.arange(_VARINT_BYTES)

    def fill_values(self, numbers: Float, time_ns: int) -> bytes:
        """Returns the message with ``numbers`` (``count``,) and the time. Values that are not finite become
        0."""
        if len(numbers) and not (numbers.max() < _FINITE_LIMIT and numbers.min() > -_FINITE_LIMIT):
            numbers = np.where(np.abs(numbers) < _FINITE_LIMIT, numbers, 0.0)
        self._data[self._numbers] = np.ascontiguousarray(numbers, "<f8").view(np.uint8).reshape(-1, 8)
        seconds, nanoseconds = divmod(max(time_ns, 0), 1_000_000_000)
        self._data[self._seconds] = np.frombuffer(_varint(seconds), np.uint8)
        self._data[self._nanoseconds] = np.frombuffer(_varint(nanoseconds), np.uint8)
        return self._data.tobytes()


def _varint(number: int) -> bytes:
    """Returns a number as a varint that is padded to five bytes. Protobuf readers accept the padding."""
    parts = [(number >> (7 * place)) & 0x7F for place in range(_VARINT_BYTES)]
    return bytes([*(part | 0x80 for part in parts[:-1]), parts[-1]])


def _find_marks(data: bytes, marks: list[bytes]) -> Int:
    """Returns the indices (N, 8) of the bytes of each mark in ``data``. The search is fast if the marks occur
    in their order."""
    begins, after = [], 0
    for mark in marks:
        begin = data.find(mark, after)
        begin = begin if begin >= 0 else data.index(mark)
        begins.append(begin)
        after = begin + len(mark)
    places: AnyArray = np.array(begins, np.int64).reshape(-1, 1) + np.arange(8)
    return places


def _find_occurrences(data: bytes, part: bytes) -> list[int]:
    """Returns the indices at which ``part`` occurs in ``data``."""
    places, begin = list[int](), data.find(part)
    while begin >= 0:
        places.append(begin)
        begin = data.find(part, begin + len(part))
    return places
