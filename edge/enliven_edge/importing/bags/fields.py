"""Reads the fields of a ROS message one after the other, within its bounds."""

from __future__ import annotations

import struct

from enliven.errors import InputError

_MOST_TEXT = 4096
"""Bytes of a name, or of a number as text."""


class Fields:
    """A message as ROS 1 writes it: numbers side by side, texts and blocks with their size before.

    Args:
        data: the message.
        where: the file and topic, for messages.
    """

    def __init__(self, data: bytes, where: str) -> None:
        self._data, self._at, self.where = data, 0, where

    def number(self, kind: str) -> int | float:
        """Reads the next number, of a kind of :mod:`struct`, such as "I" or "d"."""
        (value,) = self.numbers(kind)
        return value

    def count(self) -> int:
        """Reads the next unsigned number of 32 bits."""
        return int(self.number("I"))

    def numbers(self, kinds: str) -> tuple[float, ...]:
        """Reads the next numbers, one for each letter.

        Raises:
            InputError: where the message is shorter.
        """
        return struct.unpack("<" + kinds, self._take(struct.calcsize("<" + kinds)))

    def text(self) -> str:
        """Reads the next text."""
        size = self.count()
        if size > _MOST_TEXT:
            raise self.damaged()
        return self._take(size).decode("utf-8", errors="replace")

    def block(self) -> bytes:
        """Reads the next bytes, as many as the number before them states."""
        return self._take(self.count())

    def damaged(self) -> InputError:
        """Returns the error for a message with impossible content."""
        return InputError("a message is damaged", where=self.where, mend="Copy the recording again.")

    def _take(self, size: int) -> bytes:
        taken = self._data[self._at : self._at + size]
        if len(taken) != size:
            raise self.damaged()
        self._at += size
        return taken


class AlignedFields(Fields):
    """A message as ROS 2 writes it (CDR, little-endian): numbers lie at multiples of their size."""

    def __init__(self, data: bytes, where: str) -> None:
        super().__init__(data[4:], where)
        if data[:2] != b"\0\1":
            raise self.damaged()

    def numbers(self, kinds: str) -> tuple[float, ...]:
        values: list[float] = []
        for kind in kinds:
            self._at += -self._at % struct.calcsize(kind)
            values += super().numbers(kind)
        return tuple(values)

    def text(self) -> str:
        """Reads the next text, without its final zero byte."""
        return super().text().rstrip("\0")
